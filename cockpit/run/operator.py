"""An operator's word to a rig, and the truth of what came of it: read from what the rig applies."""

import contextlib
import os
import time
import uuid
from collections.abc import Callable
from typing import NamedTuple

from bridge.faults import Fault
from bridge.units import quantity
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.topics import APPLIED, OPERATOR, PLANT_EVENT
from bridge.wire.words import words
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox, Received, stands_still

_DIAL_S = 2.0  # a rig is there at once or not at all
# Longest wait since the rig last did something for a word. A ramp takes 0.1 s; while a loop check goes on, of 1.7 s of the rig's
# time, every block of it counts. Shorter: `arm` fails on a busy computer though the rig arms. Longer: the advice to stop by hand
# comes later.
_ANSWER_S = 5.0
_HEARS_S = 0.05  # in which a word that is done is noticed
_AGAIN_S = 0.5  # with twice as many busy processes as cores one word in 300 did not arrive
_SILENT_S = 1.0  # after which what a rig said last is no longer what it does; it says a thousand things a second
_NOTHING_M = 1e-12  # what is left of a ramp by rounding
_KEPT_S = 0.1  # in which a rig says that it cannot keep a stop over its restart
_REFUSED_S = 1.0  # for which a rig stays in FAULT after the word ARM
_ARMS = (wire.Operator.ARM, wire.Operator.ACCEPT_GAIN)
_QUIETENS = (wire.Operator.STOP, wire.Operator.DISARM)
_START_ONE = "start one, or give its --endpoint"
_BY_HAND = "take it that it goes on as before: stop the exciter's amplifier by hand, at its own interlock"


class Obeyed(NamedTuple):
    """What a rig made of a word."""

    endpoint: str
    word: str
    done: bool
    state: str  # of the rig's guard
    cause: str
    help: str  # of the cause
    amplitude_m: float  # of the exciter
    seconds: float  # from the first word to this
    not_kept: str  # why a stop does not outlast a restart of the rig; empty: it does, or is none
    taken: bool  # the rig said that it took this word
    alone: bool  # armed without a controller on the bus

    def in_words(self) -> list[str]:
        """Lines for a person."""
        if self.state == "NO_GUARD" and self.word in ("ARM", "ACCEPT_GAIN") and not self.alone:
            return ["arm      this rig has no guard: nothing to arm; the controller vibrates already"]
        if self.state == "NO_GUARD" and self.word == "DISARM":
            return [
                "disarm   NOT DONE: this rig has no guard: nothing to disarm; `stickslip stop` stops its controller"
            ]
        done = "done" if self.done else "NOT DONE"
        lines = [
            f"{self.word.lower().replace('accept_gain', 'arm'):<8} {done} after {self.seconds:.2f} s",
            f"rig      {self.state}, {_vibration(self.amplitude_m)}",
            f"cause    {self.cause}: {self.help}",
        ]
        if self.not_kept:
            lines.append(f"warning  {self.not_kept}")
        if self.alone:
            lines.append(
                "warning  no controller is on the bus: nothing vibrates until one comes, `stickslip controller`"
            )
        if not self.done and self.state == "READY":
            lines.append(
                "next     `stickslip arm --accept-gain` where the new gain is right, else mend it, then `stickslip arm`"
            )
        if not self.done and self.state == "FAULT":
            lines.append("next     `stickslip reset` when the cause is gone, then `stickslip arm`")
        return lines


def tell(bus_config: BusConfig, name: str) -> Obeyed:
    """Say a word until the rig has done it or refuses.

    Raises Fault NO_PEER where no rig answers, or it falls silent, does not confirm the word, or goes on as before.
    """
    where = bus_config.endpoint
    action = wire.Operator.Action.Value(name)
    try:
        bus = Bus(bus_config, "operator", lockstep=True, patience_s=_DIAL_S)
    except Fault as fault:
        if fault.kind.code != "NO_PEER":
            raise
        if stands_still(bus_config):
            line = f"{where}: what listens there stands still (frozen or overloaded), and hears no {name}"
            raise Fault("NO_PEER", f"{line}: must run; {_BY_HAND}") from None
        line = f"{where}: no rig answers there within {_DIAL_S:g} s: {bus_config.must_be} of the run"
        by_hand = f"if something vibrates, {_BY_HAND}"
        raise Fault("NO_PEER", f"{line}; {by_hand if action in _QUIETENS else _START_ONE}") from None
    with bus:
        exchange = _Exchange(name)
        bus.listen(APPLIED, exchange.inbox.push)
        bus.listen(PLANT_EVENT, exchange.inbox.keep)
        exchange.until_done(bus.publisher(OPERATOR))
        if action == wire.Operator.STOP:
            exchange.hear_for(_KEPT_S)
        alone = action in _ARMS and bool(bus.wait_for(["controller"], _KEPT_S))
    last = exchange.applied
    if last is None:
        line = f"{where}: no rig says what it applies: --prefix must be that of the run"
        raise Fault("NO_PEER", f"{line}; {_BY_HAND if action in _QUIETENS else 'give the --prefix of the run'}")
    before = f"{wire.GuardState.Name(last.guard_state)} with {_vibration(last.amplitude_m)}"
    if exchange.silent_s > _SILENT_S:
        line = (
            f"{where}: the rig has said nothing for {exchange.silent_s:.1f} s, before that {before}: must answer {name}"
        )
        raise Fault("NO_PEER", f"{line}; look at its process and the network; {_BY_HAND}")
    named = {(one.column, one.number): one for one in words()}
    cause = named[("cause", last.cause)]
    obeyed = Obeyed(
        endpoint=where,
        word=name,
        done=exchange.done,
        state=wire.GuardState.Name(last.guard_state),
        cause=cause.word,
        help=cause.help,
        amplitude_m=last.amplitude_m,
        seconds=exchange.seconds,
        not_kept=exchange.not_kept,
        taken=exchange.taken,
        alone=alone,
    )
    if not (obeyed.done or obeyed.taken) and last.guard_state != wire.NO_GUARD:
        line = f"{where}: the rig did not confirm {name} within {_ANSWER_S:g} s, and is {before}: must take it"
        raise Fault("NO_PEER", f"{line}; {_BY_HAND if action in _QUIETENS else 'send it again'}")
    if action == wire.Operator.STOP and not obeyed.done:
        raise Fault("NO_PEER", f"{where}: the rig is {before} after a stop: must be at rest; {_BY_HAND}")
    return obeyed


