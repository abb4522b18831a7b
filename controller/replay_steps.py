"""Steps of today's controller on the frames of a log; each result is compared at once and then dropped."""

from collections.abc import Iterable
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from bridge.kernel import Record, kernel, unlocked_kernel
from bridge.layouts import ControllerMemory, TraceRow
from bridge.wire.messages import BLOCK, COMMAND, TRACE, Layout
from controller.announced import take_announcement
from controller.core import step

_OF_A_CLOCK = "lateness_ns"  # field of the trace that comes from a clock and is not compared

# why a replay stops: messages may follow, a step is lost, its block is lost, a dropped message is needed, a bit differs
WAITS, GAP, BLOCK_MISSING, AGAIN, DIFFERS = range(5)
LACKS_COMMAND: Final = 1  # bits of `Taken.lacks`: messages that the log lacks for replayed steps
LACKS_ANNOUNCEMENT: Final = 2


class ReplayDifference(NamedTuple):
    """The first place where a replay differs from the log."""

    table: str  # command or trace
    step: int
    block: int
    t_s: float
    field: str
    logged: float
    replayed: float


class Taken(NamedTuple):
    """How far a call replayed."""

    steps: int  # number of replayed steps
    why: int  # reason why the replay stopped, WAITS to DIFFERS
    compared: int  # number of compared steps
    blocks: int  # number of sensor blocks up to the last used one, which can be dropped
    lacks: int  # bits of missing messages


@kernel
def _place(records: Records, likely: int, sequence: int) -> int:
    """Index of the first message with this sequence; -1 if it is missing. `likely` is tried first."""
    if likely < records.shape[0] and records[likely].sequence == sequence:
        return likely
    low, high = 0, records.shape[0]
    while low < high:
        middle = (low + high) // 2
        if records[middle].sequence < sequence:
            low = middle + 1
        else:
            high = middle
    return low if low < records.shape[0] and records[low].sequence == sequence else -1


@unlocked_kernel
def _steps(
    params: Records,
    params_from_ns: npt.NDArray[np.int64],
    state: Records,
    logged_trace: Records,
    sensors: Records,
    logged_command: Records,
    announce: Records,
    sure: int,
    first_block: np.uint64,
    first_command: np.uint64,
    compares: bool,
    compared_from_ns: float,
    logged_trace_bytes: npt.NDArray[np.uint8],
    logged_command_bytes: npt.NDArray[np.uint8],
    trace_mask: npt.NDArray[np.uint8],
    command_mask: npt.NDArray[np.uint8],
    trace: Records,
    command: Records,
    trace_bytes: npt.NDArray[np.uint8],
    command_bytes: npt.NDArray[np.uint8],
) -> tuple[int, int, int, int, int]:
    """Replay steps up to the first that differs (its result is then in `command`, `trace`) or is incomplete; see `Taken`."""
    s: ControllerMemory = state[0]
    compared, lacks, block_at, command_at = 0, 0, -1, -1
    for i in range(logged_trace.shape[0]):
        t: TraceRow = logged_trace[i]
        # same types as in the process: other types would make Numba compile the step again
        events: Any = np.int64(t.events)
        gap_blocks: Any = np.int64(t.gap_blocks)
        if t.sequence != s.steps:
            return i, GAP if i < sure else WAITS, compared, block_at + 1, lacks
        place = _place(sensors, block_at + 1, t.block) if events & BLOCK != 0 else max(block_at, 0)
        if place < 0:
            why = AGAIN if t.block < first_block else BLOCK_MISSING if i < sure else WAITS
            return i, why, compared, block_at + 1, lacks
        command_at = _place(logged_command, command_at + 1, t.sequence)
        announced = min(np.int64(t.announcements), announce.shape[0])
        lacking = (LACKS_COMMAND if command_at < 0 else 0) | (LACKS_ANNOUNCEMENT if announced < t.announcements else 0)
        if command_at < 0 and t.sequence < first_command:
            return i, AGAIN, compared, block_at + 1, lacks
        if lacking != 0 and i >= sure:
            return i, WAITS, compared, block_at + 1, lacks
        lacks |= lacking
        block_at = place if events & BLOCK != 0 else block_at
        while s.announced_count < announced:
            announced_now: Record = announce[s.announced_count]
            take_announcement(s, announced_now.holds_from_ns, announced_now.drive_velocity_mps)
        change = params.shape[0] - 1
        while change > 0 and t.t_ns < params_from_ns[change]:
            change -= 1
        # a step whose events lack BLOCK does not read `block`
        settings, block = params[change : change + 1], sensors[place : place + 1]
        step(settings, state, block, events, gap_blocks, t.t_ns, command, trace)
        if t.t_ns < compared_from_ns:
            continue
        compared += 1
        different = 0
        if compares:
            for j in range(trace_mask.shape[0]):
                different |= (logged_trace_bytes[i, j] ^ trace_bytes[0, j]) & trace_mask[j]
            if command_at >= 0:
                for j in range(command_mask.shape[0]):
                    different |= (logged_command_bytes[command_at, j] ^ command_bytes[0, j]) & command_mask[j]
        if different != 0:
            return i + 1, DIFFERS, compared, block_at + 1, lacks
    return logged_trace.shape[0], WAITS, compared, block_at + 1, lacks


