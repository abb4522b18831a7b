"""Steps of today's controller beside those of a log: each answer is compared as soon as it is there, and kept nowhere."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.kernel import Record, unlocked_kernel
from bridge.wire.messages import COMMAND, TRACE, Layout, Records
from controller.announced import take_announcement
from controller.core import step

NO_ROW = -1
_OF_A_CLOCK = "lateness_ns"  # the field that is not compared


class Difference(NamedTuple):
    """The first place where a replay differs from the log."""

    table: str  # command or trace
    step: int
    block: int
    t_s: float
    field: str
    logged: float
    replayed: float


class Stretch(NamedTuple):
    """Steps of a log, one after the other without a gap."""

    trace: Records  # [steps], logged
    rows: npt.NDArray[np.int64]  # [steps], of the sensor block that each consumed; NO_ROW for a step without a block
    command_rows: npt.NDArray[np.int64]  # [steps], NO_ROW where the log lacks the command
    events: npt.NDArray[np.int64]  # [steps]
    gap_blocks: npt.NDArray[np.int64]  # [steps]
    t_ns: npt.NDArray[np.int64]  # [steps]
    announced: npt.NDArray[np.int64]  # [steps], announcements that had come by then

    def part(self, start: int, end: int) -> "Stretch":
        """Some of the steps."""
        return Stretch(*(column[start:end] for column in self))


@unlocked_kernel
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
    compared_from_ns: float,
    logged_command: npt.NDArray[np.uint8],
    command_rows: npt.NDArray[np.int64],
    command_mask: npt.NDArray[np.uint8],
    command: npt.NDArray[Any],
    command_bytes: npt.NDArray[np.uint8],
    logged_trace: npt.NDArray[np.uint8],
    trace_mask: npt.NDArray[np.uint8],
    trace: npt.NDArray[Any],
    trace_bytes: npt.NDArray[np.uint8],
) -> int:
    """Steps up to the first that differs; `command` and `trace` then hold its answer."""
    s: Record = state[0]
    for i in range(rows.shape[0]):
        while s.announced_count < min(announced[i], announce.shape[0]):
            said: Record = announce[s.announced_count]
            take_announcement(s, said.holds_from_ns, said.drive_velocity_mps)
        row = max(rows[i], 0)  # a step without a block does not read its row
        step(params, state, sensors[row : row + 1], events[i], gap_blocks[i], t_ns[i], command, trace)
        if t_ns[i] < compared_from_ns:
            continue
        different = 0
        for j in range(trace_bytes.shape[0]):
            different |= (logged_trace[i, j] ^ trace_bytes[j]) & trace_mask[j]
        at = command_rows[i]
        if at >= 0:
            for j in range(command_bytes.shape[0]):
                different |= (logged_command[at, j] ^ command_bytes[j]) & command_mask[j]
        if different != 0:
            return i
    return rows.shape[0]


class StepComparer:
    """Today's controller, fed with the frames of a log.

    Args:
        memory: of the controller, one record; it is changed in place.
        compared_from_s: steps before are fed and not compared.

    """

    def __init__(self, memory: npt.NDArray[Any], compared_from_s: float) -> None:
        self.difference: Difference | None = None
        self._memory = memory
        self._from_ns = compared_from_s * 1e9
        self._command, self._trace = COMMAND.blank(), TRACE.blank()
        self._masks = _mask(COMMAND), _mask(TRACE)

    def feed(self, params: npt.NDArray[Any], sensors: Records, announce: Records, command: Records, s: Stretch) -> None:
        """Go through a stretch up to the first difference, behind which nothing is compared any more.

        Args:
            params: of the controller.
            sensors, announce, command: of the log; the rows of the stretch are places in them.
            s: the stretch.

        """
        if self.difference is not None:
            return
        at = _steps(
            params, self._memory, writable(sensors), s.rows, s.events, s.gap_blocks, s.t_ns, s.announced,
            writable(announce), self._from_ns,
            _rows_of_bytes(command, COMMAND), s.command_rows, self._masks[0], self._command, self._command.view(np.uint8),
            _rows_of_bytes(s.trace, TRACE), self._masks[1], self._trace, self._trace.view(np.uint8),
        )  # fmt: skip
        if at < len(s.rows):
            logged = command[s.command_rows[at] :][:1] if s.command_rows[at] != NO_ROW else self._command
            self.difference = self._found("trace", TRACE, s.trace[at : at + 1], self._trace) or self._found(
                "command", COMMAND, logged, self._command
            )

    def _found(self, table: str, layout: Layout, logged: Records, again: Records) -> Difference | None:
        """The first field of a message with a bit that differs."""
        for name in (field.name for field in layout.message.DESCRIPTOR.fields if field.name != _OF_A_CLOCK):
            if logged[name].tobytes() != again[name].tobytes():
                return Difference(
                    table=table,
                    step=int(self._trace["sequence"][0]),
                    block=int(self._trace["block"][0]),
                    t_s=float(self._trace["t_ns"][0]) * 1e-9,
                    field=name,
                    logged=float(logged[name][0]),
                    replayed=float(again[name][0]),
                )
        return None


def _mask(layout: Layout) -> npt.NDArray[np.uint8]:
    """Which bytes of a message are compared, [size]: those of its fields, but for the field of a clock."""
    message = np.zeros(1, f"V{layout.size}").view(layout.dtype)
    for name in layout.dtype.names or ():
        width = layout.dtype[name].itemsize
        message[name] = np.frombuffer(b"\xff" * width, layout.dtype[name])[0] if name != _OF_A_CLOCK else 0
    return message.view(np.uint8)


def _rows_of_bytes(records: Records, layout: Layout) -> npt.NDArray[np.uint8]:
    return writable(records).view(np.uint8).reshape(-1, layout.size)


def writable(records: Records) -> Records:
    """The same messages, which a kernel may be compiled for once: one that only reads has another type."""
    return records if records.flags.writeable else np.frombuffer(bytearray(records.tobytes()), records.dtype)
