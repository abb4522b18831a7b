"""Runs in real time while processes stall, and the messages that were lost: `python -m tests.stalls --burn --stop any`.

It stops only processes that it has started. Several programs run in turns, so that a busy computer concerns all alike:
`python -m tests.stalls --stop any --runs 5 --program here --program ../before/.venv/bin/stickslip`.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from bridge.log.logfile import RunData, read_run
from bridge.wire.event_codes import TRIPS, WEAK_REASONS
from tests.system.run_under_way import children_of, role

ROLES = ("plant", "controller", "recorder")
START_S = 200.0  # of a run on a busy computer: the first one compiles
HERE = "here"  # the program of this folder
HEADER = f"{'program':<22} {'exit':>4} {'stops':>5} {'longest':>8} {'blocks':>6} {'messages':>8} {'missed':>6} {'p50':>6}  trips"


class Stops(NamedTuple):
    """How a process is stopped during a run."""

    targets: tuple[str, ...]  # roles, one of which is drawn each time; none: nothing is stopped
    every_s: float  # between two stops, 0.75 to 1.25 times that
    shortest_s: float
    longest_s: float  # drawn alike on a scale of factors, so that short stops are not rare


class Came(NamedTuple):
    """The result of one run."""

    program: str
    status: int
    stops: list[float]  # for how long a process was stopped each time [s]
    blocks: int  # sensor blocks that the log lacks
    messages: int  # sensor blocks, commands, traces and applied vibrations that it lacks
    missed: int  # blocks that the controller did not receive, by its own trace
    p50_us: float  # block sent to command received
    trips: list[str]
    reason: str  # why control is not ok; empty where it is

    @property
    def row(self) -> str:
        """One line of the table."""
        return (
            f"{self.program[-22:]:<22} {self.status:>4} {len(self.stops):>5} {max(self.stops, default=0.0) * 1e3:>5.0f} ms "
            f"{self.blocks:>6} {self.messages:>8} {self.missed:>6} {self.p50_us:>6.0f}  {' '.join(self.trips)} {self.reason}"
        )


def missing(numbers: Any) -> int:
    """How many numbers from 0 to the largest are not there; a number may be there twice."""
    return int(numbers.max()) + 1 - len(np.unique(numbers)) if len(numbers) else 0


def losses(data: RunData) -> tuple[int, int, int]:
    """Blocks and messages that a log lacks, and blocks that the controller missed."""
    lost = [missing(records["sequence"]) for records in (data.sensors, data.applied, data.command, data.trace)]
    return lost[0], sum(lost), int(data.trace["gap_blocks"].sum())


class Run:
    """A run of `stickslip run` under way."""

    def __init__(self, program: str, log: Path, port: int, arguments: list[str]) -> None:
        self.program, self.log, self.stops = program, log, list[float]()
        log.unlink(missing_ok=True)
        command = [sys.executable, "-m", "cockpit"] if program == HERE else [program]
        where = ["--endpoint", f"tcp/127.0.0.1:{port}", "--log", str(log), "--json"]
        self.process = subprocess.Popen(
            [*command, "run", *arguments, *where], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )

    def children(self) -> dict[str, int]:
        """Its processes by role, once it writes its log; none where it ended before."""
        until_s = time.monotonic() + START_S
        while time.monotonic() < until_s and self.process.poll() is None:
            if self.log.exists() and self.log.stat().st_size > 100_000:
                pids = {role(pid): pid for pid in children_of(self.process.pid)}
                return {name: pids[name] for name in ROLES if name in pids}
            time.sleep(0.05)
        return {}

    def stop_one(self, pid: int, for_s: float) -> None:
        """Stop one of its processes for a while; it goes on even if this program is interrupted."""
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGSTOP)
            try:
                time.sleep(for_s)
            finally:
                os.kill(pid, signal.SIGCONT)
            self.stops.append(for_s)

    def end(self) -> Came:
        """Wait for its end, and read its verdict and log."""
        try:
            out, _ = self.process.communicate(timeout=START_S)
        except subprocess.TimeoutExpired:
            self.process.terminate()
            out, _ = self.process.communicate()
        verdict: dict[str, Any] = {}
        with suppress(ValueError):
            verdict = json.loads(out)
        p50_us = float((verdict.get("latency") or {}).get("p50_us", "nan"))
        if not self.log.exists():
            return Came(self.program, self.process.returncode, self.stops, -1, -1, -1, p50_us, [], "no log")
        data = read_run(self.log)
        trips = sorted({event.code for event in data.events} & {*TRIPS, *WEAK_REASONS})
        return Came(
            self.program, self.process.returncode, self.stops, *losses(data), p50_us, trips, verdict.get("reason", "")
        )


def stop_at_random(runs: list[Run], stops: Stops, chance: random.Random) -> None:
    """Stop processes of the runs, one after the other, until one of the runs has ended."""
    pids = [(run, pid) for run in runs for name, pid in run.children().items() if name in stops.targets]
    while pids:
        until_s = time.monotonic() + stops.every_s * chance.uniform(0.75, 1.25)
        while time.monotonic() < until_s:
            if any(run.process.poll() is not None for run in runs):
                return
            time.sleep(0.01)
        run, pid = chance.choice(pids)
        run.stop_one(pid, stops.shortest_s * (stops.longest_s / stops.shortest_s) ** chance.random())


@contextmanager
def burners(number: int) -> Generator[None]:
    """So many processes that use a core each, at normal priority."""
    made = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(number)]
    try:
        yield
    finally:
        for process in made:
            process.kill()
            process.wait()


def measure(options: argparse.Namespace, folder: Path) -> list[Came]:
    """Run every program in turns, and print a line a run."""
    stops = Stops(tuple(ROLES if options.stop == "any" else options.stop.split(",")), options.every, *options.for_ms)
    stops = stops._replace(shortest_s=stops.shortest_s * 1e-3, longest_s=stops.longest_s * 1e-3)
    arguments = ["--scenario", options.scenario, *options.more]
    if options.seconds:
        arguments += ["--set", f"duration_s={options.seconds}"]
    results: list[Came] = []
    print(HEADER)
    for turn in range(options.runs):
        for program in options.program:
            runs = [
                Run(program, folder / f"{pair}.mcap", options.port + pair, arguments) for pair in range(options.pairs)
            ]
            # the same stops for each program
            stop_at_random(runs, stops, random.Random(f"{options.seed} {turn}"))
            for run in runs:
                results.append(run.end())
                print(results[-1].row, flush=True)
    return results


def main() -> int:
    """Measure, and sum up; the exit status is 1 where anything was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=3, help="of each program")
    parser.add_argument(
        "--program", action="append", help=f"a stickslip; {HERE!r}, the default: the one in this folder"
    )
    parser.add_argument(
        "--pairs", type=int, default=1, help="rigs at the same time, each with its controller and recorder"
    )
    parser.add_argument("--scenario", default="paper-c45-c45")
    parser.add_argument("--seconds", type=float, help="of a run; the scenario's if not given")
    parser.add_argument("--stop", default="none", help="'any', or plant,controller,recorder: who may be stopped")
    parser.add_argument("--every", type=float, default=4.0, help="seconds between two stops, on average")
    parser.add_argument("--for-ms", type=float, nargs=2, default=[5.0, 500.0], help="shortest and longest stop")
    parser.add_argument("--burn", action="store_true", help="keep every core busy")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--port", type=int, default=7610, help="first of as many as there are pairs")
    parser.add_argument("more", nargs="*", help="further arguments of `stickslip run`, behind --")
    options = parser.parse_args()
    options.program = options.program or [HERE]
    with tempfile.TemporaryDirectory() as folder, burners((os.cpu_count() or 1) if options.burn else 0):
        results = measure(options, Path(folder))
    for program in options.program:
        runs = [came for came in results if came.program == program]
        print(
            f"{program}: {len(runs)} runs, {sum(len(came.stops) for came in runs)} stops; exit 0 in "
            f"{sum(came.status == 0 for came in runs)}; lost {sum(came.blocks for came in runs)} blocks and "
            f"{sum(came.messages for came in runs)} messages of the log, {sum(came.missed for came in runs)} blocks of the "
            f"controller; p50 {median(came.p50_us for came in runs):.0f} us"
        )
    return 0 if all(came.messages == came.missed == 0 for came in results) else 1


if __name__ == "__main__":
    sys.exit(main())
