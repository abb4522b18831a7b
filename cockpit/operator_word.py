"""An operator's word to the controller, and whether it was taken."""

import contextlib
import os
import time

from bridge import stickslip_pb2 as wire
from bridge.faults import Fault
from bridge.messages import parsed
from bridge.topics import CONTROLLER_EVENT, OPERATOR
from bridge.zenoh_link import Bus, BusConfig, Inbox

_ANSWER_S = 2.0  # a controller reads its inbox every 20 ms at the latest, limits.stale_after_s
_AGAIN_S = 0.5  # with twice as many busy processes as cores one word in 300 did not arrive


def tell(bus_config: BusConfig, action: wire.Operator.Action) -> None:
    """Say it until the controller's event tells that it was taken. Raises Fault NO_PEER when none does."""
    word = wire.Operator(action=action, who=os.environ.get("USER", "")).SerializeToString()
    with Bus(bus_config, "operator", lockstep=True) as bus:
        send = bus.publisher(OPERATOR)
        inbox = Inbox(0)
        bus.listen(CONTROLLER_EVENT, inbox.keep)
        if bus.wait_for(["controller"], 2.0):
            raise Fault("NO_PEER", f"{bus_config.endpoint}: no controller on the bus; nothing to tell")
        for _ in range(round(_ANSWER_S / _AGAIN_S)):
            send(word)
            if _taken(inbox, _AGAIN_S):
                return
    line = f"{bus_config.endpoint}: the controller does not answer: must within {_ANSWER_S:g} s"
    raise Fault("NO_PEER", f"{line}; take it that it goes on as before, and stop the exciter's amplifier by hand")


def _taken(inbox: Inbox, timeout_s: float) -> bool:
    until_s = time.monotonic() + timeout_s
    while (left_s := until_s - time.monotonic()) > 0.0:
        answer = inbox.get(left_s)
        with contextlib.suppress(Fault):  # rubbish of another client is no answer
            if answer and parsed(wire.Event, answer.payload, CONTROLLER_EVENT.name).code == "OPERATOR":
                return True
    return False
