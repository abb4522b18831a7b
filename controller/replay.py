"""Today's controller on the frames that a log holds as consumed: does it give the same commands and traces?

Inputs are fed, outputs are compared; no output is ever copied from the log. The only field that is not compared is the
lateness in the trace, which comes from a clock and decides nothing.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.kernel import Record, kernel
from bridge.log.logfile import RunData
from bridge.wire.messages import COMMAND, TRACE, Layout, Records
from controller.announced import take_announcement
from controller.codes import BLOCK
from controller.config import ControllerConfig
from controller.core import step
from controller.records import LAYOUT_ID, STATE, build

_NO_ROW = -1
_OF_A_CLOCK = "lateness_ns"  # the field that is not compared
_COMPARED_ROWS = 4096  # at once; with more the processor's cache does not hold them


class Change(NamedTuple):
    """A change of configuration at `t_ns`; the memory stays."""

    t_ns: int
    config: ControllerConfig


class Difference(NamedTuple):
    """The first place where a replay differs from the log."""

    table: str  # command or trace
    step: int
    block: int
    t_s: float
    field: str
    logged: float
    replayed: float


class Replay(NamedTuple):
    """The answers of today's controller to the frames of a log, one row for each step that could be replayed."""

    steps: npt.NDArray[np.int64]  # sequence of each replayed step
    command: Records
    trace: Records
    skipped: int  # steps of the log that cannot be rebuilt: their block or their memory is not in the log
    compared: int
    difference: Difference | None

    @property
    def identical(self) -> bool:
        """Whether every compared bit is the same."""
        return self.difference is None


@kernel
def _steps(
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    sensors: npt.NDArray[Any],
    rows: npt.NDArray[np.int64],
    events: npt.NDArray[np.int64],
    gap_blocks: npt.NDArray[np.int64],
    t_ns: npt.NDArray[np.int64],
    announced: npt.NDArray[np.int64],
    announce: npt.NDArray[Any],
    command: npt.NDArray[Any],
    trace: npt.NDArray[Any],
) -> None:
    s: Record = state[0]
    for i in range(rows.shape[0]):
        while s.announced_count < min(announced[i], announce.shape[0]):
            said: Record = announce[s.announced_count]
            take_announcement(s, said.holds_from_ns, said.drive_velocity_mps)
        row = max(rows[i], 0)  # a step without a block does not read its row
        step(
            params, state, sensors[row : row + 1], events[i], gap_blocks[i], t_ns[i],
            command[i : i + 1], trace[i : i + 1],
        )  # fmt: skip


def replay(run: RunData, changes: list[Change], from_s: float = 0.0) -> Replay:
    """Replay a log from `from_s` on, starting at the last snapshot before it (or at the run's start).

    Args:
        run: the log.
        changes: configurations in order of time; the first holds from the start.
        from_s: only steps from this time on are compared and returned.

    Raises Fault BAD_LOG where two controllers answered, as their steps cannot be told apart.

    """
    trace = _in_order(run.trace)
    sequence, events, gaps, t_ns, announced = (
        trace[name].astype(np.int64) for name in ("sequence", "events", "gap_blocks", "t_ns", "announcements")
    )
    announce = _writable(_in_order(run.announce))
    twice = np.flatnonzero(np.diff(sequence) == 0)
    if len(twice):
        at_s, again_s = 1e-9 * t_ns[twice[0]], 1e-9 * t_ns[twice[0] + 1]
        line = f"/trace: step {sequence[twice[0]]} is there at {at_s:.3f} s and again at {again_s:.3f} s"
        why = "the controller was started again, or two answered"
        raise Fault("BAD_LOG", f"{line}: {why}; record every controller in a log of its own")
    rows = _rows(run.sensors, trace["block"], events)
    sensors = _writable(run.sensors)

    _, memory = build(changes[0].config)
    replayed: list[npt.NDArray[np.int64]] = []
    commands, traces = COMMAND.blank(len(trace)), TRACE.blank(len(trace))
    at = _start(run, sequence, round(from_s * 1e9), memory)
    while at < len(trace):
        end = _until(sequence, rows, events, at)
        for start, stop, params in _spans(changes, t_ns, at, end):
            part = slice(start, stop)
            _steps(
                params, memory, sensors, rows[part], events[part], gaps[part], t_ns[part],
                announced[part], announce, commands[part], traces[part],
            )  # fmt: skip
        replayed.append(np.arange(at, end))
        at = _resume(run, sequence, end, memory)
    done = np.concatenate(replayed) if replayed else np.empty(0, np.int64)
    wanted = _place(done[t_ns[done] >= from_s * 1e9])
    considered = int((t_ns >= from_s * 1e9).sum())
    steps, command = sequence[wanted], commands[wanted]
    found = _first_difference(trace[wanted], run.command, steps, command, traces[wanted])
    return Replay(steps, command, traces[wanted], considered - len(steps), len(steps), found)


def _in_order(records: Records) -> Records:
    """Messages in order of their sequence; those that are in order already are not copied."""
    sequence = records["sequence"]
    return records if (sequence[1:] > sequence[:-1]).all() else records[np.argsort(sequence, kind="stable")]


def _place(rows: npt.NDArray[np.int64]) -> Any:
    """Ascending rows as an index; without a gap they are a slice, which copies nothing."""
    whole = len(rows) > 0 and (np.diff(rows) == 1).all()
    return slice(int(rows[0]), int(rows[-1]) + 1) if whole else rows


def _writable(records: Records) -> Records:
    return records if records.flags.writeable else np.frombuffer(bytearray(records.tobytes()), records.dtype)


