"""The state of a rig now: the roles on its bus, and the newest messages of rig and controller. Only listens."""

import contextlib
import json
import threading
import time
from collections.abc import Iterable
from typing import NamedTuple, TypeVar

from google.protobuf.message import Message

from bridge.faults import Fault
from bridge.units import counted, quantity
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import WEAK_REASONS
from bridge.wire.payloads import parsed
from bridge.wire.topics import APPLIED, COMMAND, CONTROLLER_EVENT, PLANT_EVENT, RECORDER_EVENT, STATE, Topic
from bridge.wire.words import words
from bridge.wire.zenoh_link import Bus, BusConfig, Received, is_frozen

_DIAL_S = 0.4  # a rig on this computer answers within milliseconds, in the same network within tens of milliseconds
_ROLES_S = 0.2  # present roles are known as soon as the link is; only a missing role costs this time
_HEADER_S = 0.2
_LISTEN_S = 0.3  # three times the delay of a rig that is late by 0.1 s; events within this time are shown
_ROLES = ("plant", "controller", "recorder")
_NEXT = {
    "FAULT": "no vibration until an operator resets and arms the rig: `stickslip reset`, then `stickslip arm`",
    "DISARMED": "no vibration until an operator arms the rig: `stickslip arm`",
    "NO_GUARD": "this rig reports no guard: nothing on its side is known to limit the vibration",
}
_NO_WARNING = {
    "NO_CAUSE",
    "SLEW_RATE",
    "NO_LIMIT",
    "SLEW",
    "RANGE",
    "FREQUENCY_BAND",
    "OPERATOR_STOP",
}  # limits of normal operation

M = TypeVar("M", bound=Message)


class Status(NamedTuple):
    """A rig at one instant; null for a value without a message."""

    endpoint: str
    rig: str | None  # its name; None if its header lacks it
    roles: list[str]  # those of plant, controller and recorder that are on the bus
    t_s: float | None  # of the run
    mode: str | None
    reason: str | None
    limit: str | None
    contact: str | None
    slips: int | None  # since the start of the controller, possibly over several runs of the rig
    drive_force_N: float | None
    drive_velocity_mps: float | None
    vibration_velocity_mps: float | None
    velocity_ratio: float | None
    frequency_Hz: float | None  # at the rig, after its own limits and ramps
    amplitude_m: float | None
    fallback: bool | None  # the rig has no fresh command and ramps to zero by itself
    state: str | None  # of the rig's guard
    cause: str | None  # of `state`
    guard_limit: str | None  # limit of the guard that restricts the command now
    heat_share: float | None  # modelled temperature rise of the exciter, as a share of the largest allowed
    events: list[str]  # received within 0.3 s

    @property
    def controlled(self) -> bool:
        """Whether rig and controller are on the bus, and the rig receives the controller's commands."""
        return {"plant", "controller"} <= set(self.roles) and self.mode is not None and not self.fallback

    def in_words(self) -> list[str]:
        """Lines for the operator."""
        missing = [role for role in _ROLES if role not in self.roles]
        lines = [
            f"rig      {self.rig or 'of unknown name'} at {self.endpoint}",
            f"on bus   {', '.join(self.roles)}" + (f"; no {', no '.join(missing)}" if missing else ""),
        ]
        if self.state is not None and self.cause is not None:
            lines.append(f"state    {self.state}: {_help('guard_state', self.state)}")
            lines.append(f"cause    {self.cause}: {_help('cause', self.cause)}")
        if self.t_s is not None:
            counted_slips = counted(self.slips or 0, "slip")
            lines.append(f"run      {self.t_s:.1f} s; {counted_slips} since the start of the controller")
        for name, column, word in (
            ("mode", "mode", self.mode),
            ("reason", "reason", self.reason),
            ("limit", "limit", self.limit if self.limit != "NO_LIMIT" else None),
            ("contact", "state", self.contact),
        ):
            if word is not None:
                lines.append(f"{name:<8} {word}: {_help(column, word)}")
        if self.drive_velocity_mps is not None and self.drive_force_N is not None:
            lines.append(f"drive    {quantity(self.drive_velocity_mps, 'm/s')} against {self.drive_force_N:.2f} N")
        if self.velocity_ratio is not None:
            lines.append(f"v_a/v_d  {self.velocity_ratio:.2f}")
        if self.amplitude_m is not None and self.frequency_Hz is not None:
            vibration = f"{quantity(self.amplitude_m, 'm')} at {self.frequency_Hz:.0f} Hz"
            lines.append(f"applied  {vibration if self.amplitude_m > 0.0 else 'no vibration'}")
        lines.extend(f"event    {event}" for event in self.events)
        lines.extend(f"warning  {warning}" for warning in self.warnings())
        return lines

    def warnings(self) -> list[str]:
        """Conditions that need the operator's attention."""
        lines: list[str] = []
        if "controller" not in self.roles:
            lines.append("no controller is on the bus: the rig is not controlled")
        elif self.mode is None:
            lines.append(f"the controller sent no command for {_LISTEN_S:g} s")
        if self.state in _NEXT:
            lines.append(_NEXT[self.state])
        if self.guard_limit is not None and self.guard_limit not in _NO_WARNING:
            lines.append(f"{self.guard_limit}: {_help('cause', self.guard_limit)}")
        if self.fallback and self.state in {"ARMED", "ACTIVE"}:
            lines.append("the rig has no fresh command and ramps the vibration to zero by itself")
        if self.limit is not None and self.limit not in _NO_WARNING:
            lines.append(f"{self.limit}: {_help('limit', self.limit)}")
        if self.reason in WEAK_REASONS:
            lines.append(f"{self.reason}: {_help('reason', self.reason)}")
        if "recorder" not in self.roles:
            lines.append("nothing is recorded: no recorder is on the bus")
        return lines


