"""A viewer on the bus, for as long as somebody looks: it dials again whenever the rig was away, and never holds up anyone."""

import contextlib
import json
import threading
import time
from types import TracebackType
from typing import Any, NamedTuple, Self

from bridge.faults import Fault
from bridge.wire import realtime
from bridge.wire.topics import APPLIED, CONTROLLER_EVENT, PLANT_EVENT, RECORDER_EVENT, SENSORS, TRACE
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox

EVENTS = (PLANT_EVENT, CONTROLLER_EVENT, RECORDER_EVENT)
ROLES = ("plant", "controller", "recorder")
_LIMIT = 6000  # messages that may wait: 2 s of a run. Larger: who was held up shows what is long past
_DIAL_S = 0.5  # of one attempt; longer: Ctrl-C is late by as much
_AGAIN_S = 0.2  # between two attempts while no rig is there
_LOOK_S = 0.05
_UNLINKED_S = 1.0  # from which a session is opened anew, with the password of the day; Zenoh alone mends shorter cuts
_HEADER_S = 0.5


class Presence(NamedTuple):
    """Who is on the bus at one instant."""

    linked: bool  # whether there is a link to the rig
    roles: frozenset[str]  # where the link is cut, those before, for as long as it may mend
    trouble: str  # why there is no session, where it is more than that nobody answers


_NOBODY = Presence(False, frozenset(), "")


class Listener:
    """Follows a bus in a thread of its own; a context manager.

    Args:
        config: of the bus.

    `inbox` holds the messages of the signals and events that came, `presence` who is there, `headers` the configurations of rig
    and controller by role.

    """

    def __init__(self, config: BusConfig) -> None:
        self.inbox = Inbox(_LIMIT)
        self.presence = _NOBODY
        self.headers: dict[str, Any] = {}
        self._config = config
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="listener", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join(2.0 * _DIAL_S)

    def _follow(self) -> None:
        while not self._over.is_set():
            trouble = ""
            try:
                with Bus(self._config, "viewer", lockstep=False, stop=self._over, patience_s=_DIAL_S) as bus:
                    for topic in (SENSORS, APPLIED, TRACE):
                        bus.listen(topic, self.inbox.push)
                    for topic in EVENTS:
                        bus.listen(topic, self.inbox.keep)
                    realtime.hasten()
                    self._while_linked(bus)
            except Fault as fault:
                trouble = "" if fault.kind.code == "NO_PEER" else fault.line
            self.presence = Presence(False, frozenset(), trouble)
            self._over.wait(_AGAIN_S)

    def _while_linked(self, bus: Bus) -> None:
        linked_s = time.monotonic()
        came: list[int] = []
        while not self._over.wait(_LOOK_S):
            now_s = time.monotonic()
            linked = bus.linked()
            linked_s = now_s if linked else linked_s
            if now_s - linked_s > _UNLINKED_S:
                return
            if not linked:  # tokens go with the link, and most cuts are mended within some hundredths of a second
                self.presence = self.presence._replace(linked=False)
                continue
            self.presence = Presence(linked, frozenset(filter(bus.alive, ROLES)), "")
            counts = [bus.came(role) for role in ROLES[:2]]
            if linked and counts != came:
                came = counts
                there = [role for role in ROLES[:2] if bus.alive(role)]
                for role, header in bus.headers(there, _HEADER_S, self._over).items():
                    with contextlib.suppress(ValueError, RecursionError):  # of another program
                        self.headers[role] = json.loads(header.configuration)
