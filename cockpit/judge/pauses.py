"""Stalls of the computer in a run, and which commands were late because of them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.pause_events import RunPause
from bridge.units import counted
from bridge.wire import core_timer
from cockpit.judge.window import Rows, Window

Counts = npt.NDArray[np.int64]
# A process that is later than this stalled. Smaller: the scheduling of every busy desktop, 1 to 3 ms, counts; larger: stalls go
# unseen in which the rig falls back. One of up to 16 ms loses nothing.
_STALL_NS = 5_000_000


class Pauses(NamedTuple):
    """How often every core of the computer stalled at the same time, as the recorder watched it, and what was late then."""

    number: int
    total_ms: float
    longest_ms: float
    late_inside: (
        int  # commands later than 1 ms, or that never came, while a stall was between their block and the plant
    )
    late_outside: int  # all other late ones
    late_one_core: int  # of these such while one core stalled alone, which nothing of the loop's priority does
    within_1_ms_outside: float  # share of the commands that no stall held up


class Computer(NamedTuple):
    """Stalls as anybody saw them: the recorder's watch, the plant that was late, the controller that was."""

    stalls: int
    longest_ms: float
    whose: str  # plant, controller, or every core; empty where nothing was late
    at_s: float  # when the longest began, or was seen


class _Commands(NamedTuple):
    """Commands, or groups of them; all arrays are [commands]."""

    due_ns: Counts  # when the block was due
    came_ns: Counts  # when the plant had the command, at the latest
    late: Counts  # 1: later than 1 ms, or it never came; more where stale ones came beside


class CommandSum:
    """The commands of a run, gathered window by window from what the plant's own account says of each.

    A row of it tells how many commands it took before its block, and which was the newest.
    """

    def __init__(self) -> None:
        self._newest: int | None = None  # block that the newest command so far answers
        self._came_ns = 0  # when it came
        self._number = 0  # of the last row
        self._inside = self._outside = self._one_core = 0  # late ones
        self._commands = 0  # that no stall held up

    def add(self, window: Window, block_ns: float, pauses: Sequence[RunPause], one_core: Sequence[RunPause]) -> None:
        """The rows of a window that are to be judged, with the stalls that are known."""
        from_ns, until_ns = window.own_ns
        applied = window.applied
        applied = applied[(applied["t_ns"] >= from_ns) & (applied["t_ns"] < until_ns)]
        if not len(applied):
            return
        commands = self._taken(applied, block_ns)
        if window.is_last:
            commands = self._with_those_that_never_came(commands, applied, block_ns)
        inside = _held_up(commands, pauses)
        alone = _held_up(commands, one_core) & ~inside
        self._inside += int(commands.late[inside].sum())
        self._outside += int(commands.late[~inside].sum())
        self._one_core += int(commands.late[alone].sum())
        self._commands += int(np.count_nonzero(~inside))

    def _taken(self, applied: Rows, block_ns: float) -> _Commands:
        """The command that answers each block, in the order of the blocks."""
        number = applied["sequence"]
        newest = np.maximum.accumulate(
            applied["command_block"].astype(np.int64)
        )  # the number that means none becomes -1
        taken_ns = applied["t_ns"] + applied["late_ns"]
        if self._newest is None:
            self._newest, self._number = int(newest[0]), int(number[0]) - 1
        before = np.concatenate([[self._newest], newest[:-1]])
        follows = np.diff(number, prepend=self._number) == 1  # else the log lacks the row that may have counted them
        answered = np.maximum(newest - before, 0)
        missing = np.where(follows, np.maximum(answered - applied["commands"], 0), 0)
        many = applied["commands_late"] + missing
        blocks = np.arange(self._newest + 1, max(int(newest[-1]), self._newest) + 1)
        row = np.repeat(np.arange(len(applied)), answered)
        late = np.zeros(len(blocks), np.int64)
        begins = np.cumsum(answered) - answered
        due_ns, came_ns = (blocks + 1) * block_ns, taken_ns[row].astype(np.float64)
        again: list[tuple[float, float, int]] = []
        for at in np.flatnonzero(many):
            # of the commands of a row the oldest are late; a stale one answers the newest block again
            some = min(int(many[at]), int(answered[at]))
            late[begins[at] : begins[at] + some] = 1
            if some:
                late[begins[at]] += many[at] - some
            else:
                took = int(np.searchsorted(newest, newest[at]))
                came = self._came_ns if newest[at] == before[0] else int(taken_ns[took])
                again.append(((float(newest[at]) + 1.0) * block_ns, float(came), int(many[at])))
        self._newest, self._number = int(newest[-1]), int(number[-1])
        self._came_ns = int(taken_ns[np.searchsorted(newest, newest[-1])]) if answered.any() else self._came_ns
        more = np.array(again).reshape(-1, 3)
        return _Commands(
            np.round(np.concatenate([due_ns, more[:, 0]])).astype(np.int64),
            np.concatenate([came_ns, more[:, 1]]).astype(np.int64),
            np.concatenate([late, more[:, 2].astype(np.int64)]),
        )

    def _with_those_that_never_came(self, commands: _Commands, applied: Rows, block_ns: float) -> _Commands:
        """And the blocks that no command answers; that of the last block comes after the end."""
        newest = self._newest or 0 if self._newest is not None else 0
        blocks = np.arange(newest + 1, max(int(applied["sequence"][-1]), newest + 1))
        came_ns = int(applied["t_ns"][-1] + applied["late_ns"][-1])
        return _Commands(
            np.concatenate([commands.due_ns, np.round((blocks + 1) * block_ns).astype(np.int64)]),
            np.concatenate([commands.came_ns, np.full(len(blocks), came_ns)]),
            np.concatenate([commands.late, np.ones(len(blocks), np.int64)]),
        )

    def result(self, pauses: Sequence[RunPause], end_ns: int) -> Pauses:
        """All of it, with the stalls of every core up to the end of the run."""
        lengths_ms = [(pause.until_ns - pause.from_ns) * 1e-6 for pause in pauses if pause.from_ns < end_ns]
        return Pauses(
            number=len(lengths_ms),
            total_ms=sum(lengths_ms),
            longest_ms=max(lengths_ms, default=0.0),
            late_inside=self._inside,
            late_outside=self._outside,
            late_one_core=self._one_core,
            within_1_ms_outside=1.0 - min(self._outside / max(self._commands, 1), 1.0),
        )