def _help(column: str, word: str) -> str:
    return next((row.help for row in words() if (row.column, row.word) == (column, word)), "not known to this version")


class _Newest:
    """The newest message of each topic, and every event."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._payloads: dict[str, bytes] = {}
        self.events: list[Received] = []

    def keep(self, received: Received) -> None:
        with self._changed:
            self._payloads[received.topic.name] = received.payload
            self._changed.notify_all()

    def note(self, received: Received) -> None:
        self.events.append(received)

    def wait_for(self, topics: Iterable[Topic], timeout_s: float) -> None:
        wanted = {topic.name for topic in topics}
        with self._changed:
            self._changed.wait_for(lambda: wanted <= self._payloads.keys(), timeout_s)

    def get(self, topic: Topic, kind: type[M]) -> M | None:
        payload = self._payloads.get(topic.name)
        with contextlib.suppress(Fault):  # skip malformed messages of other clients
            return parsed(kind, payload, topic.name) if payload is not None else None
        return None


def look(bus_config: BusConfig) -> Status:
    """Listen for 0.3 s. Raises Fault NO_PEER if no rig answers."""
    where = bus_config.endpoint
    try:
        bus = Bus(bus_config, "status", lockstep=False, patience_s=_DIAL_S)
    except Fault as fault:
        if fault.kind.code != "NO_PEER":
            raise
        if is_frozen(bus_config):
            line = f"{where}: the rig accepts connections but does not answer (frozen or overloaded): must run"
            raise Fault(
                "NO_PEER", f"{line}; check the rig's process, and assume that the exciter vibrates as before"
            ) from None
        line = f"{where}: no rig answered within {_DIAL_S:g} s: {bus_config.must_be} of a running rig"
        raise Fault("NO_PEER", f"{line}; start one, or give its --endpoint") from None
    with bus:
        newest = _Newest()
        for topic in (STATE, COMMAND, APPLIED):
            bus.listen(topic, newest.keep)
        for topic in (PLANT_EVENT, CONTROLLER_EVENT, RECORDER_EVENT):
            bus.listen(topic, newest.note)
        began_s = time.monotonic()
        missing = bus.wait_for(_ROLES, _ROLES_S)
        roles = [role for role in _ROLES if role not in missing]
        if not roles:
            line = f"{where}: neither rig nor controller is on this bus: --prefix must equal the prefix of the run"
            raise Fault("NO_PEER", f"{line}; give the --prefix of the run")
        rig = _rig(bus) if "plant" in roles else None
        newest.wait_for([APPLIED, *([STATE, COMMAND] if "controller" in roles else [])], _LISTEN_S)
        time.sleep(max(0.0, began_s + _LISTEN_S - time.monotonic()))
    return _status(where, rig, roles, newest)


def _rig(bus: Bus) -> str | None:
    """The name of the rig from its header; None if the header lacks it."""
    with contextlib.suppress(Fault, ValueError, TypeError, KeyError, RecursionError):
        header = bus.headers(["plant"], _HEADER_S, threading.Event())["plant"]
        name = json.loads(header.configuration)["rig"]["name"]
        return name if isinstance(name, str) else None
    return None


def _status(endpoint: str, rig: str | None, roles: list[str], newest: _Newest) -> Status:
    state, command = newest.get(STATE, wire.State), newest.get(COMMAND, wire.Command)
    applied = newest.get(APPLIED, wire.Applied)
    named = {(row.column, row.number): row.word for row in words()}

    def word(column: str, number: int) -> str:
        return named.get((column, number), str(number))

    return Status(
        endpoint=endpoint,
        rig=rig,
        roles=roles,
        t_s=state.t_ns * 1e-9 if state else None,
        mode=word("mode", command.mode) if command else None,
        reason=word("reason", command.reason) if command else None,
        limit=word("limit", command.limit) if command else None,
        contact=word("state", state.state) if state else None,
        slips=state.slips if state else None,
        drive_force_N=state.drive_force_N if state else None,
        drive_velocity_mps=state.drive_velocity_mps if state else None,
        vibration_velocity_mps=state.vibration_velocity_mps if state else None,
        velocity_ratio=state.velocity_ratio if state else None,
        frequency_Hz=applied.frequency_Hz if applied else None,
        amplitude_m=applied.amplitude_m if applied else None,
        fallback=bool(applied.fallback) if applied else None,
        state=word("guard_state", applied.guard_state) if applied else None,
        cause=word("cause", applied.cause) if applied else None,
        guard_limit=word("cause", applied.guard_limit) if applied else None,
        heat_share=applied.heat_share if applied else None,
        events=_events(newest),
    )


def _events(newest: _Newest) -> list[str]:
    lines: list[str] = []
    for received in newest.events:
        with contextlib.suppress(Fault):
            event = parsed(wire.Event, received.payload, received.topic.name)
            lines.append(f"{event.source} {event.code}: {event.text}")
    return lines