def _rows(sensors: Records, block: Any, events: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Row of the sensor block that each step consumed; _NO_ROW where the log does not hold it."""
    order = np.argsort(sensors["sequence"], kind="stable")
    known = sensors["sequence"][order]
    if not len(known):
        return np.full(len(block), _NO_ROW)
    place = np.minimum(np.searchsorted(known, block), len(known) - 1)
    found = (known[place] == block) & (events & BLOCK != 0)
    return np.where(found, order[place], _NO_ROW)


def _until(sequence: Any, rows: Any, events: Any, start: int) -> int:
    """End of the stretch from `start` in which every step can be rebuilt."""
    jumps = np.flatnonzero(np.diff(sequence[start:]) != 1)
    missing = np.flatnonzero((rows[start:] == _NO_ROW) & (events[start:] & BLOCK != 0))
    ends = [len(sequence) - start]
    if len(jumps):
        ends.append(int(jumps[0]) + 1)
    if len(missing):
        ends.append(int(missing[0]))
    return start + min(ends)


def _spans(changes: list[Change], t_ns: Any, start: int, end: int) -> list[tuple[int, int, Any]]:
    """The stretch, cut where the configuration changes: start, end and parameters of each part."""
    spans: list[tuple[int, int, Any]] = []
    for change, following in zip(changes, [*changes[1:], None], strict=True):
        first = max(start, int(np.searchsorted(t_ns, change.t_ns)) if change.t_ns > 0 else 0)
        last = end if following is None else min(end, int(np.searchsorted(t_ns, following.t_ns)))
        if first < last:
            spans.append((first, last, build(change.config)[0]))
    return spans


def _start(run: RunData, sequence: Any, from_ns: int, memory: Any) -> int:
    """Index of the first step to replay, after its memory is restored."""
    usable = [s for s in run.snapshots if s.layout == LAYOUT_ID and s.t_ns < from_ns]
    if usable:
        after = _restore(sequence, usable[-1], memory)
        if after is not None:
            return after
        return _resume(run, sequence, int(np.searchsorted(sequence, usable[-1].step + 1)), memory)
    if len(sequence) and sequence[0] == 0:
        return 0
    return _resume(run, sequence, 0, memory)


def _resume(run: RunData, sequence: Any, at: int, memory: Any) -> int:
    """Index after the next snapshot from index `at` on, after its memory is restored; the end without a snapshot."""
    if at >= len(sequence):
        return at
    for snapshot in run.snapshots:
        if snapshot.layout == LAYOUT_ID and snapshot.step >= sequence[at]:
            after = _restore(sequence, snapshot, memory)
            if after is not None:
                return after
    return len(sequence)


def _restore(sequence: Any, snapshot: Any, memory: Any) -> int | None:
    """Index of the step after a snapshot, after its memory is restored; None when that step is not in the log."""
    after = int(np.searchsorted(sequence, snapshot.step + 1))
    if after == len(sequence) or sequence[after] != snapshot.step + 1:
        return None
    memory[:] = np.frombuffer(snapshot.memory, STATE)
    return after


def _first_difference(
    logged_trace: Records, logged: Records, steps: npt.NDArray[np.int64], command: Records, trace: Records
) -> Difference | None:
    """The earliest step with a bit that differs, trace before command.

    Args:
        logged_trace: of the log, one row for each of the `steps`.
        logged: all commands of the log.
        steps, command, trace: numbers and messages of the replayed steps.

    """
    place = np.searchsorted(logged["sequence"], steps)
    place = np.minimum(place, max(len(logged) - 1, 0))
    logged_command = logged[_place(place)]
    there = logged_command["sequence"] == steps  # commands that the recorder lost cannot be compared
    tables = (
        ("trace", TRACE, logged_trace, trace, np.ones(len(steps), bool)),
        ("command", COMMAND, logged_command, command, there),
    )
    found: list[Difference] = []
    for name, layout, was, again, valid in tables:
        row = _first_row(layout, was, again, valid)
        if row is not None:
            index, field = row
            found.append(
                Difference(
                    table=name,
                    step=int(steps[index]),
                    block=int(trace["block"][index]),
                    t_s=float(trace["t_ns"][index]) * 1e-9,
                    field=field,
                    logged=float(was[field][index]),
                    replayed=float(again[field][index]),
                )
            )
    return min(found, key=lambda difference: difference.step) if found else None


def _first_row(layout: Layout, logged: Records, again: Records, valid: Any) -> tuple[int, str] | None:
    """First row with a bit that differs, and the first field of this row with one."""
    fields = [field.name for field in layout.message.DESCRIPTOR.fields if field.name != _OF_A_CLOCK]
    for first in range(0, len(again), _COMPARED_ROWS):
        part = slice(first, first + _COMPARED_ROWS)
        if _same_bytes(logged[part], again[part]):  # the usual case, 10 times as fast as field by field
            continue
        differs = {name: _bits(logged[part], name) != _bits(again[part], name) for name in fields}
        some = np.logical_or.reduce([*differs.values()]) & valid[part]
        if some.any():
            row = int(np.argmax(some))
            return first + row, next(name for name in fields if differs[name][row])
    return None


def _same_bytes(logged: Records, again: Records) -> bool:
    """Whether the messages are equal but for the field of a clock."""
    copy = again.view(np.uint8).copy()
    if _OF_A_CLOCK in (again.dtype.names or ()):
        np.frombuffer(copy, again.dtype)[_OF_A_CLOCK] = logged[_OF_A_CLOCK]
    return np.array_equal(copy, logged.view(np.uint8))


def _bits(records: Records, field: str) -> npt.NDArray[Any]:
    """A field as whole numbers, which are equal where all bits are; NaN too."""
    values = records[field]
    return values.view(f"u{values.dtype.itemsize}")
