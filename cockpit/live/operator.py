"""Send an operator command to a rig, and confirm its effect from the `applied` messages of the rig."""

import contextlib
import os
import time
import uuid
from collections.abc import Callable
from typing import NamedTuple

from bridge.faults import Fault
from bridge.guard.stop_file import StopOrder, confirmed
from bridge.units import quantity
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.topics import APPLIED, OPERATOR, PLANT_EVENT
from bridge.wire.words import help_of, word_of
from bridge.wire.zenoh_link import BusConfig, Inbox, Received
from cockpit.first_stop import BY_FILE_S, CUT_AMPLIFIER
from cockpit.live.listener import connected

# Timeout of the connection. Longer: the advice to cut the amplifier comes later. Shorter: fails on a busy computer.
_DIAL_S = 2.0
# The same for a stop that the rig has confirmed by file. Longer: a jammed bus delays the end of the command. Shorter: a busy
# computer reports a bus that works.
STOPPED_DIAL_S = 0.5
# Timeout since the rig's last progress on a command. A ramp takes 0.1 s; a loop check takes 1.7 s of the rig's time, and each of
# its blocks counts as progress. Shorter: `arm` fails on a busy computer though the rig arms. Longer: the advice to cut the
# amplifier comes later.
_ANSWER_S = 5.0
_POLL_S = 0.05  # longest wait for a message, after which timeouts are checked
_AGAIN_S = 0.5  # interval at which an unconfirmed command is repeated: an overloaded computer loses 1 command in 300
_SILENT_S = 1.0  # silence of the rig after which its last state is outdated; it sends a thousand messages per second
_NOTHING_M = 1e-12  # a smaller amplitude counts as zero: rounding at the end of a ramp
# Wait after a stop for the rig's event that it cannot keep the stop over a restart; also for the controller on the bus.
_KEPT_S = 0.1
_REFUSED_S = 1.0  # a rig that is in FAULT for this long after ARM refuses it
_ARMS = (wire.Operator.ARM, wire.Operator.ACCEPT_GAIN)
_QUIETING = (wire.Operator.STOP, wire.Operator.DISARM)
_START_ONE = "start one, or give its --endpoint"


class CommandOutcome(NamedTuple):
    """Effect of an operator command on a rig."""

    endpoint: str
    word: str  # the command
    done: bool  # the rig reached the wanted state
    state: str  # state of the rig's guard
    cause: str  # cause of this state
    help: str  # meaning of the cause
    amplitude_m: float  # amplitude of the exciter
    seconds: float  # time from the first command to the end of the exchange
    not_kept: str  # why a stop does not outlast a restart of the rig; empty if it does, or for another command
    taken: bool  # the rig confirmed this command
    alone: bool  # armed without a controller on the bus
    bus_problem: str = ""  # why the bus did not deliver a stop that the rig confirmed by file; empty if the bus did

    def in_words(self) -> list[str]:
        """Lines for the operator."""
        if self.state == "NO_GUARD" and self.word in ("ARM", "ACCEPT_GAIN") and not self.alone:
            return ["arm      this rig has no guard, so it needs no arming: its controller may vibrate it already"]
        if self.state == "NO_GUARD" and self.word == "DISARM":
            return [
                "disarm   NOT DONE: this rig has no guard, so it cannot be disarmed; `stickslip stop` stops its controller"
            ]
        done = "done" if self.done else "NOT DONE"
        lines = [
            f"{self.word.lower().replace('accept_gain', 'arm'):<8} {done} after {self.seconds:.2f} s",
            f"rig      {self.state}, {_vibration(self.amplitude_m)}",
            f"cause    {self.cause}: {self.help}",
        ]
        if self.bus_problem:
            lines.append(f"warning  confirmed by file, not over the bus: {self.bus_problem}")
        if self.not_kept:
            lines.append(f"warning  {self.not_kept}")
        if self.alone:
            lines.append(
                "warning  no controller is on the bus: the rig does not vibrate until you start `stickslip controller`"
            )
        if not self.done and self.state == "READY":
            lines.append(
                "next     if the new gain is right `stickslip arm --accept-gain`; otherwise repair, then `stickslip arm`"
            )
        if not self.done and self.state == "FAULT":
            lines.append("next     `stickslip reset` when the cause is gone, then `stickslip arm`")
        return lines


