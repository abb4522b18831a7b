"""Stalls of the computer in a run, and the commands that they delayed."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.watches.event_watch import EventWatch, RunPause
from bridge.units import counted
from bridge.wire import core_timer
from cockpit.judge.watches import LatencyWatch
from cockpit.judge.window import Window

Times = npt.NDArray[np.floating[Any]] | npt.NDArray[np.int64]
# Lateness above which a process counts as stalled. Smaller: the scheduling jitter of a busy desktop, 1 to 3 ms, counts. Larger:
# stalls are missed in which the rig falls back. A stall of up to 16 ms loses nothing.
_STALL_NS = 5_000_000
_MOST_LATE = 1 << 16  # largest credible number of late commands in a row of the plant; a larger one is damaged


class Pauses(NamedTuple):
    """Simultaneous stalls of all cores, seen by the recorder, and the commands late because of them."""

    number: int
    total_ms: float
    longest_ms: float
    late_inside: int  # commands later than 1 ms, at least half of whose delay is a stall of all cores
    late_outside: int  # all other late commands
    late_one_core: int  # part of `late_outside` that a stall of one core delayed, which no real-time priority prevents
    within_1_ms_outside: float  # share of commands within 1 ms, of all commands not in `late_inside`


class Computer(NamedTuple):
    """Stalls seen by the recorder, and lateness of plant and controller."""

    stalls: int  # stalls of every core, and those above 5 ms of plant or controller; overlapping ones count once
    longest_ms: float  # the longest stall or lateness
    whose: str  # stalled process, plant or controller, or every core; empty if nothing was late
    at_s: float  # begin of the longest stall


class CommandSum:
    """Commands delayed by a stall, window by window, from the plant's row of each block.

    A row has the number of commands before its block, the number of late ones, and the block answered by the newest command.
    """

    def __init__(self, events: EventWatch, block_s: float) -> None:
        self._events, self._block_ns = events, block_s * 1e9
        self._newest: int | None = None  # block answered by the newest command so far
        self._inside = self._one_core = 0

    def add(self, window: Window) -> None:
        """Count the late commands in the judged rows of a window that the stalls known so far delayed."""
        applied = window.applied[window.own(window.applied)]
        if not len(applied):
            return
        newest = np.maximum.accumulate(
            applied["command_block"].astype(np.int64)
        )  # the number for "no command" becomes -1
        before = np.concatenate([[newest[0] - 1 if self._newest is None else self._newest], newest[:-1]])
        self._newest = int(newest[-1])
        late = np.minimum(applied["commands_late"], _MOST_LATE)
        row, first = np.repeat(np.arange(len(applied)), late), np.repeat(np.cumsum(late) - late, late)
        # the oldest commands of a row are late; a stale command answers the newest block again
        block = np.minimum(before[row] + 1 + np.arange(len(row)) - first, newest[row])
        due_ns, came_ns = np.round((block + 1) * self._block_ns), applied["t_ns"][row] + applied["late_ns"][row]
        inside = _held_up(due_ns, came_ns, self._events.pauses)
        self._inside += int(np.count_nonzero(inside))
        self._one_core += int(np.count_nonzero(_held_up(due_ns, came_ns, self._events.core_pauses) & ~inside))

    def result(self, latency: LatencyWatch, end_ns: int) -> Pauses:
        """Stalls of every core up to the end of the run, and the late commands."""
        pauses = sorted(self._events.pauses)
        lengths_ms = [(pause.until_ns - pause.from_ns) * 1e-6 for pause in pauses if pause.from_ns < end_ns]
        outside = latency.late - self._inside
        return Pauses(
            number=len(lengths_ms),
            total_ms=sum(lengths_ms),
            longest_ms=max(lengths_ms, default=0.0),
            late_inside=self._inside,
            late_outside=outside,
            late_one_core=self._one_core,
            within_1_ms_outside=1.0 - min(outside / max(latency.commands - self._inside, 1), 1.0),
        )


def _held_up(due_ns: Times, came_ns: Times, pauses: Sequence[RunPause]) -> npt.NDArray[np.bool_]:
    """Commands for which stalls cause at least half of the delay, [commands].

    Half, because the backlog after a stall takes time as well. A stall is reported up to one timer period too short.
    """
    if not pauses or not len(due_ns):
        return np.zeros(len(due_ns), bool)
    from_ns, until_ns = np.array(sorted(pauses), np.float64).T
    until_ns = np.maximum.accumulate(until_ns)  # stalls of two cores may overlap
    from_ns = np.maximum(from_ns, np.concatenate([from_ns[:1], until_ns[:-1]]))
    edges_ns = np.column_stack([from_ns, np.maximum(from_ns, until_ns)]).ravel()
    paused_ns = np.cumsum(np.diff(edges_ns, prepend=edges_ns[:1]) * (np.arange(len(edges_ns)) % 2))
    within_ns = np.interp(came_ns, edges_ns, paused_ns) - np.interp(due_ns, edges_ns, paused_ns)
    return (within_ns > 0) & (came_ns - due_ns - core_timer.PERIOD_NS <= 2.0 * within_ns)


class StallSum:
    """Stalls of cores, plant and controller; overlapping stalls count once."""

    def __init__(self, events: EventWatch) -> None:
        self._events = events
        self._stalls = 0
        self._until_ns = np.iinfo(np.int64).min  # end of the latest stall
        self._longest = (0, 0, "")  # length [ns], begin [ns], whose

    def add(self, window: Window) -> None:
        """Add the judged stalls of a window."""
        from_ns, until_ns = window.own_ns
        seen = [("every core", *pause) for pause in self._events.pauses if from_ns <= pause.from_ns < until_ns]
        for whose, rows, name in (("plant", window.applied, "late_ns"), ("controller", window.trace, "lateness_ns")):
            judged = rows[window.own(rows)]
            if len(judged):
                late = judged[name] > _STALL_NS
                late[judged[name].argmax()] = True
                seen += [(whose, t_ns, t_ns + late_ns) for t_ns, late_ns in judged[["t_ns", name]][late].tolist()]
        for whose, begin_ns, end_ns in sorted(seen, key=lambda stall: stall[1]):
            if end_ns - begin_ns > self._longest[0]:
                self._longest = end_ns - begin_ns, begin_ns, whose
            if end_ns - begin_ns > _STALL_NS or whose == "every core":
                self._stalls += begin_ns > self._until_ns
                self._until_ns = max(self._until_ns, end_ns)

    def result(self) -> Computer:
        """Number of stalls, and the longest."""
        length_ns, at_ns, whose = self._longest
        return Computer(self._stalls, length_ns * 1e-6, whose, at_ns * 1e-9)


def computer_in_words(computer: Computer | None, not_watched: str) -> str:
    """One line: number of stalls of the computer, the longest, and the stalled process."""
    if computer is None:
        return "computer simulated time: no stall of the computer can change the run"
    longest = f"{computer.longest_ms:.1f} ms ({computer.whose}, at {computer.at_s:.2f} s)"
    watch = f"; stalls of every core were not watched: {not_watched}" if not_watched else ""
    if computer.stalls:
        return f"computer stalled {counted(computer.stalls, 'time')}, longest {longest}{watch}"
    late = f"; latest {longest}" if computer.whose else ""
    return f"computer no stall above {_STALL_NS * 1e-6:g} ms{late}{watch}"


def pauses_in_words(pauses: Pauses | None) -> list[str]:
    """Stalls seen by the recorder, as a line; empty in simulated time, or if they were not watched."""
    if pauses is None:
        return []
    late = counted(pauses.late_outside, "command")
    share = f"{100 * (1.0 - pauses.within_1_ms_outside):.2f} %"
    alone = f", {pauses.late_one_core} of them while one core stalled" if pauses.late_one_core else ""
    stalls = (
        f"every core stalled {counted(pauses.number, 'time')} ({pauses.total_ms:.1f} ms in total, longest "
        f"{pauses.longest_ms:.1f} ms); {counted(pauses.late_inside, 'late command')} in stalls, "
        if pauses.number
        else "no stall of all cores at once; "
    )
    return [f"stalls   {stalls}{late} later than 1 ms outside of them ({share}){alone}"]