class StepComparer:
    """Today's controller, fed with the frames of a log; steps after the first difference are not compared.

    Args:
        params: parameters of the controller, [changes].
        params_from_ns: times from which they hold, [changes].
        memory: memory of the controller, one record, changed in place.
        compared_from_s: steps before this time are replayed and not compared.

    """

    def __init__(
        self,
        params: Records,
        params_from_ns: npt.NDArray[np.int64],
        memory: Records,
        compared_from_s: float,
    ) -> None:
        self.difference: ReplayDifference | None = None
        self._controller = params, params_from_ns, memory
        self._from_ns = compared_from_s * 1e9
        self._answer = TRACE.blank(), COMMAND.blank()
        self._masks = _mask(TRACE), _mask(COMMAND)

    def take(self, tables: Iterable[Records], sure: int, first_block: int, first_command: int) -> Taken:
        """Replay steps, from the first of the tables on.

        Args:
            tables: trace, sensors, command and announcements of the log, each in order of sequence.
            sure: number of steps whose messages have all been read.
            first_block, first_command: sequences from which on no message was dropped.

        """
        trace, sensors, command, announce = map(writable, tables)
        taken = Taken(
            *_steps(
                *self._controller, trace, sensors, command, announce, sure, np.uint64(first_block), np.uint64(first_command),
                self.difference is None, self._from_ns, *map(_rows_of_bytes, (trace, command)), *self._masks,
                *self._answer, *map(_rows_of_bytes, self._answer),
            )
        )  # fmt: skip
        if taken.why == DIFFERS:
            trace = trace[taken.steps - 1 :][:1]
            command = command[command["sequence"] == trace["sequence"]][:1]
            self.difference = self._found("trace", TRACE, trace, self._answer[0]) or self._found(
                "command", COMMAND, command, self._answer[1]
            )
        return taken

    def _found(self, table: str, layout: Layout, logged: Records, again: Records) -> ReplayDifference | None:
        """The first field of a message with a bit that differs."""
        step = self._answer[0][0]
        for name in (field.name for field in layout.message.DESCRIPTOR.fields if field.name != _OF_A_CLOCK):
            if logged[name].tobytes() != again[name].tobytes():
                numbers = int(step["sequence"]), int(step["block"]), float(step["t_ns"]) * 1e-9
                return ReplayDifference(table, *numbers, name, float(logged[name][0]), float(again[name][0]))
        return None


def _mask(layout: Layout) -> npt.NDArray[np.uint8]:
    """Mask of the compared bytes of a message, [size]: the bytes of its fields, except for the field of a clock."""
    mask = np.zeros(layout.size, np.uint8)
    for name, (kind, first, *_) in (layout.dtype.fields or {}).items():
        mask[first : first + kind.itemsize] = 0 if name == _OF_A_CLOCK else 0xFF
    return mask


def _rows_of_bytes(records: Records) -> npt.NDArray[np.uint8]:
    return records.view(np.uint8).reshape(-1, records.dtype.itemsize)


def writable(records: Records) -> Records:
    """The messages in writable memory: Numba would compile kernels again for read-only arrays."""
    return records if records.flags.writeable else np.frombuffer(bytearray(records.tobytes()), records.dtype)
