"""A rig written from bridge/wire/PROTOCOL.md alone: nothing of the project but its message schema is imported.

A light slider on a spring with LuGre friction, integrated by plain small steps, in lockstep over Zenoh. It writes its
messages with the protobuf library's own serialisation, which leaves zeros out. At the end it prints its observations as JSON.
"""

import json
import math
import queue
import sys
import threading
import time
from importlib.metadata import version

import numpy as np
import zenoh

from bridge.wire import stickslip_pb2 as wire

BLOCK_S = 1e-3
SAMPLES = 20
STEPS_PER_SAMPLE = 5  # of 10 us: k_t |v_r| dt / g stays below 1 in the middle of a slip
DT_S = BLOCK_S / (SAMPLES * STEPS_PER_SAMPLE)
NO_BLOCK = 2**64 - 1

DRIVE_VELOCITY_MPS = 5e-4
DRIVE_STIFFNESS_N_PER_M = 11700.0
MASS_KG = 0.5
# a quarter of the paper's forces: it slips four times as often, so the run can be short
COULOMB_N = 3.2
STATIC_N = 4.0
STRIBECK_MPS = 5e-4
CONTACT_STIFFNESS_N_PER_M = 2e7  # contact resonance at 1 kHz, as on the paper's rig
CONTACT_DAMPING_NS_PER_M = 2.0 * math.sqrt(CONTACT_STIFFNESS_N_PER_M * MASS_KG)
SLEW_M_PER_S = 1e-6
STROKE_M = 1e-7
FORCE_NOISE_N = 0.02
POSITION_NOISE_M = 5e-7
SLIP_MPS = 5.0 * DRIVE_VELOCITY_MPS
SETTLING_S = 0.5

PEER_TIMEOUT_S = 30.0
ANSWER_TIMEOUT_S = 5.0
GOODBYE_S = 3.0


class Slider:
    """The physics: `advance` makes one block."""

    def __init__(self) -> None:
        self.slips_s: list[float] = []
        self.amplitude_m = 0.0
        self._x = self._v = self._z = self._drive_m = self._phase = self._time_s = 0.0
        self._slipping = False
        self._random = np.random.default_rng(1)

    def advance(self, frequency_Hz: float, target_m: float) -> dict[str, list[float]]:
        """One block under a command: the signals by name."""
        target_m = min(max(target_m, 0.0), STROKE_M)
        omega = 2.0 * math.pi * frequency_Hz
        rows: list[tuple[float, float, float, float, float]] = []
        x, v, z, drive_m, phase, u0 = self._x, self._v, self._z, self._drive_m, self._phase, self.amplitude_m
        friction_N = accel = 0.0
        for _ in range(SAMPLES):
            for _ in range(STEPS_PER_SAMPLE):
                u0 += min(max(target_m - u0, -SLEW_M_PER_S * DT_S), SLEW_M_PER_S * DT_S)
                phase += omega * DT_S
                v_r = v - u0 * omega * math.cos(phase)
                g = COULOMB_N + (STATIC_N - COULOMB_N) * math.exp(-((v_r / STRIBECK_MPS) ** 2))
                z_rate = v_r - CONTACT_STIFFNESS_N_PER_M * abs(v_r) * z / g
                friction_N = CONTACT_STIFFNESS_N_PER_M * z + CONTACT_DAMPING_NS_PER_M * z_rate
                accel = (DRIVE_STIFFNESS_N_PER_M * (drive_m - x) - friction_N) / MASS_KG
                z += DT_S * z_rate
                v += DT_S * accel
                x += DT_S * v
                drive_m += DT_S * DRIVE_VELOCITY_MPS
            base_accel = -u0 * omega * omega * math.sin(phase)
            rows.append((DRIVE_STIFFNESS_N_PER_M * (drive_m - x), accel, base_accel, x, drive_m))
        self._x, self._v, self._z, self._drive_m, self.amplitude_m = x, v, z, drive_m, u0
        self._phase = phase % (2.0 * math.pi)
        self._time_s += BLOCK_S
        if v > SLIP_MPS and not self._slipping:
            self.slips_s.append(self._time_s)
        self._slipping = v > (0.5 * SLIP_MPS if self._slipping else SLIP_MPS)
        return self._measured(np.array(rows).T)

    def _measured(self, signals: np.ndarray) -> dict[str, list[float]]:
        for row, noise in ((0, FORCE_NOISE_N), (3, POSITION_NOISE_M), (4, POSITION_NOISE_M)):
            signals[row] += noise * self._random.standard_normal(SAMPLES)
        names = ("drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m")
        return dict(zip(names, signals.tolist(), strict=True))