def send_command(bus_config: BusConfig, name: str, dial_s: float | None = None) -> CommandOutcome:
    """Send a command until the rig has carried it out or refuses it.

    Args:
        bus_config: the bus.
        name: the command.
        dial_s: timeout of the connection; 2 s without it.

    Raises Fault NO_PEER if no rig answers, or if the rig falls silent, does not confirm the command, or vibrates after STOP.

    """
    where = bus_config.endpoint
    action = wire.Operator.Action.Value(name)
    by_hand = "if the exciter vibrates, cut its amplifier by hand now; otherwise check --endpoint"
    absent = by_hand if action in _QUIETING else _START_ONE
    with connected(bus_config, "operator", dial_s or _DIAL_S, CUT_AMPLIFIER, absent, f"{name} NOT DELIVERED: ") as bus:
        exchange = _Exchange(name)
        bus.listen(APPLIED, exchange.inbox.push)
        bus.listen(PLANT_EVENT, exchange.inbox.keep)
        exchange.until_done(bus.publisher(OPERATOR))
        if action == wire.Operator.STOP:
            exchange.hear_for(_KEPT_S)
        alone = action in _ARMS and bool(bus.wait_for(["controller"], _KEPT_S))
        has_rig = exchange.applied is None and not bus.wait_for(["plant"], _KEPT_S)
    last = exchange.applied
    if has_rig:
        remedy = CUT_AMPLIFIER if action in _QUIETING else "end it; `stickslip rig check` gives the reason"
        raise Fault("NO_PEER", f"{where}: the rig has sent no block: its device must send blocks; {remedy}")
    if last is None:
        line = f"{where}: no rig publishes `applied` messages: --prefix must equal the prefix of the run"
        raise Fault("NO_PEER", f"{line}; {CUT_AMPLIFIER if action in _QUIETING else 'give the --prefix of the run'}")
    before = f"{wire.GuardState.Name(last.guard_state)} with {_vibration(last.amplitude_m)}"
    if exchange.silent_s > _SILENT_S:
        line = (
            f"{where}: the rig has been silent for {exchange.silent_s:.1f} s, before that {before}: must answer {name}"
        )
        raise Fault("NO_PEER", f"{line}; {CUT_AMPLIFIER}; then check its process and the network")
    cause = word_of("cause", last.cause)
    outcome = CommandOutcome(
        endpoint=where,
        word=name,
        done=exchange.done,
        state=wire.GuardState.Name(last.guard_state),
        cause=cause,
        help=help_of("cause", cause),
        amplitude_m=last.amplitude_m,
        seconds=exchange.seconds,
        not_kept=exchange.not_kept,
        taken=exchange.taken,
        alone=alone,
    )
    if not (outcome.done or outcome.taken) and last.guard_state != wire.NO_GUARD:
        line = f"{where}: the rig did not confirm {name} within {_ANSWER_S:g} s and is {before}: must confirm it"
        raise Fault("NO_PEER", f"{line}; {CUT_AMPLIFIER if action in _QUIETING else 'send it again'}")
    if action == wire.Operator.STOP and not outcome.done:
        raise Fault("NO_PEER", f"{where}: the rig is {before} after a stop: must be at rest; {CUT_AMPLIFIER}")
    return outcome


def stop_rig(by_bus: Callable[[], CommandOutcome], orders: list[StopOrder]) -> CommandOutcome:
    """Stop a rig over the bus; if that fails, its confirmation of the stop by file suffices.

    Args:
        by_bus: sends STOP.
        orders: the stops of this rig by file; empty for a rig of another computer.

    Raises Fault as `by_bus` does; its line also describes the stop by file.

    """
    began_s = time.monotonic()
    try:
        return by_bus()
    except (Fault, OSError) as error:
        fault = error if isinstance(error, Fault) else Fault("NO_PEER", f"the bus failed: {error}; {CUT_AMPLIFIER}")
        problems = "; ".join(order.problem for order in orders if order.problem)
        if not confirmed(orders, BY_FILE_S):
            unconfirmed = (
                "; the stop file of the rig is set, but the rig did not confirm it: if it starts, it is in FAULT"
            )
            if problems:
                unconfirmed = f"; the stop file of the rig could not be set: {problems}"
            advice = "" if fault.kind.code == "NO_PEER" else f"; STOP NOT DELIVERED: {CUT_AMPLIFIER}"
            raise Fault(fault.kind.code, fault.line + (unconfirmed if orders else "") + advice) from None
        return CommandOutcome(
            endpoint=orders[0].endpoint,
            word="STOP",
            done=True,
            state="FAULT",
            cause="STOP_BY_PERSON",
            help=help_of("cause", "STOP_BY_PERSON"),
            amplitude_m=0.0,
            seconds=time.monotonic() - began_s,
            not_kept=problems,
            taken=True,
            alone=False,
            bus_problem=fault.line.partition("; ")[0],  # without its advice for a rig that vibrates
        )


