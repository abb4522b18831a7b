"""The 25 checks of a rig on the bus: any client, with our guard, another one, or none. This process is its controller."""

import contextlib
import json
import math
import queue
import threading
import time
import uuid
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from bridge.faults import Fault
from bridge.guard.config import VibrationLimits
from bridge.rig.conformance import exciter
from bridge.rig.conformance.both import shared
from bridge.rig.conformance.heard import Block, Stage
from bridge.rig.conformance.report import Check, Conformance, Measured, judged
from bridge.rig.conformance.session import REST_S, Ended, Facts, Session, tones_and_steps
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS
from bridge.wire.payloads import parsed
from bridge.wire.topics import APPLIED, COMMAND, OPERATOR, SENSORS
from bridge.wire.words import word_of
from bridge.wire.zenoh_link import Bus, BusConfig, Received

_HEADER_S = 2.0
_PATIENCE_S = 5.0  # longest wait for a block
_ORDER_S = 10.0  # longest wait for the state after an operator's order; a loop check takes 1.7 s
_AGAIN_S = 0.5  # interval at which an order is repeated
_TIMEOUT_S = 0.05  # silence after which a rig counts its commands as lost, if its header states no other
_OVER = 1.05  # command over the largest amplitude
_LIMITS = TypeAdapter(VibrationLimits)
_DEFAULT_LIMITS = VibrationLimits(1e-7, None, None, 500.0, 5000.0, [])
_STOPPED = ("order", "stop")  # stages in which the rig may be in FAULT
_MAY_VIBRATE = (wire.ARMED, wire.ACTIVE)


def _header(session: Session) -> Measured:
    if "header" in session.failures:
        return Measured(False, session.failures["header"], "schema 1 to 3, block_s, samples_per_block")
    return Measured(True, "read", "schema 1 to 3, block_s, samples_per_block")


_REMEDIES = {
    "shape": "fill every channel of a SensorBlock with samples_per_block samples, an absent one with zeros",
    "numbers": "count `sequence` from 0 without a gap, and t_ns in samples",
    "rate": "correct block_s of the header, or the clock of the rig",
    "repeated": "send each block once",
    "amplitude": "take amplitude_m in metres of displacement; check the unit of base_accel_mps2",
    "answer-time": "let the command that answers block n act in block n + 1",
}
_SHARED = shared(("header",), _REMEDIES)
_VIBRATION = _SHARED[-1].needs  # as `zero`, the end of a vibration
CHECKS = (
    Check("header", "answer queries of header/plant, as in PROTOCOL.md", _header),
    *_SHARED,
    Check("armed", "vibrate in ARMED and ACTIVE only", exciter.armed, ("header", "shape")),
    Check("ramp", "change the amplitude by limits.slew_m_per_s at most", exciter.ramp, _VIBRATION),
    Check("limit", "hold the amplitude at limits.amplitude_max_m", exciter.limit, _VIBRATION),
    Check("silence", "ramp to zero without a fresh command", exciter.silence, _VIBRATION),
    Check("stop", "let an operator's STOP end the vibration until RESET", exciter.stop, _VIBRATION),
)


def conformance_of_client(bus: BusConfig, lockstep: bool) -> Conformance:
    """Hold a session with the rig on a bus and judge it. Raises Fault NO_PEER, ENDPOINT_BUSY."""
    begun_s = time.monotonic()
    with contextlib.ExitStack() as links:
        link = links.enter_context(Bus(bus, "controller", lockstep))
        if link.wait_for(["plant"], bus.wait_s):
            raise Fault("NO_PEER", f"{bus.endpoint}: no rig within {bus.wait_s:g} s; start it, or give its --endpoint")
        if link.alive("controller"):
            raise Fault("ENDPOINT_BUSY", f"{bus.endpoint}: a controller is on this bus: must be none; end it")
        if lockstep:  # such a rig may wait for a recorder
            links.enter_context(Bus(bus, "recorder", lockstep)).announce()
        client = _Client(link, bus, lockstep)
        with contextlib.suppress(Ended):
            client.stages()
        return Conformance(client.rig, time.monotonic() - begun_s, judged(CHECKS, client.session))


