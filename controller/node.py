"""The controller as a participant of the bus: sensor blocks in; command, trace, state and snapshots out."""

from collections.abc import Callable
from typing import Any

from bridge.faults import Fault
from bridge.kernel_cache import compile_once
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.complaints import CLOCK, FOREIGN, BlockNumbers, NumberCheck
from bridge.wire.messages import ANNOUNCE as ANNOUNCE_LAYOUT
from bridge.wire.messages import ANNOUNCED, BLOCK, GAP, LATE, RESET, STALE, STOP, has_checksum, is_whole, sensor_block
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.messages import TRACE as TRACE_LAYOUT
from bridge.wire.payloads import sequence_and_time
from bridge.wire.topics import ANNOUNCE, COMMAND, SENSORS, SNAPSHOT, STATE, TRACE, Outgoing
from controller.announced import take_announcement
from controller.config import ControllerConfig
from controller.core import step
from controller.freshness import MARGIN_NS, Age, Events
from controller.records import build
from controller.telemetry import SNAPSHOT_EVERY, STATE_EVERY, plotted, snapshot
from controller.trips.trip_events import TripEvents

# Most lost blocks that are counted at once; more do not fit into a trace. A restart of the rig counts as many, so that every
# window is emptied.
_MOST_GAP_BLOCKS = 1 << 20
# Number of successive blocks of the same wrong length that show a wrong block_s of the rig; fewer are jumps of the clock
_WRONG_LENGTHS = 3
_FASTEST_MPS = 100.0  # largest announced velocity of a drive that is accepted
_SECOND = "dropped; is a second rig on this prefix?"


