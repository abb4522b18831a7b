"""A loop that runs for hours: memory of each process, latency over time, and the usual verdict.

The log is judged file by file, each after it is closed, so that memory and disk suffice for a soak of any length.
"""

import contextlib
import math
import os
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.log.damage import of_all_files
from bridge.log.log_reader import LogReader
from bridge.log.logfile import feed
from bridge.log.storage.checksums import Checksums
from bridge.log.storage.parts import parts_of
from bridge.processes import pid_here
from bridge.results import in_json
from bridge.units import counted
from bridge.wire.zenoh_link import Bus, BusConfig
from cockpit.judge.run_judge import RunJudge
from cockpit.judge.verdict import RunVerdict
from cockpit.judge.verdict_words import in_words
from cockpit.judge.watches import LatencyWatch
from cockpit.live.listener import ROLES
from cockpit.run.processes import run_processes

_LOOK_S = 0.5  # time between two samples of the memory
_MOST_PERIODS = 60  # most periods, rows of the report's latency table; fewer if periods would be shorter than 10 s
_SHORTEST_PERIOD_S = 10.0
_WARM_SHARE, _WARM_MOST_S = 0.2, 60.0  # warm-up in which memory may grow: share of the soak, and longest time
_NICE = 10  # niceness of the judging thread, so that the loop has the processors first


class Period(NamedTuple):
    """A stretch of a soak, with the latency from a block to its command."""

    until_s: float
    blocks: int
    p50_us: float
    p99_us: float
    p999_us: float
    max_us: float
    late: int  # commands that took more than 1 ms


class Memory(NamedTuple):
    """Memory of one process."""

    role: str
    begin_MB: float  # resident memory after the warm-up
    end_MB: float
    slope_MB_per_h: float  # of a straight line through the samples after the warm-up
    slope_sigma_MB_per_h: float  # standard error


class Soaked(NamedTuple):
    """Result of a soak."""

    scenario: str
    wanted_s: float
    interrupted: bool
    verdict: RunVerdict
    memory: list[Memory]
    periods: list[Period]
    JSON_MERGED = "verdict"

    @in_json
    def good(self) -> bool:
        """Whether the soak ran to its end and its log is complete."""
        v = self.verdict
        return (
            not self.interrupted
            and v.blocks > 0
            and v.lost_messages == 0
            and v.all_losses_known
            and not v.checksums.changed
        )

    def in_words(self) -> list[str]:
        """Lines for the operator."""
        short = " (interrupted)" if self.interrupted else ""
        lines = [f"soak     {self.scenario}: {self.verdict.seconds:.0f} of {self.wanted_s:.0f} s{short}"]
        lines += in_words(self.verdict, verbose=False)
        lines += [
            f"memory   {row.role}: {row.begin_MB:.1f} to {row.end_MB:.1f} MB, {row.slope_MB_per_h:+.2f} "
            f"+- {row.slope_sigma_MB_per_h:.2f} MB/h"
            for row in self.memory
        ]
        if self.periods:
            p50, p99 = [row.p50_us for row in self.periods], [row.p99_us for row in self.periods]
            late = sum(row.late for row in self.periods)
            lines.append(
                f"latency  p50 {min(p50):.0f} to {max(p50):.0f} us, p99 {min(p99):.0f} to {max(p99):.0f} us, "
                f"longest {max(row.max_us for row in self.periods):.0f} us; {counted(late, 'command')} over 1 ms"
            )
        return lines

    def page(self) -> str:
        """The report in Markdown: the lines for the operator, and a table of the periods."""
        made = f"stickslip soak --scenario {self.scenario} --hours {self.wanted_s / 3600.0:g} --report FILE"
        lines = [f"# Soak of {self.scenario}", "", f"Made by `{made}`.", ""]
        lines += [*(f"    {line}" for line in self.in_words()), ""]
        lines += ["| until, s | blocks | p50, us | p99, us | p99.9, us | longest, us | over 1 ms |", f"|{'---|' * 7}"]
        lines += [
            f"| {row.until_s:.0f} | {row.blocks} | {row.p50_us:.0f} | {row.p99_us:.0f} | {row.p999_us:.0f} "
            f"| {row.max_us:.0f} | {row.late} |"
            for row in self.periods
        ]
        return "\n".join([*lines, ""])


def soak(
    scenario: str,
    arguments: list[str],
    bus: BusConfig,
    seconds: float,
    log: Path | None,
    progress: Callable[[float], None],
) -> Soaked:
    """Run plant, controller and recorder, watch their memory and judge their log.

    `arguments` is the command line of a child that gives the scenario, without its duration; `progress` is called with the share
    done. Without `log` the log is in a temporary folder, where all files after the first are deleted once judged.

    Raises Fault ENDPOINT_BUSY, INTERRUPTED before anything was recorded, or the fault that ended a process.
    """
    with tempfile.TemporaryDirectory(prefix="stickslip-soak-", ignore_cleanup_errors=True) as folder:
        watch = _Watch(bus, seconds, log or Path(folder) / "soak.mcap", log is None, progress)
        interrupted = False
        try:
            run_processes([*arguments, "--set", f"duration_s={seconds}"], bus.endpoint, watch.path, False, watch)
        except KeyboardInterrupt:
            interrupted = True
        return watch.result(scenario, interrupted)


