"""A loop that runs for hours, watched from outside: memory of each process, lost blocks, latency over time."""

import contextlib
import math
import os
import re
import shutil
import tempfile
import threading
import time
from array import array
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bridge.faults import Fault
from bridge.log.storage.parts import parts_of
from bridge.processes import pid_here
from bridge.units import counted
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import is_told
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.payloads import parsed
from bridge.wire.topics import APPLIED, CONTROLLER_EVENT, PLANT_EVENT, RECORDER_EVENT
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from cockpit.run.processes import run_processes

ROLES = ("plant", "controller", "recorder")
_LOOK_S = 0.5
_MOST_PERIODS = 60  # of a soak, unless they were shorter than 10 s
_SHORTEST_PERIOD_S = 10.0
_WARM_SHARE, _WARM_MOST_S = 0.2, 60.0  # of the soak, in which memory may grow
_KEPT_PARTS = 2  # files of a log that nobody asked for
_INBOX = 16_384  # messages of 16 s
_LATE_NS = 1_000_000
_GAP = re.compile(r"/sensors: (\d{1,12}) lost")  # as the recorder says it


class Period(NamedTuple):
    """A stretch of a soak."""

    until_s: float
    blocks: int
    unheard: int  # blocks of which this listener did not hear
    p50_us: float
    p99_us: float
    p999_us: float
    max_us: float
    late: int  # commands that took more than 1 ms


class Memory(NamedTuple):
    """Of one process."""

    role: str
    begin_MB: float  # resident, after its warm-up
    end_MB: float
    slope_MB_per_h: float
    slope_sigma_MB_per_h: float