class _Client:
    """The session with the rig of a bus."""

    def __init__(self, link: Bus, bus: BusConfig, lockstep: bool) -> None:
        self._bus = bus
        header = link.headers(["plant"], _HEADER_S, threading.Event()).get("plant")
        self.rig = header.rig if header is not None else ""
        facts, problem = _facts(header, lockstep)
        self.session = Session(facts, "caller" if lockstep else "device")
        if problem:
            self.session.failures["header"] = problem
        self._lockstep = lockstep
        self._blocks: queue.Queue[Received] = queue.Queue()
        self._applied: dict[int, wire.Applied] = {}
        self._send = link.publisher(COMMAND)
        self._newest = facts.tones_Hz[0], 0.0
        self._sent, self._run, self._state, self._last = 0, 0, wire.NO_GUARD, -1
        link.listen(SENSORS, self._blocks.put)
        link.listen(APPLIED, self._hear_applied)
        link.announce()

    def _hear_applied(self, received: Received) -> None:
        with contextlib.suppress(Fault):
            applied = parsed(wire.Applied, received.payload, APPLIED.name)
            self._applied[applied.sequence] = applied

    def stages(self) -> None:
        """All stages; the rig is disarmed at the end."""
        facts = self.session.facts
        first_Hz, most_m = facts.tones_Hz[0], facts.amplitude_m
        settled_s = facts.ramp_s + facts.answer_s + 0.02
        if "header" in self.session.failures:
            raise Ended
        try:
            self._collect("first", 0.02, first_Hz, 0.0)
            self._collect("rest", REST_S, first_Hz, 0.0)
            self.session.has_guard = self._state != wire.NO_GUARD
            if self.session.has_guard and self._state not in _MAY_VIBRATE:
                self._collect("not armed", 0.1, first_Hz, most_m)
                self._arm()
            for stage in tones_and_steps(facts, settled_s):
                self._collect(*stage)
            if not self._lockstep:
                self._collect("before silence", settled_s, first_Hz, most_m)
                self._collect("silence", facts.watchdog_s + settled_s + 0.05, first_Hz, None)
            self._collect("limit", settled_s, first_Hz, _OVER * facts.limits.amplitude_max_m)
            self._collect("zero", 2.0 * settled_s, first_Hz, 0.0)
            if self.session.has_guard:
                self._collect("before stop", settled_s, first_Hz, most_m)
                self._order(wire.Operator.STOP, (wire.FAULT,))
                self._collect("stop", settled_s + 0.1, first_Hz, most_m)
        finally:
            if self.session.has_guard:
                self._order(wire.Operator.STOP, (wire.FAULT,))
                self._order(wire.Operator.RESET, (wire.DISARMED,))

    def _order(self, action: "wire.Operator.Action", until: tuple[int, ...]) -> None:
        """Send an operator's command by another session, while the blocks are answered; wait for one of the states."""
        done = threading.Event()

        def send() -> None:
            with contextlib.suppress(Fault), Bus(self._bus, "operator", self._lockstep) as link:
                put, who = link.publisher(OPERATOR), uuid.uuid4().hex
                while not done.wait(_AGAIN_S):
                    put(wire.Operator(action=action, who=who).SerializeToString())

        sender = threading.Thread(target=send, daemon=True, name="operator")
        sender.start()
        until_s = time.monotonic() + _ORDER_S
        frequency_Hz, amplitude_m = self._newest
        try:
            while self._state not in until and time.monotonic() < until_s:
                self._collect("order", 0.02, frequency_Hz, amplitude_m)
        finally:
            done.set()
            sender.join(_ORDER_S)

    def _arm(self) -> None:
        self._order(wire.Operator.ARM, (*_MAY_VIBRATE, wire.READY))
        if self._state == wire.READY:
            self._order(wire.Operator.ACCEPT_GAIN, _MAY_VIBRATE)
        if self._state not in _MAY_VIBRATE:
            raise Ended

    def _collect(self, name: str, for_s: float, frequency_Hz: float, amplitude_m: float | None) -> None:
        """Answer the blocks of a time by a command; None: by no command."""
        stage: Stage = []
        self.session.stages.setdefault(name, []).append(stage)
        for _ in range(max(round(for_s / self.session.facts.block_s), 4)):
            try:
                received = self._blocks.get(timeout=_PATIENCE_S)
                block = parsed(wire.SensorBlock, received.payload, SENSORS.name)
            except (queue.Empty, Fault):
                self.session.failures.setdefault("read", f"no block within {_PATIENCE_S:g} s")
                raise Ended from None
            self._run, self._state = block.run, block.guard_state
            if amplitude_m is not None:
                self._newest = frequency_Hz, amplitude_m
                command = wire.Command(
                    sequence=self._sent, t_ns=block.t_ns, block=block.sequence, frequency_Hz=frequency_Hz,
                    amplitude_m=amplitude_m, mode=wire.EXCITE if amplitude_m else wire.WATCH, run=block.run,
                )  # fmt: skip
                self._send(command.SerializeToString())
                self._sent += 1
            self._keep(stage, block, received.arrival_ns * 1e-9)
        cause = self._report(stage)
        if self._state == wire.FAULT and name not in _STOPPED:
            self.session.failures["write"] = f"the guard tripped: {word_of('cause', cause)}"
            raise Ended

    def _keep(self, stage: Stage, block: wire.SensorBlock, at_s: float) -> None:
        session, samples = self.session, self.session.facts.samples
        rows = [np.array(getattr(block, name), np.float64) for name in CHANNELS]
        for name, row in zip(CHANNELS, rows, strict=True):
            if len(row) != samples:
                session.bad_block = f"{len(row)} samples of {name}: must be {samples}"
                raise Ended
        if self._last >= 0 and block.sequence != self._last + 1:
            session.lost += 1
            session.problems.append(f"block {block.sequence} after block {self._last}")
        due_ns = (block.sequence + 1) * session.facts.block_s * 1e9
        if abs(block.t_ns - due_ns) > 0.01 * session.facts.block_s * 1e9:
            session.bad_count = f"t_ns = {block.t_ns} of block {block.sequence}: must be {due_ns:.0f}"
        self._last = block.sequence
        stage.append(Block(block.sequence, at_s, np.array(rows), math.nan, math.nan))

    def _report(self, stage: Stage) -> int:
        """Fill in the applied vibration of each block, which follows it; return the cause of the guard's state."""
        cause = int(wire.NO_CAUSE)
        until_s = time.monotonic() + _HEADER_S
        while stage and stage[-1].number not in self._applied and time.monotonic() < until_s:
            time.sleep(1e-3)
        for at, block in enumerate(stage):
            applied = self._applied.pop(block.number, None)
            if applied is not None:
                cause = applied.cause
                stage[at] = block._replace(frequency_Hz=applied.frequency_Hz, amplitude_m=applied.amplitude_m)
        for number in [number for number in list(self._applied) if number < self._last]:
            self._applied.pop(number, None)  # of blocks that were lost
        return cause


