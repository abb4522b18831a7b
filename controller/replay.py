"""Replay of a log: does today's controller give the same commands and traces for the frames of the log?

Inputs are fed, outputs are compared; no output is copied from the log. The only field that is not compared is the lateness in
the trace, which comes from a clock and has no effect on a command.

A log is replayed piece by piece, each step once its messages, or later ones of their topics, have been read; then its messages
are dropped, so that the memory does not grow with the log. A log that is not in order is sorted as a whole first.
"""

from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.kernel import Record, unlocked_kernel
from bridge.layouts import ControllerMemory, TraceRow
from bridge.log.logfile import RunData
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import ANNOUNCE, BLOCK, COMMAND, TRACE, sensor_block
from controller.announced import take_announcement
from controller.config import ControllerConfig
from controller.core import step
from controller.records import LAYOUT_ID, STATE, build

# Most blocks that wait for a step, 10 s of blocks of 1 ms, as a rig may run on without its controller. Larger: more memory.
# Smaller: a log whose steps are farther from their blocks is read a second time, as a whole. Not swept.
WINDOW: Final = 10_000
_BLOCK = sensor_block(20)  # layout of the blocks before the first has come
_OF_A_CLOCK = "lateness_ns"  # field of the trace that comes from a clock and is not compared


class Change(NamedTuple):
    """A change of configuration at `t_ns`; the memory is kept."""

    t_ns: int
    config: ControllerConfig


class ReplayDifference(NamedTuple):
    """The first place where a replay differs from the log."""

    table: str  # command or trace
    step: int
    block: int
    t_s: float
    field: str
    logged: float
    replayed: float


class Replay(NamedTuple):
    """Comparison of today's controller with the commands and traces of a log."""

    compared: int  # number of compared steps
    skipped: int  # number of steps that cannot be replayed: their block or their memory is not in the log
    difference: ReplayDifference | None

    @property
    def identical(self) -> bool:
        """Whether every compared bit is the same."""
        return self.difference is None


class OutOfOrder(Exception):
    """Messages are not in order: `replay` sorts the whole log."""


@unlocked_kernel
def _steps(
    params: Records,
    params_from_ns: npt.NDArray[np.int64],
    state: Records,
    frames: Records,
    sensors: Records,
    places: npt.NDArray[np.int64],
    announce: Records,
    command: Records,
    trace: Records,
) -> None:
    """Replay the steps of `frames`, traces of a log, into `command` and `trace`; `places` are the rows of their blocks."""
    s: ControllerMemory = state[0]
    for i in range(frames.shape[0]):
        t: TraceRow = frames[i]
        # same types as in the process: other types would make Numba compile the step again
        events: Any = np.int64(t.events)
        gap_blocks: Any = np.int64(t.gap_blocks)
        while s.announced_count < min(np.int64(t.announcements), announce.shape[0]):
            announced: Record = announce[s.announced_count]
            take_announcement(s, announced.holds_from_ns, announced.drive_velocity_mps)
        change = params.shape[0] - 1
        while change > 0 and t.t_ns < params_from_ns[change]:
            change -= 1
        settings, block = params[change : change + 1], sensors[places[i] : places[i] + 1]
        step(settings, state, block, events, gap_blocks, t.t_ns, command[i : i + 1], trace[i : i + 1])