class Rig:
    """The place on the bus of the role `plant`."""

    def __init__(self, endpoint: str, prefix: str) -> None:
        self._prefix = prefix
        self._alive: set[str] = set()
        self._changed = threading.Condition()
        self._commands: queue.Queue[bytes] = queue.Queue()
        self._events = 0
        config = zenoh.Config()
        for key, value in (
            ("mode", "peer"),
            ("listen/endpoints", [endpoint]),
            ("scouting/multicast/enabled", False),
            ("scouting/gossip/enabled", False),
            ("transport/link/tx/lease", 10_000),
            ("transport/link/tx/keep_alive", 4),
        ):
            config.insert_json5(key, json.dumps(value))
        self.session = zenoh.open(config)
        self._keep = [
            self.session.liveliness().declare_subscriber(self._key("alive/*"), self._on_alive, history=True),
            self.session.declare_subscriber(self._key("command"), self._on_command),
            self.session.declare_queryable(self._key("header/plant"), self._on_header),
        ]
        self.send_sensors = self._publisher("sensors")
        self.send_applied = self._publisher("applied")
        self._send_event = self._publisher("event/plant")
        self._token = self.session.liveliness().declare_token(self._key("alive/plant"))

    def _key(self, name: str) -> str:
        return f"{self._prefix}/{name}"

    def _publisher(self, name: str) -> zenoh.Publisher:
        return self.session.declare_publisher(self._key(name), congestion_control=zenoh.CongestionControl.BLOCK)

    def _on_alive(self, sample: zenoh.Sample) -> None:
        role = str(sample.key_expr).rsplit("/", 1)[-1]
        with self._changed:
            (self._alive.add if sample.kind == zenoh.SampleKind.PUT else self._alive.discard)(role)
            self._changed.notify_all()

    def _on_command(self, sample: zenoh.Sample) -> None:
        self._commands.put(sample.payload.to_bytes())

    def _on_header(self, query: zenoh.Query) -> None:
        header = wire.Header(
            role="plant",
            schema_version=1,
            configuration=json.dumps({"rig": {"solver": {"block_s": BLOCK_S, "samples_per_block": SAMPLES}}}),
            versions=json.dumps({"eclipse-zenoh": version("eclipse-zenoh")}),
        )
        with query:
            query.reply(self._key("header/plant"), header.SerializeToString())

    def wait_for(self, roles: set[str]) -> None:
        """Until all `roles` have announced themselves."""
        with self._changed:
            if not self._changed.wait_for(lambda: roles <= self._alive, PEER_TIMEOUT_S):
                sys.exit(f"not on the bus: {roles - self._alive}")

    def event(self, code: str, text: str, t_ns: int) -> None:
        """Publish an event."""
        event = wire.Event(sequence=self._events, t_ns=t_ns, source="plant", code=code, text=text)
        self._events += 1
        self._send_event.put(event.SerializeToString())

    def answer(self, block: int) -> wire.Command:
        """The command that answers `block`; any other is passed over."""
        until_s = time.monotonic() + ANSWER_TIMEOUT_S
        while True:
            try:
                payload = self._commands.get(timeout=max(until_s - time.monotonic(), 0.0))
            except queue.Empty:
                sys.exit(f"block {block}: no answer")
            command = wire.Command.FromString(payload)
            if command.block == block:
                return command

    def goodbye(self) -> None:
        """Leave as a rig, and wait until the others have left, since this session relays them."""
        self._token.undeclare()
        with self._changed:
            self._changed.wait_for(lambda: self._alive <= {"plant"}, GOODBYE_S)


def run(rig: Rig, blocks: int) -> dict[str, object]:
    """Run `blocks` blocks in lockstep; returns the observations."""
    slider = Slider()
    rig.wait_for({"controller", "recorder"})
    rig.event("START", "lockstep", 0)
    command = wire.Command(block=NO_BLOCK)
    commands = 0
    vibrates_from_s: float | None = None
    for block in range(blocks):
        t_ns = round((block + 1) * BLOCK_S * 1e9)
        signals = slider.advance(command.frequency_Hz, command.amplitude_m)
        rig.send_sensors.put(wire.SensorBlock(sequence=block, t_ns=t_ns, **signals).SerializeToString())
        applied = wire.Applied(
            sequence=block,
            t_ns=t_ns,
            frequency_Hz=command.frequency_Hz,
            amplitude_m=slider.amplitude_m,
            command_block=command.block,
            commands=min(block, 1),
            fallback=int(block == 0),
        )
        rig.send_applied.put(applied.SerializeToString())
        command = rig.answer(block)
        commands += 1
        if vibrates_from_s is None and command.amplitude_m > 0.0:
            vibrates_from_s = t_ns * 1e-9
    rig.event("END", f"blocks={blocks}", round(blocks * BLOCK_S * 1e9))
    rig.goodbye()
    before_s = math.inf if vibrates_from_s is None else vibrates_from_s
    return {
        "blocks": blocks,
        "commands": commands,
        "vibrates_from_s": vibrates_from_s,
        "slips_before": sum(slip_s < before_s for slip_s in slider.slips_s),
        "slips_after": sum(slip_s > before_s + SETTLING_S for slip_s in slider.slips_s),
        "slips_s": slider.slips_s,
        "velocity_ratio": 2.0 * math.pi * command.frequency_Hz * slider.amplitude_m / DRIVE_VELOCITY_MPS,
    }


def main(endpoint: str, blocks: int) -> None:
    rig = Rig(endpoint, "rig")
    try:
        summary = run(rig, blocks)
    finally:
        rig.session.close()  # an open session would keep a failed process alive
    print(json.dumps(summary))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