class _Watch:
    """In a separate thread, samples the processes' memory until the end of the run, and judges the closed files of its log."""

    def __init__(
        self, config: BusConfig, seconds: float, path: Path, thin_out: bool, progress: Callable[[float], None]
    ) -> None:
        self.path = path
        self._config, self._seconds, self._thin_out, self._progress = config, seconds, thin_out, progress
        self._period_s = max(seconds / _MOST_PERIODS, _SHORTEST_PERIOD_S)
        self._memory: dict[str, list[tuple[float, float]]] = {role: [] for role in ROLES}
        self._periods: dict[int, LatencyWatch] = {}
        self._judge = RunJudge(path, {})
        self._readers: dict[Path, LogReader] = {}  # by judged file
        self._checksums: list[Checksums] = []
        self._judging = threading.Lock()

    def __call__(self, over: threading.Event) -> None:
        os.nice(_NICE)  # Linux applies it to this thread only
        with contextlib.suppress(Fault), Bus(self._config, "cockpit", lockstep=False, stop=over) as bus:
            pids = {role: pid_here(role, header.process) for role, header in bus.headers(ROLES, 5.0, over).items()}
            began_s = time.monotonic()
            while not over.wait(_LOOK_S):
                t_s = time.monotonic() - began_s
                for role, pid in pids.items():
                    self._memory[role] += _resident(t_s, pid)
                self._progress(min(t_s / self._seconds, 1.0))
                self._judge_files(still_open=1)

    def _judge_files(self, still_open: int) -> None:
        """Judge the files of the log, except the last `still_open` files."""
        with self._judging:
            files = parts_of(self.path) if self.path.is_file() else []
            for file in files[: len(files) - still_open]:
                if file in self._readers:
                    continue
                reader = self._readers[file] = LogReader(file, alone=True)
                self._judge.begin(reader.metadata)
                self._checksums.append(feed(reader, self))
                if self._thin_out and file != self.path:
                    file.unlink(missing_ok=True)

    def add(self, topic: str, records: Records, log_time_ns: npt.NDArray[np.int64]) -> None:
        """Take messages of a streaming topic, [messages]."""
        self._judge.add(topic, records, log_time_ns)
        if topic == "applied":
            period = (records["t_ns"] - 1) // round(self._period_s * 1e9)
            for number in np.unique(period).tolist():
                self._periods.setdefault(number, LatencyWatch()).add(records[period == number])

    def add_others(self, topic: str, messages: Sequence[Any]) -> None:
        """Take messages of another topic."""
        self._judge.add_others(topic, messages)

    def result(self, scenario: str, interrupted: bool) -> Soaked:
        """The result, after the log is closed. Raises Fault INTERRUPTED if no log was written."""
        self._judge_files(still_open=0)
        if not self._readers:
            raise Fault("INTERRUPTED", "stopped before anything was recorded")
        checksums = self._checksums[-1]._replace(
            damaged=[name for file in self._checksums for name in file.damaged],
            complete=all(file.complete for file in self._checksums),
        )
        damage = of_all_files([reader.damage for reader in self._readers.values()])
        verdict = self._judge.result(damage, checksums, {})
        memory = [_memory(role, points) for role, points in self._memory.items() if points]
        periods = [
            Period(
                min((number + 1) * self._period_s, verdict.seconds),
                watch.blocks,
                *took[:3],
                watch.took_us.most,
                watch.late,
            )
            for number, watch in sorted(self._periods.items())
            if (took := watch.result()) is not None
        ]
        return Soaked(scenario, self._seconds, interrupted, verdict, memory, periods)


def _resident(t_s: float, pid: int) -> list[tuple[float, float]]:
    """Time and resident memory [MB] of a process; empty if the process has ended, also if it is still a zombie."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return []
    return [(t_s, pages * os.sysconf("SC_PAGE_SIZE") * 1e-6)] if pages else []


def _memory(role: str, points: list[tuple[float, float]]) -> Memory:
    """Resident memory after the warm-up, from `points` of time [s] and memory [MB]; NaN slope with fewer than three."""
    t_s, resident_MB = np.array(points).T
    warm = t_s >= min(_WARM_SHARE * float(t_s[-1]), _WARM_MOST_S)
    t_h, resident_MB = t_s[warm] / 3600.0, resident_MB[warm]
    slope = sigma = math.nan
    if len(t_h) > 2 and np.ptp(t_h) > 0.0:
        line, spread = np.polyfit(t_h, resident_MB, 1, cov=True)
        slope, sigma = float(line[0]), math.sqrt(float(spread[0, 0]))
    return Memory(role, float(resident_MB[0]), float(resident_MB[-1]), slope, sigma)