class Replayer:
    """Replay of a log piece by piece. Methods raise OutOfOrder if the messages of a topic do not come in order.

    Args:
        changes: configurations in order of time; the first holds from the start.
        from_s: only steps from this time on are compared. The replay starts at the last snapshot before, or at the run's start.

    """

    def __init__(self, changes: list[Change], from_s: float = 0.0) -> None:
        built = [build(change.config) for change in changes]
        self._params = np.concatenate([params for params, _ in built]).view(built[0][0].dtype)
        self._params_from_ns = np.array([change.t_ns for change in changes])
        self._memory = built[0][1]
        self._from_ns = round(from_s * 1e9)
        self._begun = self._from_ns == 0
        # messages that no step has used so far, by sequence; all announcements
        self._tables: dict[str, Records] = {
            "trace": TRACE.blank(0), "sensors": _BLOCK.blank(0),
            "command": COMMAND.blank(0), "announce": ANNOUNCE.blank(0),
        }  # fmt: skip
        self._newest = dict.fromkeys([*self._tables, "snapshot"], -1)  # largest sequence that has come
        self._unused = -1  # newest block that was dropped before a step came
        self._snapshots: list[wire.Snapshot] = []  # of the memory after steps that are not replayed yet
        self._compared = self._skipped = 0
        self._difference: ReplayDifference | None = None

    def add(self, topic: str, records: Records) -> None:
        """Add messages of a streaming topic; messages of other topics are skipped."""
        table = self._tables.get(topic)
        if table is None or not len(records):
            return
        sequence = records["sequence"]
        if topic != "announce":  # a rig that restarts counts its announcements from 0
            self._note_order(topic, int(sequence[0]), int(sequence[-1]))
            if not (sequence[1:] > sequence[:-1]).all():
                raise OutOfOrder
        self._tables[topic] = (
            np.concatenate([_raw(table), _raw(records)]).view(records.dtype) if len(table) else records
        )
        self._advance(end=False)

    def add_snapshot(self, snapshot: wire.Snapshot) -> None:
        """Add a snapshot of the controller's memory; the memory of another version is skipped."""
        self._note_order("snapshot", snapshot.step, snapshot.step)
        late = snapshot.t_ns >= self._from_ns
        if snapshot.layout == LAYOUT_ID:
            if not late:  # the replay begins after it, or after a later snapshot
                self._snapshots, self._memory["steps"] = [], -1
                self._skip(snapshot.step)
            self._snapshots.append(snapshot)
        self._begun = self._begun or late
        self._advance(end=False)

    def _note_order(self, topic: str, first: int, last: int) -> None:
        if first <= self._newest[topic]:
            raise OutOfOrder
        self._newest[topic] = last

    def result(self) -> Replay:
        """The result, at the end of the log."""
        self._begun = True
        self._advance(end=True)
        return Replay(self._compared, self._skipped, self._difference)

    def _advance(self, end: bool) -> None:
        """Replay every step whose messages have come; with `end` all steps, as no message follows."""
        self._snapshots = [snapshot for snapshot in self._snapshots if snapshot.step >= self._memory[0]["steps"]]
        while self._begun and len(trace := self._tables["trace"]):
            follows = int(trace["sequence"][0]) == int(self._memory[0]["steps"])
            if not (follows or self._restore(end)) or not self._take(end):
                break
        if not len(self._tables["trace"]) and len(blocks := self._tables["sensors"]) > WINDOW:
            self._unused = int(blocks["sequence"][-WINDOW - 1])
            self._tables["sensors"] = blocks[-WINDOW:]

    def _restore(self, end: bool) -> bool:
        """Skip steps up to a snapshot with a step after it, and continue there; False while messages are missing."""
        while self._snapshots and (end or self._newest["trace"] > self._snapshots[0].step):
            snapshot, sequence = self._snapshots.pop(0), self._tables["trace"]["sequence"]
            if np.uint64(snapshot.step + 1) in sequence:
                self._skip(snapshot.step)
                self._memory[:] = np.frombuffer(snapshot.memory, STATE)
                return True
        if end:
            self._skip(self._newest["trace"])
        return False

    def _take(self, end: bool) -> bool:
        """Replay, compare and drop the steps with all their messages; return whether others may follow at once."""
        trace = writable(self._tables["trace"][: 10 * WINDOW])
        sensors, command, announce = (writable(self._tables[topic]) for topic in ("sensors", "command", "announce"))
        sequence, blocks = trace["sequence"], trace["block"]
        of_block, has_block = _places(sensors["sequence"], blocks)
        of_command, has_command = _places(command["sequence"], sequence)
        lacks_block = (trace["events"] & BLOCK != 0) & ~has_block
        waits = lacks_block & (blocks.astype(np.int64) > self._newest["sensors"])
        waits |= ~has_command & (sequence.astype(np.int64) > self._newest["command"])
        waits |= trace["announcements"] > len(announce)
        follows = sequence == np.uint64(self._memory[0]["steps"]) + np.arange(len(trace), dtype=np.uint64)
        complete = follows & ~lacks_block & (~waits | end)
        count = len(trace) if complete.all() else int(np.argmin(complete))
        if count:
            frames, answers, traces = trace[:count], COMMAND.blank(count), TRACE.blank(count)
            if not len(sensors):  # no step has a block
                sensors = _BLOCK.blank()
            _steps(
                self._params, self._params_from_ns, self._memory, frames, sensors, of_block[:count], announce, answers, traces,
            )  # fmt: skip
            traces[_OF_A_CLOCK] = frames[_OF_A_CLOCK]
            late = frames["t_ns"] >= self._from_ns
            self._compared += int(late.sum())
            if self._difference is None:
                logged = command[of_command[:count]] if len(command) else COMMAND.blank(count)
                pairs = ("trace", frames, traces, late), ("command", logged, answers, late & has_command[:count])
                self._difference = _first_difference(pairs, traces)
            self._drop(frames)
        if count == len(trace) or not follows[count]:
            return True
        if waits[count] and not end:
            return False
        if int(blocks[count]) <= self._unused:
            raise OutOfOrder
        self._skip(int(sequence[count]))  # its block is lost
        return True

    def _skip(self, until: int) -> None:
        """Drop the steps up to a sequence, which cannot be replayed."""
        trace = self._tables["trace"]
        steps = trace[: np.searchsorted(trace["sequence"], np.uint64(until), "right")]
        self._skipped += int((steps["t_ns"] >= self._from_ns).sum())
        self._drop(steps)

    def _drop(self, steps: Records) -> None:
        """Drop the first steps with their commands, and all blocks up to the last that they used."""
        for topic, used in (
            *((topic, steps["sequence"]) for topic in ("command", "trace")),
            ("sensors", steps["block"][steps["events"] & BLOCK != 0]),
        ):
            table = self._tables[topic]
            if len(used):
                self._tables[topic] = table[np.searchsorted(table["sequence"], used.max(), "right") :]