class _Exchange:
    """One command, and the rig's messages until the command is carried out.

    The rig confirms a command by an event that repeats its sender. Only `applied` messages after that event show the effect:
    before it, the rig may be in the wanted state because of another client's command.
    """

    def __init__(self, name: str) -> None:
        self.inbox = Inbox(256)
        self.applied: wire.Applied | None = None  # the newest `applied` message
        self.taken = False
        self.not_kept = ""
        self.seconds = 0.0
        self.silent_s = 0.0  # time since the last `applied` message, at the end
        self._action = wire.Operator.Action.Value(name)
        # unique, so that the confirmation of each command is recognised, also of two commands from one process
        who = f"{os.environ.get('USER') or 'unknown user'} (process {os.getpid()}, command {uuid.uuid4().hex[:8]})"
        self._message = wire.Operator(action=name, who=who).SerializeToString()
        self._answer = f"{name} by {who}"
        self._after = False  # whether `applied` is newer than the confirmation
        self._checked = False  # whether a loop check has run since the confirmation
        self._applied_at_s = self._until_s = 0.0

    @property
    def done(self) -> bool:
        """Whether the rig is in the wanted state because of this command."""
        applied = self.applied
        if applied is None:
            return False
        state, at_rest = applied.guard_state, applied.amplitude_m == 0.0
        if self._action == wire.Operator.STOP:  # a stop by another client counts as well
            # a rig without a guard only follows its controller, which receives the command too
            return at_rest and (state == wire.NO_GUARD or applied.cause == wire.STOP_BY_PERSON)
        if not (self._after or state == wire.NO_GUARD):
            return False
        if self._action == wire.Operator.RESET:
            return state != wire.FAULT
        if self._action == wire.Operator.DISARM:
            return state == wire.DISARMED and at_rest
        if state == wire.NO_GUARD:  # such a rig needs no arming
            return True
        return state in (wire.ARMED, wire.ACTIVE) and applied.cause != wire.ARMED_BY_SCENARIO

    def until_done(self, send: Callable[[bytes], None]) -> None:
        """Send the command until the rig confirms it; listen until it is carried out, refused, or makes no more progress."""
        began_s = again_s = polled_s = time.monotonic()
        self._until_s = began_s + _ANSWER_S
        while True:
            now_s = time.monotonic()
            # this computer stalled, so messages of the rig wait unread
            if realtime.was_paused(polled_s, polled_s + _POLL_S):
                self._until_s = now_s + _ANSWER_S
            if now_s >= self._until_s:
                break
            polled_s = now_s
            if now_s >= again_s and not self._after:
                send(self._message)
                again_s = now_s + _AGAIN_S
            self._receive(_POLL_S)
            refused = self._after and self._action in _ARMS and self._is_in(wire.FAULT)
            other_gain = self._checked and self._action == wire.Operator.ARM and self._is_in(wire.READY)
            no_guard = self._action == wire.Operator.DISARM and self._is_in(wire.NO_GUARD)
            if self.done or other_gain or no_guard or (refused and now_s > began_s + _REFUSED_S):
                break
        now_s = time.monotonic()
        self.seconds, self.silent_s = now_s - began_s, now_s - self._applied_at_s

    def hear_for(self, seconds: float) -> None:
        """Listen for this time, or until the rig reports that it cannot keep a stop over its restart."""
        until_s = time.monotonic() + seconds
        while not self.not_kept and (left_s := until_s - time.monotonic()) > 0.0:
            self._receive(left_s)

    def _is_in(self, state: int) -> bool:
        return self.applied is not None and self.applied.guard_state == state

    def _receive(self, timeout_s: float) -> None:
        received = self.inbox.get(timeout_s)
        with contextlib.suppress(Fault):  # skip malformed messages of other clients
            if received is not None:
                self._take(received)

    def _take(self, received: Received) -> None:
        if received.topic is APPLIED:
            self.applied = parsed(wire.Applied, received.payload, APPLIED.name)
            self._applied_at_s, self._after = time.monotonic(), self.taken
            if self._after and self._is_in(wire.CHECKING):
                self._until_s = self._applied_at_s + _ANSWER_S
            self._checked = self._after and (self._checked or self._is_in(wire.CHECKING))
            return
        event = parsed(wire.Event, received.payload, PLANT_EVENT.name)
        if event.code == "OPERATOR":
            self.taken = self.taken or event.text.startswith(self._answer)
        elif event.code == "STATE_FOLDER":
            self.not_kept = event.text


def _vibration(amplitude_m: float) -> str:
    return f"a vibration of {quantity(amplitude_m, 'm')}" if amplitude_m > _NOTHING_M else "no vibration"
