"""The machine's pauses in a run, and which commands were late because of them."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.logfile import RunData
from bridge.log.pause_events import CORE_PAUSE, RunPause, not_watched, pauses_of
from bridge.units import counted
from bridge.wire import core_timer

Counts = npt.NDArray[np.int64]


class Pauses(NamedTuple):
    """How often every core of the machine stood still at the same time, as the recorder watched it, and what was late then."""

    number: int
    total_ms: float
    longest_ms: float
    late_inside: (
        int  # commands later than 1 ms, or that never came, while a pause was between their block and the plant
    )
    late_outside: int  # all other late ones
    late_one_core: int  # of these such while one core stood still alone, which nothing of the loop's priority does
    within_1_ms_outside: float  # share of the commands that no pause held up


class _Commands(NamedTuple):
    """The command that answers each block; all arrays are [blocks]."""

    due_ns: Counts  # when the block was due
    came_ns: Counts  # when the plant had the command, at the latest
    late: Counts  # 1: later than 1 ms, or it never came; more where stale ones came beside


def pauses_in(run: RunData, block_ns: float) -> tuple[Pauses | None, str]:
    """The machine's pauses in a run in real time; None, and why, where they were not watched.

    Args:
        run: the log.
        block_ns: length of a block.

    """
    why_not = not_watched(run.events)
    if why_not or not len(run.applied):
        return None, why_not
    end_ns = int(run.applied["t_ns"].max())
    pauses = [pause for pause in pauses_of(run.events) if pause.from_ns < end_ns]
    commands = _commands(run.applied, block_ns)
    inside = _held_up(commands, pauses)
    one_core = _held_up(commands, pauses_of(run.events, CORE_PAUSE)) & ~inside
    lengths_ms = [(pause.until_ns - pause.from_ns) * 1e-6 for pause in pauses]
    late_outside = int(commands.late[~inside].sum())
    outside = int(np.count_nonzero(~inside))
    return Pauses(
        number=len(pauses),
        total_ms=sum(lengths_ms),
        longest_ms=max(lengths_ms, default=0.0),
        late_inside=int(commands.late[inside].sum()),
        late_outside=late_outside,
        late_one_core=int(commands.late[one_core].sum()),
        within_1_ms_outside=1.0 - min(late_outside / max(outside, 1), 1.0),
    ), ""


def _commands(applied: Any, block_ns: float) -> _Commands:
    """What the plant's own account says of each command: a row tells how many it took before its block, and which was newest."""
    number = applied["sequence"].astype(np.int64)
    newest = applied["command_block"].astype(np.uint64).astype(np.int64)  # the number that means none becomes -1
    taken_ns = applied["t_ns"] + applied["late_ns"]
    first, last = int(newest[0]) + 1, int(number[-1])  # the last block's command comes after the end
    blocks = np.arange(first, max(last, first))
    row = np.searchsorted(newest, blocks)  # that took the command; of one that never came the end
    came_ns = np.append(taken_ns, taken_ns[-1])[row]
    late = (row == len(newest)).astype(np.int64)
    before = np.concatenate([newest[:1], newest[:-1]])
    follows = np.diff(number, prepend=number[:1] - 1) == 1  # else the log lacks the row that may have counted them
    missing = np.where(follows, np.maximum(newest - before - applied["commands"].astype(np.int64), 0), 0)
    many = applied["commands_late"].astype(np.int64) + missing
    for at in np.flatnonzero(many):
        # of the commands of a row the oldest are late; a stale one answers the newest block again
        answered = np.arange(before[at] + 1, newest[at] + 1) if newest[at] > before[at] else newest[at : at + 1]
        places = np.clip(answered[: many[at]] - first, 0, len(late) - 1)
        if len(late) and len(places):
            late[places] = 1
            late[places[0]] += many[at] - len(places)
    return _Commands(np.round((blocks + 1) * block_ns).astype(np.int64), came_ns, late)


def _held_up(commands: _Commands, pauses: list[RunPause]) -> npt.NDArray[np.bool_]:
    """Commands that pauses held up for at least half of their delay, [blocks].

    Half, as the work that a pause leaves behind takes its time as well. A pause is told up to a period of its timer too short.
    """
    if not pauses:
        return np.zeros(len(commands.due_ns), bool)
    from_ns, until_ns = np.array(pauses, np.float64).T
    until_ns = np.maximum.accumulate(until_ns)  # those of two cores may overlap
    from_ns = np.maximum(from_ns, np.concatenate([from_ns[:1], until_ns[:-1]]))
    edges_ns = np.column_stack([from_ns, np.maximum(from_ns, until_ns)]).ravel()
    paused_ns = np.cumsum(np.diff(edges_ns, prepend=edges_ns[:1]) * (np.arange(len(edges_ns)) % 2))
    within_ns = np.interp(commands.came_ns, edges_ns, paused_ns) - np.interp(commands.due_ns, edges_ns, paused_ns)
    return (within_ns > 0) & (commands.came_ns - commands.due_ns - core_timer.PERIOD_NS <= 2.0 * within_ns)


def pauses_in_words(pauses: Pauses | None, why_not: str) -> list[str]:
    """The pauses as a line for a person; none of a run that nobody had to watch."""
    if pauses is None:
        return [f"pauses   of the machine not watched: {why_not}"] if why_not else []
    late = counted(pauses.late_outside, "late command")
    alone = f" ({pauses.late_one_core} while one core stood still alone)" if pauses.late_one_core else ""
    if not pauses.number:
        return [f"pauses   none of the machine; {late}{alone}"]
    return [
        f"pauses   the machine stood still {counted(pauses.number, 'time')}, {pauses.total_ms:.1f} ms in all, the longest "
        f"{pauses.longest_ms:.1f} ms; {counted(pauses.late_inside, 'late command')} in its pauses, {late} outside of "
        f"them{alone}: {100 * pauses.within_1_ms_outside:.3f} % within 1 ms there"
    ]
