"""Replay of a log: does today's controller give the same commands and traces for the frames of the log?

Inputs are fed, outputs are compared; no output is copied from the log. The only field that is not compared is the lateness in
the trace, which comes from a clock and has no effect on a command.

A log is replayed piece by piece. A step is replayed once its block, its command and its announcements have been read, and is then
dropped, so that the memory does not grow with the log.
"""

from collections import deque
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.log.logfile import RunData
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import ANNOUNCE, BLOCK, COMMAND, TRACE, sensor_block
from controller.config import ControllerConfig
from controller.records import LAYOUT_ID, STATE, build
from controller.replay_steps import (
    AGAIN,
    BLOCK_MISSING,
    DIFFERS,
    GAP,
    LACKS_ANNOUNCEMENT,
    LACKS_COMMAND,
    ReplayDifference,
    StepComparer,
)

# Largest delay of a message in the log [steps], 10 s of blocks of 1 ms; a later message counts as lost. Larger: a log that lacks
# messages needs more memory. Smaller: a log with a step farther from its block is read a second time, as a whole. Not swept.
WINDOW: Final = 10_000
_DEFAULT_SAMPLES = 20


class Change(NamedTuple):
    """A change of configuration at `t_ns`; the memory is kept."""

    t_ns: int
    config: ControllerConfig


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
    """A message follows in the log after steps that needed it: the log can only be replayed as a whole."""


class _Waiting:
    """Messages of a topic that no step has used so far, in order of their sequence."""

    def __init__(self, empty: Records) -> None:
        self._parts = [empty]
        self.passed = -1  # largest sequence of dropped messages, which no later step uses
        self.lacked: list[npt.NDArray[np.uint64]] = []  # sequences that replayed steps lacked

    def add(self, records: Records) -> None:
        """Add messages, in the order of the log."""
        if len(records):
            self._parts.append(records)

    def records(self) -> Records:
        """All waiting messages by sequence; messages with equal sequences are in the order of the log."""
        if len(self._parts) > 1:
            parts = [part for part in self._parts if len(part)]
            dtype = parts[0].dtype
            raw = f"V{dtype.itemsize}"  # joined and moved as bytes: numpy would drop the tags between the fields
            joined = parts[0] if len(parts) == 1 else np.concatenate([part.view(raw) for part in parts]).view(dtype)
            sequence = joined["sequence"]
            if not (sequence[1:] > sequence[:-1]).all():
                joined = joined.view(raw)[np.argsort(sequence, kind="stable")].view(dtype)
            self._parts = [joined]
        return self._parts[0]

    def forget(self, count: int) -> None:
        """Drop the first `count` messages."""
        if count:
            records = self.records()
            self.passed = max(self.passed, int(records["sequence"][count - 1]))
            self._parts = [records[count:]]

    def forget_until(self, sequence: int) -> None:
        """Drop all messages up to a sequence, including messages that follow later."""
        self.forget(int(np.searchsorted(self.records()["sequence"], np.uint64(sequence), "right")))
        self.passed = max(self.passed, sequence)