class Soaked(NamedTuple):
    """What came of it."""

    scenario: str
    wanted_s: float
    seconds: float  # watched
    interrupted: bool
    blocks: int
    lost_blocks: int  # that the recorder says are not in the log
    unheard: int  # blocks of which this listener did not hear: the rig drops what a listener is too slow for
    events: dict[str, int]  # how many of each code that is more than news
    memory: list[Memory]
    periods: list[Period]

    @property
    def good(self) -> bool:
        """Whether it ran to its end without a lost block."""
        return not self.interrupted and self.lost_blocks == 0 and self.blocks > 0

    def in_words(self) -> list[str]:
        """Lines for a person."""
        short = " (interrupted)" if self.interrupted else ""
        lines = [f"soak     {self.scenario}: {self.seconds:.0f} of {self.wanted_s:.0f} s{short}"]
        lost = "none lost" if self.lost_blocks == 0 else f"{self.lost_blocks} LOST"
        lines.append(f"blocks   {self.blocks}, {lost}")
        if self.unheard:
            lines.append(f"unheard  {counted(self.unheard, 'block')}: this listener was too slow for them")
        lines += [
            f"memory   {one.role}: {one.begin_MB:.1f} to {one.end_MB:.1f} MB, {one.slope_MB_per_h:+.2f} "
            f"+- {one.slope_sigma_MB_per_h:.2f} MB/h"
            for one in self.memory
        ]
        if self.periods:
            p50, p99 = [one.p50_us for one in self.periods], [one.p99_us for one in self.periods]
            late = sum(one.late for one in self.periods)
            lines.append(
                f"latency  p50 {min(p50):.0f} to {max(p50):.0f} us, p99 {min(p99):.0f} to {max(p99):.0f} us, "
                f"longest {max(one.max_us for one in self.periods):.0f} us; {counted(late, 'command')} over 1 ms"
            )
        told = ", ".join(f"{count} {code}" for code, count in sorted(self.events.items())) or "none"
        return [*lines, f"events   {told}"]

    def page(self) -> str:
        """The same and each period, in Markdown."""
        made = f"stickslip soak --scenario {self.scenario} --hours {self.wanted_s / 3600.0:g} --report FILE"
        lines = [f"# Soak of {self.scenario}", "", f"Made by `{made}`.", ""]
        lines += [*(f"    {line}" for line in self.in_words()), ""]
        lines += [
            "| until, s | blocks | unheard | p50, us | p99, us | p99.9, us | longest, us | over 1 ms |",
            f"|{'---|' * 8}",
        ]
        lines += [
            f"| {one.until_s:.0f} | {one.blocks} | {one.unheard} | {one.p50_us:.0f} | {one.p99_us:.0f} | {one.p999_us:.0f} "
            f"| {one.max_us:.0f} | {one.late} |"
            for one in self.periods
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
    """Run plant, controller and recorder and watch them.

    Args:
        scenario: its name.
        arguments: the command line that makes it in a child, its duration left out.
        bus: where they meet.
        seconds: how long.
        log: kept there; None: in a folder that is gone at the end, its newest files alone.
        progress: called with the share done.

    Raises Fault ENDPOINT_BUSY, or what ended a process.

    """
    watch = _Watch(bus, seconds, progress)
    folder = None if log is not None else Path(tempfile.mkdtemp(prefix="stickslip-soak-"))
    path = log if log is not None else (folder or Path()) / "soak.mcap"
    watch.thin_out = path if folder is not None else None
    interrupted = False
    try:
        run_processes([*arguments, "--set", f"duration_s={seconds}"], bus.endpoint, path, False, watch)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
    return watch.result(scenario, interrupted)


class _Watch:
    """Listens to a run until it is over; called in a thread of its own."""

    def __init__(self, config: BusConfig, seconds: float, progress: Callable[[float], None]) -> None:
        self.thin_out: Path | None = None
        self._config, self._seconds, self._progress = config, seconds, progress
        self._period_s = max(seconds / _MOST_PERIODS, _SHORTEST_PERIOD_S)
        self._events: Counter[str] = Counter()
        self._memory: dict[str, list[tuple[float, float]]] = {role: [] for role in ROLES}
        self._periods: list[Period] = []
        self._round_trips_ns = array("q")
        self._blocks = self._lost = self._unheard = 0
        self._in_period = (0, 0)  # blocks and those that were not heard of, at the begin of the period
        self._next: int | None = None
        self._t_s = 0.0

    def __call__(self, over: threading.Event) -> None:
        with contextlib.suppress(Fault), Bus(self._config, "cockpit", lockstep=False, stop=over) as bus:
            inbox = Inbox(_INBOX)
            bus.listen(APPLIED, inbox.push)
            for topic in (PLANT_EVENT, CONTROLLER_EVENT, RECORDER_EVENT):
                bus.listen(topic, inbox.keep)
            pids = {role: pid_here(role, said.process) for role, said in bus.headers(ROLES, 5.0, over).items()}
            self._until(over, inbox, pids)

    def _until(self, over: threading.Event, inbox: Inbox, pids: dict[str, int]) -> None:
        due_s = time.monotonic()
        while not over.is_set():
            received = inbox.get(0.1)
            while received is not None:
                with contextlib.suppress(Fault):
                    self._take(received.topic.name, received.payload)
                received = inbox.get_nowait()
            if time.monotonic() >= due_s:
                due_s = time.monotonic() + _LOOK_S
                for role, pid in pids.items():
                    self._memory[role] += _resident(self._t_s, pid)
                self._progress(min(self._t_s / self._seconds, 1.0))
                self._delete_old_parts()

    def _take(self, topic: str, payload: bytes) -> None:
        if topic != APPLIED.name:
            event = parsed(wire.Event, payload, topic)
            self._events[event.code] += is_told(event.code)
            gap = _GAP.match(event.text) if event.code == "GAP" else None
            self._lost += int(gap[1]) if gap is not None else 0
            return
        applied: Any = APPLIED_LAYOUT.read(payload, topic)[0]
        number = int(applied.sequence)
        if self._next is not None and number > self._next:
            self._unheard += number - self._next
        self._next = number + 1
        self._blocks += 1
        self._t_s = int(applied.t_ns) * 1e-9
        if applied.commands > 0 and applied.round_trip_ns > 0:
            self._round_trips_ns.append(int(applied.round_trip_ns))
        if self._t_s >= (len(self._periods) + 1) * self._period_s:
            self._end_period()

    def _end_period(self) -> None:
        took_us = np.asarray(self._round_trips_ns) * 1e-3
        if len(took_us):
            p50, p99, p999, most = (float(one) for one in np.percentile(took_us, [50.0, 99.0, 99.9, 100.0]))
            blocks, unheard = self._in_period
            late = int(np.count_nonzero(took_us > _LATE_NS * 1e-3))
            self._periods.append(
                Period(self._t_s, self._blocks - blocks, self._unheard - unheard, p50, p99, p999, most, late)
            )
        self._round_trips_ns = array("q")
        self._in_period = (self._blocks, self._unheard)

    def _delete_old_parts(self) -> None:
        if self.thin_out is not None and self.thin_out.exists():
            for part in parts_of(self.thin_out)[1:-_KEPT_PARTS]:
                part.unlink(missing_ok=True)

    def result(self, scenario: str, interrupted: bool) -> Soaked:
        """All of it."""
        self._end_period()
        memory = [_memory(role, points) for role, points in self._memory.items() if points]
        return Soaked(
            scenario, self._seconds, self._t_s, interrupted, self._blocks, self._lost, self._unheard,
            dict(+self._events), memory, self._periods,
        )  # fmt: skip


def _resident(t_s: float, pid: int) -> list[tuple[float, float]]:
    """Time and resident memory [MB]; nothing for a process that is gone, or has ended and still has a number."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return []
    return [(t_s, pages * os.sysconf("SC_PAGE_SIZE") * 1e-6)] if pages else []


def _memory(role: str, points: list[tuple[float, float]]) -> Memory:
    """The straight line through what was seen after the warm-up."""
    t_s, resident_MB = np.array(points).T
    warm = t_s >= min(_WARM_SHARE * float(t_s[-1]), _WARM_MOST_S)
    t_h, resident_MB = t_s[warm] / 3600.0, resident_MB[warm]
    slope = sigma = math.nan
    if len(t_h) > 2 and np.ptp(t_h) > 0.0:
        slope, start = (float(one) for one in np.polyfit(t_h, resident_MB, 1))
        rest = resident_MB - start - slope * t_h
        sigma = math.sqrt(float(rest @ rest) / (len(t_h) - 2) / float(((t_h - t_h.mean()) ** 2).sum()))
    return Memory(role, float(resident_MB[0]), float(resident_MB[-1]), slope, sigma)
