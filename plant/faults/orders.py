"""An operator's fault-injection request to a running rig: a fault from now on, as a message of the topic `fault`."""

import collections
import json

from bridge.config import validate
from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.topics import FAULT
from plant.faults.kinds import PROCESS
from plant.faults.schedule import Faults
from plant.faults.table import FaultTable

_LONGEST = 10_000  # longest table [bytes]; every valid table has fewer than 500


_REMEMBERED = 64  # orders whose ids are stored; a repeated order arrives within a second


class Orders:
    """The fault-injection requests to a rig.

    Args:
        faults: schedule of the rig's faults, to which requests are added.

    """

    def __init__(self, faults: Faults) -> None:
        self._faults = faults
        self._taken: collections.deque[str] = collections.deque(maxlen=_REMEMBERED)

    def take(self, payload: bytes, block: int) -> None:
        """Add the fault of a request to the rig from block `block` on; a repeated request is ignored.

        Raises Fault BAD_MESSAGE for a malformed request, CONFIG for an invalid fault of a rig.
        """
        order = parsed(wire.Inject, payload, FAULT.name)
        if order.id and order.id in self._taken:
            return
        self._taken.append(order.id)
        table = _table(order.fault) if order.fault else None
        if order.clear:
            self._faults.clear(block)
        if table is not None:
            self._faults.add(table, block)


def _table(text: str) -> FaultTable:
    try:
        table = json.loads(text) if len(text) < _LONGEST else None
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict):
        raise Fault("BAD_MESSAGE", f"{FAULT.name}: fault: is not a JSON object; send a table [[fault]]")
    made = validate(FaultTable, table, FAULT.name)
    if made.group == PROCESS:
        line = f"{FAULT.name}: target = {made.target}: a rig cannot end a process; must belong to sensors, exciter, clock or bus"
        raise Fault("CONFIG", f"{line}; end the process by its pid")
    return made
