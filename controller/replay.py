"""Replay of a log: does today's controller give the same commands and traces for the frames of the log?

Inputs are fed, outputs are compared; no output is copied from the log. The only field that is not compared is the lateness in
the trace, which comes from a clock and has no effect on a command.

A log in order is replayed piece by piece. A step is replayed once its block, its command and its announcements have been read,
and is then dropped, so that the memory does not grow with the log. A log that lacks messages is replayed as a whole.
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

# Largest delay of a message in the log [steps], 10 s of blocks of 1 ms. Larger: a replay in pieces needs more memory. Smaller: a
# log with a step farther from its block is read a second time, as a whole. Not swept.
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
    """Messages are missing or not in order: the log can only be replayed as a whole."""


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
    """Replay of a log piece by piece, in its order. Methods raise OutOfOrder, but not with `whole`.

    Args:
        changes: configurations in order of time; the first holds from the start.
        from_s: only steps from this time on are compared. The replay starts at the last snapshot before, or at the run's start.
        whole: whether all of the log is added before `result`; it may then be in any order.

    """

    def __init__(self, changes: list[Change], from_s: float = 0.0, whole: bool = False) -> None:
        built = [build(change.config) for change in changes]
        self._params = np.concatenate([params for params, _ in built]).view(built[0][0].dtype)
        self._params_from_ns = np.array([change.t_ns for change in changes])
        self._memory = built[0][1]
        self._from_ns = round(from_s * 1e9)
        self._whole = whole
        # messages that no step has used so far, by sequence
        self._tables: dict[str, Records] = {
            "trace": TRACE.blank(0), "sensors": _BLOCK.blank(0),
            "command": COMMAND.blank(0), "announce": ANNOUNCE.blank(0),
        }  # fmt: skip
        self._dropped = dict.fromkeys(self._tables, -1)  # largest sequence of dropped messages
        self._snapshots: list[wire.Snapshot] = []  # of the memory after the present step
        self._newest = 0  # number of steps in the newest piece, whose blocks and commands may follow
        self._begun = False
        self._lost_from: int | None = None  # step from which the memory is lost, until a snapshot at or after it
        self._compared = self._skipped = 0
        self._difference: ReplayDifference | None = None

    def add(self, topic: str, records: Records) -> None:
        """Add messages of a streaming topic; messages of other topics are skipped."""
        table = self._tables.get(topic)
        if table is None or not len(records):
            return
        if topic == "trace":
            self._newest = len(records)
        raw = f"V{records.dtype.itemsize}"  # joined and moved as bytes: numpy would drop the tags between the fields
        if len(table):
            records = np.concatenate([table.view(raw), records.view(raw)]).view(records.dtype)
        sequence = records["sequence"]
        if self._whole:
            records = records.view(raw)[np.argsort(sequence, kind="stable")].view(records.dtype)
        elif int(sequence[0]) <= self._dropped[topic] or not (sequence[1:] > sequence[:-1]).all():
            raise OutOfOrder
        self._tables[topic] = records
        if not self._whole:
            self._advance(end=False)

    def add_snapshot(self, snapshot: wire.Snapshot) -> None:
        """Add a snapshot of the controller's memory; a snapshot of another version is skipped."""
        if snapshot.layout != LAYOUT_ID:
            return
        if not self._whole:
            early = snapshot.t_ns < self._from_ns
            if (early and self._begun) or (self._snapshots and snapshot.step <= self._snapshots[-1].step):
                raise OutOfOrder
            if early:  # the replay begins after it, or after a later snapshot
                self._snapshots.clear()
                self._pass_over(int(np.searchsorted(self._tables["trace"]["sequence"], np.uint64(snapshot.step + 1))))
            elif self._begun and self._lost_from is None:
                return
        self._snapshots.append(snapshot)

    def result(self) -> Replay:
        """The result, at the end of the log. Raises Fault BAD_LOG where two controllers answered, as their steps are mixed."""
        sequence = self._tables["trace"]["sequence"]
        twice = np.flatnonzero(sequence[1:] == sequence[:-1])
        if len(twice):
            _refuse_two(self._tables["trace"][twice[0]], self._tables["trace"][twice[0] + 1])
        self._snapshots.sort(key=lambda snapshot: snapshot.step)
        self._advance(end=True)
        return Replay(self._compared, self._skipped, self._difference)

    def _advance(self, end: bool) -> None:
        """Replay every complete step; with `end` all steps, as no message follows."""
        while count := len(self._tables["trace"]):
            # number of steps whose messages have all been read
            sure = count if end else max(count - max(WINDOW, self._newest), 0)
            if not (self._begun or self._begin(bool(sure))):
                break
            if self._lost_from is not None and not self._restore(sure, end):
                break
            if not self._take(sure):
                break
        for topic in ("sensors", "command") if not self._whole else ():  # messages that no step used
            if (old := len(table := self._tables[topic]) - 2 * WINDOW) > 0:
                self._drop(topic, int(table["sequence"][old - 1]))

    def _begin(self, sure: bool) -> bool:
        """Find the step at which the replay begins; False while later messages decide it, which is not `sure`."""
        first = int(self._tables["trace"]["sequence"][0])
        if (first or self._from_ns) and not sure:
            return False
        self._begun = True
        early = [snapshot.step for snapshot in self._snapshots if snapshot.t_ns < self._from_ns]
        if first or early:
            self._lost_from = early[-1] if early else first
        return True

    def _restore(self, sure: int, end: bool) -> bool:
        """Skip steps up to a snapshot with a step after it, and continue there; False while messages are missing."""
        sequence = self._tables["trace"]["sequence"]
        while self._snapshots:
            snapshot = self._snapshots[0]
            place = int(np.searchsorted(sequence, np.uint64(snapshot.step + 1)))
            if place >= sure and not end:
                return False
            self._snapshots.pop(0)
            follows = place < len(sequence) and int(sequence[place]) == snapshot.step + 1
            if follows and snapshot.step >= (self._lost_from or 0):
                self._pass_over(place)
                self._memory[:] = np.frombuffer(snapshot.memory, STATE)
                self._lost_from = None
                return True
        self._pass_over(sure)
        return False

    def _take(self, sure: int) -> bool:
        """Replay, compare and drop the steps with all their messages; return whether others may follow at once."""
        trace = writable(self._tables["trace"][: 10 * WINDOW])
        sensors, command, announce = (writable(self._tables[topic]) for topic in ("sensors", "command", "announce"))
        sequence = trace["sequence"]
        of_block, has_block = _places(sensors["sequence"], trace["block"])
        of_command, has_command = _places(command["sequence"], sequence)
        follows = sequence == np.uint64(self._memory[0]["steps"]) + np.arange(len(trace), dtype=np.uint64)
        complete = follows & (has_block | (trace["events"] & BLOCK == 0))
        if not self._whole:
            complete &= has_command & (trace["announcements"] <= len(announce))
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
            self._drop_steps(frames)
        if count == len(trace):
            return True
        if count >= sure:
            return False  # the messages may follow
        if not self._whole:
            raise OutOfOrder
        self._lost_from = int(sequence[count])
        return True

    def _pass_over(self, count: int) -> None:
        """Drop the first steps, which cannot be replayed."""
        steps = self._tables["trace"][:count]
        self._skipped += int((steps["t_ns"] >= self._from_ns).sum())
        self._drop_steps(steps)

    def _drop_steps(self, steps: Records) -> None:
        """Drop steps with their commands, and all blocks up to the last that they used."""
        if not len(steps):
            return
        blocks = steps["block"][steps["events"] & BLOCK != 0]
        if len(blocks):
            self._drop("sensors", int(blocks.max()))
        for topic in ("command", "trace"):
            self._drop(topic, int(steps["sequence"][-1]))

    def _drop(self, topic: str, until: int) -> None:
        """Drop all messages up to a sequence, which no later step uses."""
        table = self._tables[topic]
        self._tables[topic] = table[np.searchsorted(table["sequence"], np.uint64(until), "right") :]
        self._dropped[topic] = max(self._dropped[topic], until)