def _raw(records: Records) -> Any:
    """The messages as bytes: numpy omits the tags between the fields of messages that it copies."""
    return records.view(f"V{records.dtype.itemsize}")


def _places(known: npt.NDArray[np.uint64], wanted: npt.NDArray[np.uint64]) -> tuple[Any, Any]:
    """The first row of each wanted number in a sorted column, and whether it is present; row 0 if not."""
    places = np.searchsorted(known, wanted)
    present = np.zeros(len(wanted), bool)
    inside = places < len(known)
    present[inside] = known[places[inside]] == wanted[inside]
    return np.where(present, places, 0), present


def _first_difference(pairs: Any, traces: Records) -> ReplayDifference | None:
    """The first bit that differs, in pairs of a name, logged and replayed messages, and the rows that are compared."""
    places = [
        (int(np.argmax(differs)), number, name)
        for number, (_, logged, replayed, rows) in enumerate(pairs)
        for name in logged.dtype.names
        if (differs := rows & (_bits(logged[name]) != _bits(replayed[name]))).any()
    ]
    if not places:
        return None
    row, number, name = min(places, key=lambda place: place[:2])
    table, logged, replayed, _ = pairs[number]
    was, now, at = float(logged[name][row]), float(replayed[name][row]), traces[row]
    return ReplayDifference(table, int(at["sequence"]), int(at["block"]), float(at["t_ns"]) * 1e-9, name, was, now)


def _bits(column: Any) -> Any:
    return np.ascontiguousarray(column).view(f"u{column.itemsize}")


def writable(records: Records) -> Records:
    """The messages in writable memory: Numba would compile kernels again for read-only arrays."""
    return records if records.flags.writeable else np.frombuffer(bytearray(records.tobytes()), records.dtype)


def replay(run: RunData, changes: list[Change], from_s: float = 0.0) -> Replay:
    """Replay a log that is in memory, as a `Replayer` with these arguments.

    Raises Fault BAD_LOG where two controllers answered, as their steps are mixed.
    """
    replayer = Replayer(changes, from_s)
    replayer.add("announce", run.announce)
    for topic in ("trace", "command", "sensors"):
        replayer.add(topic, _sorted(topic, getattr(run, topic)))
    for _, snapshot in sorted({snapshot.step: snapshot for snapshot in run.snapshots}.items()):
        replayer.add_snapshot(snapshot)
    return replayer.result()


def _sorted(topic: str, records: Records) -> Records:
    """The messages by sequence, repeated ones once. Raises Fault BAD_LOG for repeated steps."""
    order = np.argsort(records["sequence"], kind="stable")
    again = np.diff(records["sequence"][order].astype(np.int64), prepend=-1) == 0
    if topic == "trace" and again.any():
        first, second = records[order[np.argmax(again) - 1 :][:2]]
        at_s, again_s = 1e-9 * int(first["t_ns"]), 1e-9 * int(second["t_ns"])
        line = f"/trace: step {first['sequence']} is recorded at {at_s:.3f} s and again at {again_s:.3f} s"
        why = "the controller was started again, or two controllers answered"
        raise Fault("BAD_LOG", f"{line}: {why}; record every controller in a separate log")
    return _raw(records)[order[~again]].view(records.dtype)