def _facts(header: wire.Header | None, lockstep: bool) -> tuple[Facts, str]:
    """The facts in a header, and its problem."""
    table: Any = {}
    problem = "no header" if header is None else ""
    if header is not None and header.schema_version not in (1, 2, 3):
        problem = f"schema_version = {header.schema_version}"
    try:
        table = json.loads(header.configuration) if header is not None else {}
        rig = table["rig"]
        block_s, samples = float(rig["solver"]["block_s"]), int(rig["solver"]["samples_per_block"])
        limits = _LIMITS.validate_python(table["limits"]) if "limits" in table else _DEFAULT_LIMITS
    except (ValueError, KeyError, TypeError, ValidationError) as error:
        problem = problem or f"configuration: {type(error).__name__}: {error}".splitlines()[0]
        rig, block_s, samples, limits = {}, 1e-3, 20, _DEFAULT_LIMITS
    guard, channels = rig.get("guard") or {}, rig.get("channels") or {}
    timeout_s = float((rig.get("exciter") or rig.get("piezo") or {}).get("command_timeout_s", _TIMEOUT_S))
    away = frozenset(name for name in CHANNELS if (channels.get(name) or {}).get("absent") is True)
    facts = Facts(
        samples / block_s, samples, limits, float(guard.get("check_share", 0.1)), float(guard.get("exciter_gain", 1.0)),
        float(guard.get("fastest_drive_mps") or math.inf), away, dict.fromkeys(CHANNELS, (None, None)),
        1 if lockstep else 2, watchdog_s=timeout_s,
    )  # fmt: skip
    return facts, problem
