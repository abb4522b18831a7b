"""Stalls of the computer: times at which the timers on all cores were late together."""

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from typing import NamedTuple

from bridge.wire import core_timer, realtime

_PRIORITY = realtime.LOOP_PRIORITY + 1  # above the loops: a long step of a loop must not look like a stall
# Most watched cores. Each takes a process of 10 MB, and a stall of eight cores already counts as a stall of the computer.
_MOST_CORES = 8
# Age from which a stall is complete. Shorter: the report of a timer that wakes later would be missed.
_SETTLED_NS = 50_000_000
NO_PRIORITY = "no real-time priority"


class Pause(NamedTuple):
    """A stall [ns of time.perf_counter_ns]."""

    from_ns: int
    until_ns: int
    core: int | None = None  # the stalled core; None: all cores, a stall of the computer


def shared(stalls: Sequence[Sequence[Pause]]) -> list[Pause]:
    """Times at which all cores stalled together, in order of time.

    Args:
        stalls: the stalls of every core, in order of time and without overlap.

    """
    edges = sorted(edge for core in stalls for pause in core for edge in ((pause.from_ns, 1), (pause.until_ns, -1)))
    stalled = accumulate(step for _, step in edges)
    return [
        Pause(from_ns, until_ns)
        for cores, ((from_ns, _), (until_ns, _)) in zip(stalled, pairwise(edges), strict=False)
        if cores == len(stalls)
    ]


class PauseWatch:
    """Timers on the cores that this process may use. They end with `close` or with this process.

    `refused` gives the reason if no timer runs, or no longer; it is empty while the timers run.
    """

    def __init__(self) -> None:
        self.cores = sorted(os.sched_getaffinity(0))[:_MOST_CORES]
        self.refused = _refusal()
        self._timers: list[subprocess.Popen[bytes]] = []
        self._lines = b""
        self._stalls: dict[int, list[Pause]] = {core: [] for core in self.cores}
        if not self.refused:
            self._start()

    def _start(self) -> None:
        self._pipe, write_end = os.pipe()
        os.set_blocking(self._pipe, False)
        for place, core in enumerate(self.cores):
            phase_ns = core_timer.PERIOD_NS * place // len(self.cores)  # staggered, so that a stall is detected sooner
            arguments = (core, _PRIORITY, os.getpid(), phase_ns)
            self._timers.append(
                subprocess.Popen(
                    # -I -S: ignore the folders of the user and installed packages
                    [sys.executable, "-I", "-S", core_timer.__file__, *map(str, arguments)],
                    stdin=subprocess.DEVNULL,
                    stdout=write_end,
                    stderr=subprocess.DEVNULL,
                    start_new_session=True,  # keeps Ctrl-C from the timers: the recorder ends them
                )
            )
        os.close(write_end)

    def poll(self, all_of_them: bool = False) -> list[Pause]:
        """Stalls of the computer and of single cores since the last call; with `all_of_them` also of the last 50 ms."""
        if self.refused:
            return []
        with contextlib.suppress(BlockingIOError):
            while part := os.read(self._pipe, 1 << 16):
                self._lines += part
        *complete, self._lines = self._lines.split(b"\n")
        for line in complete:
            core, from_ns, until_ns = map(int, line.split())
            self._stalls[core].append(Pause(from_ns, until_ns))
        if not all_of_them and any(timer.poll() is not None for timer in self._timers):
            self.refused = "a timer ended"
        until_ns = time.perf_counter_ns() - (0 if all_of_them else _SETTLED_NS)
        pauses, self._stalls = settled(self._stalls, until_ns)
        return pauses

    def close(self) -> None:
        """End the timers."""
        for timer in self._timers:
            timer.kill()
        for timer in self._timers:
            timer.wait()
        if self._timers:
            os.close(self._pipe)
        self._timers.clear()


def settled(stalls: Mapping[int, list[Pause]], until_ns: int) -> tuple[list[Pause], dict[int, list[Pause]]]:
    """Stalls of the computer and of single cores that ended before `until_ns`; and the later stalls by core."""
    together = shared(list(stalls.values()))
    complete = [pause for pause in together if pause.until_ns <= until_ns]
    reported_ns = max((pause.until_ns for pause in complete), default=0)
    for core, pauses in stalls.items():
        ended = [pause for pause in pauses if pause.until_ns <= until_ns]
        complete += [piece._replace(core=core) for pause in ended for piece in _without(pause, together)]
    later = {
        core: [Pause(max(pause.from_ns, reported_ns), pause.until_ns) for pause in pauses if pause.until_ns > until_ns]
        for core, pauses in stalls.items()
    }
    return sorted(complete, key=lambda pause: pause.from_ns), later


def _without(pause: Pause, others: Sequence[Pause]) -> list[Pause]:
    """The parts of a stall outside of other stalls, which are in order of time."""
    pieces: list[Pause] = []
    from_ns = pause.from_ns
    for stall in others:
        if stall.from_ns < pause.until_ns and stall.until_ns > from_ns:
            pieces.append(Pause(from_ns, stall.from_ns))
            from_ns = stall.until_ns
    pieces.append(Pause(from_ns, pause.until_ns))
    return [piece for piece in pieces if piece.until_ns - piece.from_ns > core_timer.LEAST_NS]


def _refusal() -> str:
    """The reason why stalls cannot be watched; empty if they can."""
    if not realtime.may_claim(_PRIORITY):
        return NO_PRIORITY
    return "" if core_timer.reports_waiting() else "this system does not report how long a thread waits"
