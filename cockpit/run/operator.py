"""An operator's word to the controller, and whether it was taken."""

import contextlib
import os
import time

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.topics import CONTROLLER_EVENT, OPERATOR
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox

_ANSWER_S = 2.0  # a rig is there at once or not at all, and a controller reads its inbox every 20 ms at the latest
_AGAIN_S = 0.5  # with twice as many busy processes as cores one word in 300 did not arrive


def tell(bus_config: BusConfig, action: wire.Operator.Action) -> str:
    """Say it until the controller's event tells that it was taken; the words of that event.

    Raises Fault NO_PEER when none does.
    """
    where, by_hand = bus_config.endpoint, "stop the exciter's amplifier by hand"
    who = f"{os.environ.get('USER') or 'somebody'} (process {os.getpid()})"  # whose word was taken must be told apart
    word, said = (
        wire.Operator(action=action, who=who).SerializeToString(),
        f"{wire.Operator.Action.Name(action)} by {who}",
    )
    try:
        bus = Bus(bus_config, "operator", lockstep=True, patience_s=_ANSWER_S)
    except Fault:
        line = f"{where}: no rig answers there within {_ANSWER_S:g} s: --endpoint must be that of the run"
        raise Fault("NO_PEER", f"{line}; if something vibrates, {by_hand}") from None
    with bus:
        send = bus.publisher(OPERATOR)
        inbox = Inbox(0)
        bus.listen(CONTROLLER_EVENT, inbox.keep)
        if bus.wait_for(["controller"], _ANSWER_S):
            line = f"{where}: no controller on the bus: --prefix must be that of the run"
            raise Fault("NO_PEER", f"{line}; if something vibrates, {by_hand}")
        for _ in range(round(_ANSWER_S / _AGAIN_S)):
            send(word)
            if _taken(inbox, said, _AGAIN_S):
                return said
    line = f"{where}: the controller does not answer: must within {_ANSWER_S:g} s"
    raise Fault("NO_PEER", f"{line}; take it that it goes on as before, and {by_hand}")


def _taken(inbox: Inbox, said: str, timeout_s: float) -> bool:
    until_s = time.monotonic() + timeout_s
    while (left_s := until_s - time.monotonic()) > 0.0:
        answer = inbox.get(left_s)
        with contextlib.suppress(Fault):  # rubbish of another client is no answer
            event = parsed(wire.Event, answer.payload, CONTROLLER_EVENT.name) if answer else wire.Event()
            if (event.code, event.text) == ("OPERATOR", said):
                return True
    return False