class ControllerNode:
    """The controller of a configuration, stepped frame by frame.

    Raises Fault BAD_MESSAGE for messages that cannot be read, CONFIG for blocks of another length.
    """

    def __init__(self, config: ControllerConfig) -> None:
        self.note: Callable[..., object] = lambda *_: None  # publishes a fault of the blocks, as `Complaints.note`
        self.duplicates = 0  # number of repeated blocks, and of late blocks that were counted as a gap
        self.steps = 0
        self.t_ns = 0  # time of the last frame
        self.block_t_ns = 0  # time of the last block
        self.last_block = -1  # number of the last block
        self.age = Age()
        self._params, self._state = build(config)
        self._block_ns = round(config.block_s * 1e9)
        self._layout = sensor_block(config.samples_per_block)
        self._no_sensors = self._layout.blank()
        self._command = COMMAND_LAYOUT.blank()
        self._trace = TRACE_LAYOUT.blank()
        self._traced = TRACE_LAYOUT.row(self._trace)
        self._numbers = BlockNumbers()
        self._seals = False  # whether the rig's blocks have a checksum
        self._lengths_ns: list[int] | None = []  # of the blocks so far; None once a length was right
        self._clock_jump_ns = 0  # t_ns of the last block minus the time by its number; 0 if about equal
        self._operator_events = 0
        self._announced = 0  # ANNOUNCED if announcements arrived since the last frame, else 0
        self._news: Events = []  # of the last block
        self._trip_events = TripEvents()

    @property
    def amplitude_m(self) -> float:
        """Amplitude of the last command [m]."""
        return float(self._state["allowed_m"][0])

    @property
    def rig_reports(self) -> bool:
        """Whether the rig has a guard, which applies the operator's commands and reports them."""
        return int(self._state["guard_state"][0]) != wire.NO_GUARD

    @property
    def in_time(self) -> bool:
        """Whether the last block was answered in time, within 15 ms, and all its samples are numbers."""
        return self.age.late_ns <= MARGIN_NS and not self._is_unreadable

    @property
    def _is_unreadable(self) -> bool:
        return int(self._traced["limit"]) == wire.NOT_FINITE

    def warm_up(self) -> None:
        """Compile or load the kernels on copies, so that the first answer is not late."""
        compile_once("the controller", self._step_copies)

    def _step_copies(self) -> None:
        state = self._state.copy()
        take_announcement(state[0], 0, 0.0)
        step(
            self._params, state, self._no_sensors, BLOCK, 0, 0,
            COMMAND_LAYOUT.blank(), TRACE_LAYOUT.blank(),
        )  # fmt: skip

    def reconfigure(self, config: ControllerConfig) -> None:
        """Continue with another configuration and the present memory."""
        self._params, _ = build(config)

    def operator(self, action: int) -> None:
        """Take an operator's action (`wire.Operator.Action`); it takes effect, and is logged, with the next frame."""
        self._operator_events = operator_events(self._operator_events, action)

    def announcement(self, payload: bytes) -> None:
        """Take the rig's announcement of its drive velocity for the next frame. Raises Fault BAD_MESSAGE."""
        message = ANNOUNCE_LAYOUT.read(payload, ANNOUNCE.name)[0]
        if not abs(message.drive_velocity_mps) <= _FASTEST_MPS:
            line = f"{ANNOUNCE.name}: drive_velocity_mps = {message.drive_velocity_mps:g}: must be at most {_FASTEST_MPS:g}"
            raise Fault("BAD_MESSAGE", f"{line} in either direction; announce m/s")
        if message.holds_from_ns < message.t_ns:
            line = f"{ANNOUNCE.name}: holds_from_ns = {message.holds_from_ns}: must not be before t_ns = {message.t_ns}"
            raise Fault("BAD_MESSAGE", f"{line}; announce the future velocity")
        take_announcement(self._state[0], message.holds_from_ns, message.drive_velocity_mps)
        self._announced = ANNOUNCED

    def rig_was_away(self) -> None:
        """Prepare for a rig that has left and rejoined the bus: blocks that count from 0 again belong to a new run."""
        self._numbers.sender_was_away()
        self._seals = False

    def block(self, payload: bytes, arrival_ns: int = 0, answered_ns: int = 0) -> Outgoing | None:
        """Consume a sensor block; return the command that answers it, or None for a late, repeated or foreign block.

        Send the command first; then `rest` gives the other messages of the step, and `news` its events.

        Args:
            payload: the block.
            arrival_ns: time of its arrival (time.perf_counter_ns).
            answered_ns: the present time; the age of a block counts until now, including its time in the queue. 0 in lockstep:
                the rig waits, so no block is late, however long the computer stalled.

        """
        payload = self._layout.canonical(payload, SENSORS.name)
        if self._seals or has_checksum(payload):
            self._refuse_changed(payload)
        sequence, t_ns = sequence_and_time(payload, SENSORS.message)
        expected, strays = self._numbers.expected, self._numbers.strays
        verdict = self._numbers.judge(sequence, arrival_ns)
        if strays := self._numbers.strays - strays:
            text = f"blocks with numbers far from the last block {self.last_block}: {_SECOND}"
            self.note(FOREIGN, SENSORS.name, text, strays)
        if verdict is NumberCheck.AGAIN:
            self.duplicates += 1  # late or repeated: the controller has counted this block as a gap already
            self.note("REPEATED", SENSORS.name, f"repeated or late blocks: {_SECOND}")
        if verdict in (NumberCheck.AGAIN, NumberCheck.STRAY):
            return None
        if verdict is NumberCheck.ANEW:
            text = f"block {sequence} after block {self.last_block}: the controller continues with empty windows"
            self._news.append(("RIG_RESTARTED", text))
            self.age.forget()
            gap_blocks, self._clock_jump_ns = _MOST_GAP_BLOCKS, 0
        else:
            lost = sequence - expected if expected is not None and self.steps else 0
            gap_blocks = min(lost, _MOST_GAP_BLOCKS)
            if expected is not None:
                self._check_clock(t_ns - self.block_t_ns, lost)
        if answered_ns > 0:
            self.age.note(answered_ns, t_ns)
        self.last_block = sequence
        self.block_t_ns = self.t_ns = t_ns
        late = LATE if self.age.late_ns > MARGIN_NS else 0
        events = BLOCK | (GAP if gap_blocks else 0) | late | self._operator_events
        return self._step(self._layout.record(payload), events, gap_blocks)

    def _refuse_changed(self, payload: bytes) -> None:
        """Raise Fault BAD_MESSAGE for a block that was changed in transit; after the first checksum every block needs one."""
        if not is_whole(payload):
            line = f"{SENSORS.name}: checksum: does not match the block's bytes, which were changed in transit"
            raise Fault("BAD_MESSAGE", f"{line}; check link and adapter")
        self._seals = True

    def _check_clock(self, apart_ns: int, lost: int) -> None:
        """Compare t_ns with the number of the block.

        Raises Fault CONFIG for blocks of another length: rates, filters and slopes count in blocks.
        """
        off_ns = apart_ns - (lost + 1) * self._block_ns
        self._clock_jump_ns = off_ns if 100 * abs(off_ns) > self._block_ns else 0
        if self._clock_jump_ns:
            self.age.forget()
        if self._lengths_ns is None or lost:
            return
        self._lengths_ns = [*self._lengths_ns, apart_ns][-_WRONG_LENGTHS:] if self._clock_jump_ns else None
        if self._lengths_ns == [apart_ns] * _WRONG_LENGTHS and apart_ns > 0:
            line = f"{SENSORS.name}: blocks are {apart_ns * 1e-6:g} ms apart: must be block_s = {self._block_ns * 1e-9:g} s"
            raise Fault("CONFIG", f"{line}; set block_s of rig and controller alike")

    def stale(self, silent_blocks: int) -> Outgoing:
        """Step without a block, `silent_blocks` periods after the last frame: the command ramps to zero."""
        self.t_ns += silent_blocks * self._block_ns
        return self._step(self._no_sensors, STALE | self._operator_events, 0)

    def _step(self, sensors: Any, events: int, gap_blocks: int) -> Outgoing:
        events |= self._announced
        self._operator_events = self._announced = 0
        step(
            self._params, self._state, sensors, events, gap_blocks, self.t_ns,
            self._command, self._trace,
        )  # fmt: skip
        self.steps += 1
        return Outgoing(COMMAND, self._command.tobytes())

    def news(self) -> Events:
        """Codes and texts of a restart of the rig, and of trips that began or ended; notes the faults of the last block."""
        if self._clock_jump_ns:
            text = f"t_ns is {self._clock_jump_ns * 1e-6:g} ms off the time that the block number gives"
            self.note(CLOCK, SENSORS.name, f"block {self.last_block}: {text}; trace and log keep the rig's times")
        if self.age.is_late:
            text = f"blocks arrive {self.age.late_ns * 1e-6:.0f} ms later than before"
            self.note("LATE", SENSORS.name, f"{text}: v_a oscillates more than it should")
        if self._is_unreadable:
            text = f"block {self.last_block} holds a sample that is not a number: ramping to zero"
            self.note("NOT_FINITE", SENSORS.name, text)
        if self._state["slide_accel_unread"][0]:
            text = "a sample is not a number; the controller continues without this channel"
            self.note("NOT_FINITE", f"{SENSORS.name} mass_accel_mps2", text)
        news, self._news = self._news, []
        return news + self._trip_events.news(self._traced)

    def rest(self, lateness_ns: int) -> list[Outgoing]:
        """The messages after the command: the trace, and at lower rates the plotted state and a snapshot of the memory."""
        self._trace["lateness_ns"] = lateness_ns
        messages = [Outgoing(TRACE, self._trace.tobytes())]
        if self.steps % STATE_EVERY == 0:
            messages.append(Outgoing(STATE, plotted(self._trace, self.steps).tobytes()))
        if self.steps % SNAPSHOT_EVERY == 0:
            messages.append(Outgoing(SNAPSHOT, snapshot(self._state, self.steps, self.t_ns)))
        return messages


def operator_events(events: int, action: int) -> int:
    """The operator's bits for the next frame, after a further action (`wire.Operator.Action`); a RESET does not cancel a STOP."""
    if action == wire.Operator.STOP:
        return STOP
    return RESET if action == wire.Operator.RESET and not events & STOP else events