class Replayer:
    """Replay of a log piece by piece, in its order. Methods raise OutOfOrder, but not with `whole`.

    Args:
        changes: configurations in order of time; the first holds from the start.
        from_s: only steps from this time on are compared. The replay starts at the last snapshot before, or at the run's start.
        whole: whether all of the log is read into memory first; it may then be in any order.

    """

    def __init__(self, changes: list[Change], from_s: float = 0.0, whole: bool = False) -> None:
        built = [build(change.config) for change in changes]
        params, from_ns = np.concatenate([pair[0] for pair in built]), np.array([change.t_ns for change in changes])
        self._from_s, self._from_ns = from_s, round(from_s * 1e9)
        self._whole = whole
        self._memory = built[0][1]
        self._comparer = StepComparer(params.view(built[0][0].dtype), from_ns, self._memory, from_s)
        self._trace, self._sensors, self._command, self._announce = (
            _Waiting(layout.blank(0)) for layout in (TRACE, sensor_block(_DEFAULT_SAMPLES), COMMAND, ANNOUNCE)
        )
        self._tables = {
            "trace": self._trace, "sensors": self._sensors, "command": self._command, "announce": self._announce,
        }  # fmt: skip
        self._snapshots: deque[wire.Snapshot] = deque()
        self._before: wire.Snapshot | None = None  # last snapshot before `from_s`
        self._newest_step = -1  # step of the newest snapshot
        self._phase: Callable[[int], bool] = self._start
        self._lost_from = 0  # step from which the memory is lost, until a snapshot at or after it
        self._compared = self._skipped = 0
        self._newest = 0  # number of steps in the newest piece, whose blocks and commands may follow

    def add(self, topic: str, records: Records) -> None:
        """Add messages of a streaming topic; messages of other topics are skipped."""
        waiting = self._tables.get(topic)
        if waiting is None or not len(records):
            return
        if not self._whole:
            records = self._in_time(topic, waiting, records)
            self._newest = len(records) if topic == "trace" else self._newest
        waiting.add(records)
        if not self._whole:
            self._advance(end=False)

    def add_snapshot(self, snapshot: wire.Snapshot) -> None:
        """Add a snapshot of the controller's memory; a snapshot of another version is skipped."""
        if snapshot.layout != LAYOUT_ID:
            return
        early = snapshot.t_ns < self._from_ns
        if not self._whole:
            if snapshot.step <= self._newest_step or (early and self._phase != self._start):
                raise OutOfOrder
            self._newest_step = snapshot.step
            if early:
                self._snapshots.clear()
        self._snapshots.append(snapshot)
        if early:
            self._before = snapshot
            if not self._whole:
                self._pass_over(int(np.searchsorted(self._trace.records()["sequence"], np.uint64(snapshot.step + 1))))

    def result(self) -> Replay:
        """The result, at the end of the log. Raises Fault BAD_LOG where two controllers answered, as their steps are mixed."""
        self._advance(end=True)
        return Replay(self._compared, self._skipped, self._comparer.difference)

    def _in_time(self, topic: str, waiting: _Waiting, records: Records) -> Records:
        """The messages that can still be used; repetitions of a message are skipped."""
        sequence = records["sequence"]
        if topic == "announce":  # steps refer to announcements by their number
            steps = np.diff(sequence, prepend=waiting.records()["sequence"][-1:]).astype(np.int64)
            if waiting.lacked or (steps <= 0).any():
                raise OutOfOrder
            return records
        late = sequence <= np.uint64(max(waiting.passed, 0))
        if waiting.passed < 0 or not late.any():
            return records
        if topic == "trace" or any(np.isin(sequence[late], lacked).any() for lacked in waiting.lacked):
            raise OutOfOrder
        return records.view(f"V{records.dtype.itemsize}")[~late].view(records.dtype)

    def _advance(self, end: bool) -> None:
        """Replay every complete step; with `end` all steps, as no message follows."""
        while len(trace := self._trace.records()):
            sequence = trace["sequence"]
            twice = np.flatnonzero(sequence[1:] == sequence[:-1])
            if len(twice):
                if not self._whole:
                    raise OutOfOrder
                self._refuse_two(trace[twice[0]], trace[twice[0] + 1])
            if not self._phase(len(trace) if end else max(len(trace) - max(WINDOW, self._newest), 0)):
                break
        for waiting in (self._sensors, self._command):  # drops old blocks and commands that no step used
            waiting.forget(max(len(waiting.records()) - 2 * WINDOW, 0) if not self._whole else 0)

    @staticmethod
    def _refuse_two(first: Any, second: Any) -> None:
        at_s, again_s = 1e-9 * int(first["t_ns"]), 1e-9 * int(second["t_ns"])
        line = f"/trace: step {first['sequence']} is recorded at {at_s:.3f} s and again at {again_s:.3f} s"
        why = "the controller was started again, or two controllers answered"
        raise Fault("BAD_LOG", f"{line}: {why}; record every controller in a separate log")

    # each phase takes the number of steps whose messages have all been read, and returns whether another phase follows

    def _start(self, sure: int) -> bool:
        """Find the step at which the replay begins."""
        first = int(self._trace.records()["sequence"][0])
        if not sure and (first or self._from_ns > 0):
            return False
        if self._before is not None:
            self._snapshots.appendleft(self._before)
            self._lost_from = self._before.step
            self._phase = self._lost
        elif first == 0:
            self._phase = self._run
        else:
            self._lost_from = first
            self._phase = self._lost
        return True

    def _run(self, sure: int) -> bool:
        """Replay the steps from the memory on, up to a step that cannot be replayed, and drop them."""
        trace, sensors, command, announce = (waiting.records() for waiting in self._tables.values())
        if not len(sensors) and self._sensors.passed < 0 and not sure:
            return False  # the first block, which shows the number of samples, may follow
        known_from = [0, 0] if self._whole else [self._sensors.passed + 1, self._command.passed + 1]
        taken = self._comparer.take((trace, sensors, command, announce), sure, *known_from)
        if taken.why == AGAIN:
            raise OutOfOrder
        self._compared += taken.compared
        steps = trace["sequence"][: taken.steps]
        if taken.lacks & LACKS_COMMAND:
            self._command.lacked.append(np.setdiff1d(steps, command["sequence"]))
        if taken.lacks & LACKS_ANNOUNCEMENT:
            self._announce.lacked.append(steps[-1:].copy())
        if taken.why in {GAP, BLOCK_MISSING}:
            self._lost_from = int(trace["sequence"][taken.steps])
            self._phase = self._lost
        if taken.steps:
            step = int(steps[-1])
            self._sensors.forget(taken.blocks)
            self._command.forget_until(step)
            self._trace.forget(taken.steps)
            while self._snapshots and self._snapshots[0].step <= step:
                self._snapshots.popleft()
        if taken.why == BLOCK_MISSING:
            block = trace["block"][taken.steps : taken.steps + 1].copy()
            self._sensors.lacked.append(block)
            self._sensors.forget_until(int(block[0]))
        return taken.why in {GAP, BLOCK_MISSING, DIFFERS}

    def _lost(self, sure: int) -> bool:
        """Skip steps until a snapshot restores the memory."""
        sequence = self._trace.records()["sequence"]
        while self._snapshots:
            snapshot = self._snapshots[0]
            following = snapshot.step + 1
            if snapshot.step >= self._lost_from:
                if not self._whole and following <= self._trace.passed:
                    raise OutOfOrder
                place = int(np.searchsorted(sequence, np.uint64(following)))
                if place < len(sequence) and int(sequence[place]) == following:
                    self._snapshots.popleft()
                    self._pass_over(place)
                    self._memory[:] = np.frombuffer(snapshot.memory, STATE)
                    self._phase = self._run
                    return True
                if sure <= place and sure < len(sequence):  # the step after the snapshot may still follow
                    break
                if snapshot is self._before and place < len(sequence):
                    self._lost_from = int(sequence[place])
            self._snapshots.popleft()
        self._pass_over(sure)
        return False

    def _pass_over(self, count: int) -> None:
        """Drop the first steps, which cannot be replayed."""
        steps = self._trace.records()[:count]
        if not len(steps):
            return
        self._skipped += int((steps["t_ns"] >= self._from_s * 1e9).sum())
        consumed = steps["block"][steps["events"] & BLOCK != 0]
        if len(consumed):
            self._sensors.forget_until(int(consumed.max()))
        self._command.forget_until(int(steps["sequence"][-1]))
        self._trace.forget(count)


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