def _held_up(commands: _Commands, pauses: Sequence[RunPause]) -> npt.NDArray[np.bool_]:
    """Commands that stalls held up for at least half of their delay, [commands].

    Half, as the work that a stall leaves behind takes its time as well. A stall is reported up to a period of its timer short.
    """
    if not pauses or not len(commands.due_ns):
        return np.zeros(len(commands.due_ns), bool)
    from_ns, until_ns = np.array(pauses, np.float64).T
    until_ns = np.maximum.accumulate(until_ns)  # those of two cores may overlap
    from_ns = np.maximum(from_ns, np.concatenate([from_ns[:1], until_ns[:-1]]))
    edges_ns = np.column_stack([from_ns, np.maximum(from_ns, until_ns)]).ravel()
    paused_ns = np.cumsum(np.diff(edges_ns, prepend=edges_ns[:1]) * (np.arange(len(edges_ns)) % 2))
    within_ns = np.interp(commands.came_ns, edges_ns, paused_ns) - np.interp(commands.due_ns, edges_ns, paused_ns)
    return (within_ns > 0) & (commands.came_ns - commands.due_ns - core_timer.PERIOD_NS <= 2.0 * within_ns)


class StallSum:
    """Stalls from all who saw one: overlapping ones are one."""

    def __init__(self) -> None:
        self._stalls = 0
        self._until_ns = np.iinfo(np.int64).min  # end of the latest
        self._longest: dict[str, tuple[int, int]] = {}  # by who saw it: length and begin

    def add(self, window: Window, pauses: Sequence[RunPause]) -> None:
        """Those of a window that are to be judged."""
        from_ns, until_ns = window.own_ns
        spans: list[npt.NDArray[np.int64]] = []
        for whose, rows, name in (("plant", window.applied, "late_ns"), ("controller", window.trace, "lateness_ns")):
            own = rows[(rows["t_ns"] >= from_ns) & (rows["t_ns"] < until_ns)]
            if not len(own):
                continue
            late_ns = own[name]
            self._note(whose, int(late_ns.max()), int(own["t_ns"][late_ns.argmax()]))
            late = late_ns > _STALL_NS
            spans.append(np.column_stack([own["t_ns"][late], own["t_ns"][late] + late_ns[late]]))
        seen = [pause for pause in pauses if from_ns <= pause.from_ns < until_ns]
        for pause in seen:
            self._note("every core", pause.until_ns - pause.from_ns, pause.from_ns)
        spans.append(np.array(seen, np.int64).reshape(-1, 2))
        every = np.concatenate(spans)
        for begin_ns, end_ns in every[np.argsort(every[:, 0], kind="stable")].tolist():
            self._stalls += begin_ns > self._until_ns
            self._until_ns = max(self._until_ns, end_ns)

    def _note(self, whose: str, length_ns: int, at_ns: int) -> None:
        if length_ns > self._longest.get(whose, (0, 0))[0]:
            self._longest[whose] = length_ns, at_ns

    def result(self) -> Computer:
        """All of it."""
        if not self._longest:
            return Computer(self._stalls, 0.0, "", 0.0)
        whose, (length_ns, at_ns) = max(self._longest.items(), key=lambda item: item[1][0])
        return Computer(self._stalls, length_ns * 1e-6, whose, at_ns * 1e-9)


def computer_in_words(computer: Computer | None, not_watched: str) -> str:
    """One line: how often the computer stalled, for how long at most, and who was held up."""
    if computer is None:
        return "computer simulated time: no stall of the computer can change the run"
    longest = f"{computer.longest_ms:.1f} ms ({computer.whose}, at {computer.at_s:.2f} s)"
    watch = f"; stalls of every core were not watched: {not_watched}" if not_watched else ""
    if computer.stalls:
        return f"computer stalled {counted(computer.stalls, 'time')}, longest {longest}{watch}"
    late = f"; latest {longest}" if computer.whose else ""
    return f"computer no stall above {_STALL_NS * 1e-6:g} ms{late}{watch}"


def pauses_in_words(pauses: Pauses | None) -> list[str]:
    """The stalls that the recorder watched, as a line; none of a run in simulated time, or where they were not watched."""
    if pauses is None:
        return []
    late = counted(pauses.late_outside, "command")
    share = f"{100 * (1.0 - pauses.within_1_ms_outside):.2f} %"
    alone = f", {pauses.late_one_core} of them while one core stalled" if pauses.late_one_core else ""
    stalls = (
        f"every core stalled {counted(pauses.number, 'time')} ({pauses.total_ms:.1f} ms in total, longest "
        f"{pauses.longest_ms:.1f} ms); {counted(pauses.late_inside, 'late command')} in stalls, "
        if pauses.number
        else "none of every core; "
    )
    return [f"stalls   {stalls}{late} later than 1 ms outside of them ({share}){alone}"]
