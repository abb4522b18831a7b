"""Viewer session on the bus: reconnects after an absence of the rig, and delays no other process."""

import contextlib
import json
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

from bridge.faults import Fault
from bridge.wire import realtime
from bridge.wire.loopback_users import absence
from bridge.wire.topics import APPLIED, CONTROLLER_EVENT, PLANT_EVENT, RECORDER_EVENT, SENSORS, TRACE
from bridge.wire.zenoh_link import REFUSES, Bus, BusConfig, Inbox, reads

EVENTS = (PLANT_EVENT, CONTROLLER_EVENT, RECORDER_EVENT)
ROLES = ("plant", "controller", "recorder")
# Queued messages: 2 s of a run. Larger: a stalled viewer shows older data. Smaller: it drops messages sooner.
LIMIT = 6000
_DIAL_S = 0.5  # timeout of one attempt to connect; Ctrl-C is delayed by up to this time
_AGAIN_S = 0.2  # pause between two attempts
_LOOK_S = 0.05  # interval of the checks of the link
_UNLINKED_S = 1.0  # after this time without a link the session is reopened; Zenoh itself bridges shorter cuts
_HEADER_S = 0.5  # timeout for the headers of rig and controller


class Presence(NamedTuple):
    """Participants on the bus at one instant."""

    linked: bool  # the link to the rig is up
    roles: frozenset[str]  # while the link is down: the last known roles, until the session is closed
    trouble: str  # why no session can be opened; empty if merely no peer answers


@dataclass
class Source:
    """Messages of a bus for a view."""

    inbox: Inbox  # received signals and events
    presence: Presence
    headers: dict[str, Any] = field(default_factory=dict)  # readable configurations of rig and controller by role
    rigs: dict[str, str] = field(default_factory=dict)  # the rig that each of them names, by role

    def read_headers(self, bus: Bus, roles: Sequence[str], timeout_s: float, stop: threading.Event) -> None:
        """Read the headers of those `roles` that answer in time."""
        for role, header in bus.headers(roles, timeout_s, stop).items():
            self.rigs[role] = header.rig
            with contextlib.suppress(ValueError, RecursionError):  # header of a foreign program
                self.headers[role] = json.loads(header.configuration)


def connected(config: BusConfig, role: str, patience_s: float, frozen: str, absent: str, about: str = "") -> Bus:
    """A session with a running rig. Messages of the role `operator` wait for a slow link instead of being dropped.

    Raises Fault NO_PEER, whose message begins with `about` and ends with a remedy: `frozen` for a rig that accepts connections
    but does not answer or whose password is missing, `absent` without an answer.
    """
    try:
        return Bus(config, role, lockstep=role == "operator", patience_s=patience_s)
    except Fault as fault:
        if fault.kind.code != "NO_PEER":
            raise
    where = config.endpoint
    reading = reads(config)
    if reading is False:
        line = f"{about}the rig at {where} accepts connections but does not answer (frozen or overloaded)"
        raise Fault("NO_PEER", f"{line}: must run; {frozen}")
    if refusal := absence(where):
        raise Fault("NO_PEER", f"{about}{refusal}; {frozen}")
    line = f"{about}no rig answered at {where} within {patience_s:g} s: {config.must_be} of a running rig"
    if reading:
        line += f"; {REFUSES}"
    raise Fault("NO_PEER", f"{line}; {absent}")


def listen(bus: Bus, inbox: Inbox) -> None:
    """Receive all signals and events that a view shows; a full inbox still takes 256 events per topic."""
    for topic in (SENSORS, APPLIED, TRACE):
        bus.listen(topic, inbox.push)
    for topic in EVENTS:
        bus.listen(topic, inbox.keep)


class Listener(Source):
    """Follows a bus in a separate thread; a context manager."""

    def __init__(self, config: BusConfig) -> None:
        super().__init__(Inbox(LIMIT), Presence(False, frozenset(), ""))
        self._config = config
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="listener", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join(2.0 * _DIAL_S)

    def _follow(self) -> None:
        while not self._over.is_set():
            trouble = ""
            try:
                with Bus(self._config, "viewer", lockstep=False, stop=self._over, patience_s=_DIAL_S) as bus:
                    listen(bus, self.inbox)
                    realtime.raise_priority()
                    self._while_linked(bus)
            except Fault as fault:
                trouble = absence(self._config.endpoint) if fault.kind.code == "NO_PEER" else fault.line
            self.presence = Presence(False, frozenset(), trouble)
            self._over.wait(_AGAIN_S)

    def _while_linked(self, bus: Bus) -> None:
        linked_s = time.monotonic()
        arrivals: list[int] = []
        while not self._over.wait(_LOOK_S):
            now_s = time.monotonic()
            linked = bus.linked()
            linked_s = now_s if linked else linked_s
            if now_s - linked_s > _UNLINKED_S:
                return
            if not linked:  # liveliness tokens vanish with the link; most cuts last less than 0.1 s
                self.presence = self.presence._replace(linked=False)
                continue
            self.presence = Presence(linked, frozenset(filter(bus.alive, ROLES)), "")
            counts = [bus.came(role) for role in ROLES[:2]]
            if linked and counts != arrivals:
                arrivals = counts
                alive = [role for role in ROLES[:2] if bus.alive(role)]
                self.read_headers(bus, alive, _HEADER_S, self._over)