class _Exchange:
    """One word, and what the rig says meanwhile.

    The rig answers a word by an event that repeats whose word it was, and what the exciter does after that event is what came of
    it: before it, the rig may be in the state that the word asks for by somebody else's word.
    """

    def __init__(self, name: str) -> None:
        self.inbox = Inbox(256)
        self.applied: wire.Applied | None = None  # the newest
        self.taken = False
        self.not_kept = ""
        self.seconds = 0.0
        self.silent_s = 0.0  # for how long the rig had said nothing of what it applies, at the end
        self._action = wire.Operator.Action.Value(name)
        # whose word was taken must be told apart, also of two words of one process
        who = f"{os.environ.get('USER') or 'somebody'} (process {os.getpid()}, word {uuid.uuid4().hex[:8]})"
        self._word = wire.Operator(action=name, who=who).SerializeToString()
        self._answer = f"{name} by {who}"
        self._after = False  # whether `applied` is of after the answer
        self._checked = False  # whether a loop check ran since
        self._came_s = self._until_s = 0.0

    @property
    def done(self) -> bool:
        """Whether the rig does what the word asks for, because of it."""
        applied = self.applied
        if applied is None:
            return False
        state, at_rest = applied.guard_state, applied.amplitude_m == 0.0
        if self._action == wire.Operator.STOP:  # a stopped rig is stopped, whoever's word it took
            # a rig without a guard hangs on its controller, which takes the word too
            return at_rest and (state == wire.NO_GUARD or applied.cause == wire.STOP_BY_PERSON)
        if not (self._after or state == wire.NO_GUARD):
            return False
        if self._action == wire.Operator.RESET:
            return state != wire.FAULT
        if self._action == wire.Operator.DISARM:
            return state == wire.DISARMED and at_rest
        if state == wire.NO_GUARD:  # nothing to arm
            return True
        return state in (wire.ARMED, wire.ACTIVE) and applied.cause != wire.ARMED_BY_SCENARIO

    def until_done(self, send: Callable[[bytes], None]) -> None:
        """Say the word until the rig takes it, and listen until it has done it, refuses it, or does nothing for it any more."""
        began_s = again_s = heard_s = time.monotonic()
        self._until_s = began_s + _ANSWER_S
        while True:
            now_s = time.monotonic()
            if realtime.was_paused(heard_s, heard_s + _HEARS_S):  # messages of the rig wait to be read
                self._until_s = now_s + _ANSWER_S
            if now_s >= self._until_s:
                break
            heard_s = now_s
            if now_s >= again_s and not self._after:
                send(self._word)
                again_s = now_s + _AGAIN_S
            self._hear(_HEARS_S)
            refused = self._after and self._action in _ARMS and self._is_in(wire.FAULT)
            other_gain = self._checked and self._action == wire.Operator.ARM and self._is_in(wire.READY)
            no_guard = self._action == wire.Operator.DISARM and self._is_in(wire.NO_GUARD)
            if self.done or other_gain or no_guard or (refused and now_s > began_s + _REFUSED_S):
                break
        now_s = time.monotonic()
        self.seconds, self.silent_s = now_s - began_s, now_s - self._came_s

    def hear_for(self, seconds: float) -> None:
        """Listen for so long, or until the rig says that a stop does not outlast its restart."""
        until_s = time.monotonic() + seconds
        while not self.not_kept and (left_s := until_s - time.monotonic()) > 0.0:
            self._hear(left_s)

    def _is_in(self, state: int) -> bool:
        return self.applied is not None and self.applied.guard_state == state

    def _hear(self, timeout_s: float) -> None:
        received = self.inbox.get(timeout_s)
        with contextlib.suppress(Fault):  # rubbish of another client is no answer
            if received is not None:
                self._take(received)

    def _take(self, received: Received) -> None:
        if received.topic is APPLIED:
            self.applied = parsed(wire.Applied, received.payload, APPLIED.name)
            self._came_s, self._after = time.monotonic(), self.taken
            if self._after and self._is_in(wire.CHECKING):
                self._until_s = self._came_s + _ANSWER_S
            self._checked = self._after and (self._checked or self._is_in(wire.CHECKING))
            return
        event = parsed(wire.Event, received.payload, PLANT_EVENT.name)
        if event.code == "OPERATOR":
            self.taken = self.taken or event.text == self._answer
        elif event.code == "STATE_FOLDER":
            self.not_kept = event.text


def _vibration(amplitude_m: float) -> str:
    return f"a vibration of {quantity(amplitude_m, 'm')}" if amplitude_m > _NOTHING_M else "no vibration"
