"""`stickslip status`: one frame of `watch`, from the messages of 0.3 s. Only listens."""

import threading
import time
from typing import Any, NamedTuple

from bridge.faults import Fault
from bridge.wire.zenoh_link import BusConfig, Inbox
from cockpit.live.listener import LIMIT, ROLES, Presence, Source, connected, listen

_DIAL_S = 0.4  # a rig on this computer answers within milliseconds, in the same network within tens of milliseconds
_ROLES_S = 0.2  # wait for the roles on the bus; only a missing role costs this time
_HEADER_S = 0.2  # timeout for the headers of rig and controller
_LISTEN_S = 0.3  # time for which messages are collected: three times the delay of a rig that is late by 0.1 s
_BUSY_S = 1.0  # longest further wait for a block of a rig that a busy computer delays


class Status(NamedTuple):
    """A rig at one instant; null for a value without a message."""

    endpoint: str
    rig: str | None  # name of the rig; None if the rig's header lacks it
    roles: list[str]  # participants on the bus, out of plant, controller, recorder
    t_s: float | None  # time of the run
    mode: str | None
    reason: str | None
    limit: str | None
    contact: str | None
    slips: int | None  # counted since the start of the controller, possibly over several runs of the rig
    drive_force_N: float | None
    drive_velocity_mps: float | None
    vibration_velocity_mps: float | None
    velocity_ratio: float | None
    frequency_Hz: float | None  # frequency at the rig, after the rig's limits and ramps
    amplitude_m: float | None
    fallback: bool | None  # the rig has no fresh command and ramps to zero by itself
    state: str | None  # state of the rig's guard
    cause: str | None  # cause of `state`
    guard_limit: str | None  # limit of the guard that restricts the command now
    heat_share: float | None  # modelled temperature rise of the exciter, as a share of the largest allowed
    events: list[str]  # received while listening: 0.3 s, or longer on a busy computer
    sample_rate_Hz: float | None  # measured by the rig's computer; None before 10 s, and if it paces the rig
    answer_ns: float | None  # answer time of the exciter, a part of the latency of a command; None without one
    other_rig: str | None  # warning about a controller whose scenario describes another rig

    @property
    def controlled(self) -> bool:
        """Whether rig and controller are on the bus, and the rig receives the controller's commands."""
        return {"plant", "controller"} <= set(self.roles) and self.fallback is False


def look(bus_config: BusConfig) -> tuple[Status, list[str]]:
    """Listen for 0.3 s; returns the state, and lines for the operator. Raises Fault NO_PEER if no rig answers."""
    where = bus_config.endpoint
    frozen = "check the rig's process, and assume that the exciter vibrates as before"
    with connected(bus_config, "status", _DIAL_S, frozen, "start one, or give its --endpoint") as bus:
        # imported once a rig answers, as loading numpy takes as long as the whole rest, and before messages queue up
        from cockpit.live.frame_words import frame_lines
        from cockpit.live.view import LIVE, View

        inbox = Inbox(LIMIT)
        listen(bus, inbox)
        began_s = time.monotonic()
        missing = bus.wait_for(ROLES, _ROLES_S)
        roles = [role for role in ROLES if role not in missing]
        if not roles:
            line = f"{where}: neither rig nor controller is on this bus: --prefix must equal the prefix of the run"
            raise Fault("NO_PEER", f"{line}; give the --prefix of the run")
        source = Source(inbox, Presence(True, frozenset(roles), ""))
        source.read_headers(bus, [role for role in ROLES[:2] if role in roles], _HEADER_S, threading.Event())
        time.sleep(max(0.0, began_s + _LISTEN_S - time.monotonic()))
        view = View(source, where)
        events = view.step().events  # the first step loads code, for a second on a busy computer
        until_s = time.monotonic() + _BUSY_S
        while view.phase() != LIVE and "plant" in roles and time.monotonic() < until_s:
            time.sleep(_LISTEN_S)
            events += view.step().events
    now = view.now()
    return _status(now, [f"{event.source} {event.code}: {event.text}" for event in events]), frame_lines(now, events)


def _status(now: dict[str, Any], events: list[str]) -> Status:
    figures: dict[str, Any] = {name: now.get(name) for name in Status._fields} | {
        "rig": now["rig"] or None,
        "other_rig": now["other_rig"] or None,
        "roles": [role for role in ROLES if role in now["roles"]],
        "contact": now.get("state"),
        "state": now.get("guard_state"),
        "events": events,
    }
    for name in ("velocity_ratio", "frequency_Hz"):  # 0 if unknown, as in the messages; None without a message
        figures[name] = now[name] or 0.0 if name in now else None
    return Status(**figures)