def _places(known: npt.NDArray[np.uint64], wanted: npt.NDArray[np.uint64]) -> tuple[Any, Any]:
    """The first row of each wanted number in a sorted column, and whether it is present; row 0 if not."""
    places = np.searchsorted(known, wanted)
    present = np.zeros(len(wanted), bool)
    inside = places < len(known)
    present[inside] = known[places[inside]] == wanted[inside]
    return np.where(present, places, 0), present


def _first_difference(pairs: Any, traces: Records) -> ReplayDifference | None:
    """The first bit that differs, in pairs of a name, logged and replayed messages, and the rows that are compared."""
    places: list[tuple[int, int, str, str, float, float]] = []
    for number, (table, logged, replayed, rows) in enumerate(pairs):
        if logged.tobytes() == replayed.tobytes():
            continue
        for name in (field.name for field in (TRACE, COMMAND)[number].message.DESCRIPTOR.fields):
            bits = f"u{logged.dtype[name].itemsize}"
            was, now = (np.ascontiguousarray(part[name]) for part in (logged, replayed))
            row = int(np.argmax(differs := rows & (was.view(bits) != now.view(bits))))
            if differs[row]:
                places.append((row, number, table, name, float(was[row]), float(now[row])))
    if not places:
        return None
    row, _, table, name, logged, replayed = min(places, key=lambda place: place[:2])
    at = traces[row]
    return ReplayDifference(
        table, int(at["sequence"]), int(at["block"]), float(at["t_ns"]) * 1e-9, name, logged, replayed
    )


def _refuse_two(first: Any, second: Any) -> None:
    at_s, again_s = 1e-9 * int(first["t_ns"]), 1e-9 * int(second["t_ns"])
    line = f"/trace: step {first['sequence']} is recorded at {at_s:.3f} s and again at {again_s:.3f} s"
    why = "the controller was started again, or two controllers answered"
    raise Fault("BAD_LOG", f"{line}: {why}; record every controller in a separate log")


def writable(records: Records) -> Records:
    """The messages in writable memory: Numba would compile kernels again for read-only arrays."""
    return records if records.flags.writeable else np.frombuffer(bytearray(records.tobytes()), records.dtype)


def replay(run: RunData, changes: list[Change], from_s: float = 0.0) -> Replay:
    """Replay a log that is in memory, from `from_s` on.

    Args:
        run: the log.
        changes: configurations in order of time; the first holds from the start.
        from_s: only steps from this time on are compared.

    Raises Fault BAD_LOG where two controllers answered, as their steps are mixed.

    """
    replayer = Replayer(changes, from_s, whole=True)
    for topic in ("announce", "sensors", "command", "trace"):
        replayer.add(topic, getattr(run, topic))
    for snapshot in run.snapshots:
        replayer.add_snapshot(snapshot)
    return replayer.result()
