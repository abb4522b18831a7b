"""An operator's word to a rig, and the truth of what came of it: read from what the rig applies."""

import contextlib
import os
import time
from collections.abc import Callable
from typing import NamedTuple

from bridge.faults import Fault
from bridge.units import quantity
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.topics import APPLIED, OPERATOR, PLANT_EVENT
from bridge.wire.words import words
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox

_DIAL_S = 2.0  # a rig is there at once or not at all
_ANSWER_S = 5.0  # the loop check takes 1.5 s, a ramp 0.1 s
_AGAIN_S = 0.5  # with twice as many busy processes as cores one word in 300 did not arrive
_NOTHING_M = 1e-12  # what is left of a ramp by rounding
_KEPT_S = 0.1  # in which a rig says that it cannot keep a stop over its restart
_REFUSED_S = 1.0  # for which a rig stays in FAULT after the word ARM
_BY_HAND = "stop the exciter's amplifier by hand"


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
    alone: bool  # armed without a controller on the bus

    def in_words(self) -> list[str]:
        """Lines for a person."""
        vibration = (
            f"vibrates with {quantity(self.amplitude_m, 'm')}" if self.amplitude_m > _NOTHING_M else "no vibration"
        )
        done = "done" if self.done else "NOT DONE"
        lines = [
            f"{self.word.lower():<8} {done} after {self.seconds:.2f} s",
            f"rig      {self.state}, {vibration}",
            f"cause    {self.cause}: {self.help}",
        ]
        if self.not_kept:
            lines.append(f"warning  {self.not_kept}")
        if self.alone:
            lines.append(
                "warning  no controller is on the bus: nothing vibrates until one comes, `stickslip controller`"
            )
        if not self.done and self.state == "FAULT":
            lines.append("next     `stickslip reset` when the cause is gone, then `stickslip arm`")
        return lines


def tell(bus_config: BusConfig, name: str) -> Obeyed:
    """Say a word until the rig has done it or refuses.

    Raises Fault NO_PEER where no rig answers, or the rig goes on as before.
    """
    where = bus_config.endpoint
    who = f"{os.environ.get('USER') or 'somebody'} (process {os.getpid()})"  # whose word was taken must be told apart
    action = wire.Operator.Action.Value(name)
    word = wire.Operator(action=name, who=who).SerializeToString()
    try:
        bus = Bus(bus_config, "operator", lockstep=True, patience_s=_DIAL_S)
    except Fault as fault:
        if fault.kind.code != "NO_PEER":
            raise
        line = f"{where}: no rig answers there within {_DIAL_S:g} s: --endpoint must be that of the run"
        raise Fault("NO_PEER", f"{line}; if something vibrates, {_BY_HAND}") from None
    with bus:
        applied, events = Inbox(64), Inbox(64)
        bus.listen(APPLIED, applied.push)
        bus.listen(PLANT_EVENT, events.push)
        send = bus.publisher(OPERATOR)
        seen = _until_done(send, word, applied, action)
        not_kept = _not_kept(events) if action == wire.Operator.STOP else ""
        alone = action == wire.Operator.ARM and bool(bus.wait_for(["controller"], _KEPT_S))
    if seen is None:
        line = f"{where}: no rig says what it applies: --prefix must be that of the run"
        raise Fault("NO_PEER", f"{line}; take it that it goes on as before, and {_BY_HAND}")
    last, seconds = seen
    named = {(one.column, one.number): one for one in words()}
    cause = named[("cause", last.cause)]
    obeyed = Obeyed(
        endpoint=where,
        word=name,
        done=_is_done(last, action),
        state=wire.GuardState.Name(last.guard_state),
        cause=cause.word,
        help=cause.help,
        amplitude_m=last.amplitude_m,
        seconds=seconds,
        not_kept=not_kept,
        alone=alone,
    )
    if action == wire.Operator.STOP and not obeyed.done:
        line = f"{where}: the rig is {obeyed.state} and vibrates with {quantity(last.amplitude_m, 'm')} after a stop"
        raise Fault("NO_PEER", f"{line}: must be at rest; {_BY_HAND}")
    return obeyed


def _not_kept(events: Inbox) -> str:
    """What a rig says that cannot keep a stop over its restart; empty where it says nothing."""
    until_s = time.monotonic() + _KEPT_S
    while (left_s := until_s - time.monotonic()) > 0.0:
        received = events.get(left_s)
        with contextlib.suppress(Fault):  # rubbish of another client
            event = None if received is None else parsed(wire.Event, received.payload, PLANT_EVENT.name)
            if event is not None and event.code == "STATE_FOLDER":
                return event.text
    return ""


def _until_done(
    send: Callable[[bytes], None], word: bytes, inbox: Inbox, action: int
) -> tuple[wire.Applied, float] | None:
    """The newest message of the rig when the word is done, is refused, or time is up; None where the rig says nothing."""
    began_s = time.monotonic()
    again_s, last = began_s, None
    while (now_s := time.monotonic()) < began_s + _ANSWER_S:
        if now_s >= again_s and (last is None or last.guard_state != wire.CHECKING):
            send(word)
            again_s = now_s + _AGAIN_S
        received = inbox.get(0.05)
        with contextlib.suppress(Fault):  # rubbish of another client is no answer
            if received is not None:
                last = parsed(wire.Applied, received.payload, APPLIED.name)
        refused = action == wire.Operator.ARM and last is not None and last.guard_state == wire.FAULT
        if last is not None and (_is_done(last, action) or (refused and now_s > began_s + _REFUSED_S)):
            break
    return (last, time.monotonic() - began_s) if last is not None else None


def _is_done(applied: wire.Applied, action: int) -> bool:
    state, at_rest = applied.guard_state, applied.amplitude_m == 0.0
    if action == wire.Operator.STOP:  # a rig without a guard hangs on its controller, which takes the word too
        return at_rest and (state == wire.NO_GUARD or applied.cause == wire.STOP_BY_PERSON)
    if action == wire.Operator.RESET:
        return state != wire.FAULT
    if action == wire.Operator.DISARM:
        return state == wire.DISARMED and at_rest
    return state in (wire.ARMED, wire.ACTIVE) and applied.cause != wire.ARMED_BY_SCENARIO
