"""Faults of the sensors, applied to the blocks between rig and controller, and the true vibration during them."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from bridge.config import validate
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import TRACE as TRACE_LAYOUT
from bridge.wire.messages import sealed, sensor_block
from bridge.wire.topics import TRACE
from controller.config import ControllerConfig
from controller.node import ControllerNode
from plant.config import RigConfig
from plant.piezo import base_velocity_mps
from plant.rig.node import PlantNode

Fault = Callable[[Any, int, "Memory"], None]  # the block's record [1], blocks since the fault began, its memory
CHANNELS = ("drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m")


class Memory:
    """Memory of a fault: its first block, and its random generator."""

    def __init__(self) -> None:
        self.first: Any = None
        self.chance = np.random.default_rng(5)


def scaled(channel: str, factor: float) -> Fault:
    """A channel of another gain."""

    def fault(block: Any, _at: int, _memory: Memory) -> None:
        block[channel] *= factor

    return fault


def drifting(channel: str, per_s: float) -> Fault:
    """A channel whose gain falls by a share a second, down to a tenth; blocks of 1 ms."""

    def fault(block: Any, at: int, _memory: Memory) -> None:
        block[channel] *= max(1.0 - per_s * 1e-3 * at, 0.1)

    return fault


def frozen(*channels: str) -> Fault:
    """Channels that repeat the block at which they froze."""

    def fault(block: Any, _at: int, memory: Memory) -> None:
        for channel in channels:
            block[channel] = memory.first[channel]

    return fault


def clipped(channel: str, at: float) -> Fault:
    """A channel that shows no more than a value."""

    def fault(block: Any, _at: int, _memory: Memory) -> None:
        block[channel] = np.clip(block[channel], -at, at)

    return fault


def dead(channel: str) -> Fault:
    """A channel of zeros."""
    return scaled(channel, 0.0)


def swapped(one: str, other: str) -> Fault:
    """Two channels on each other's wires."""

    def fault(block: Any, _at: int, _memory: Memory) -> None:
        kept = block[one].copy()
        block[one] = block[other]
        block[other] = kept

    return fault


def jumped(channel: str, by: float, until: int = 1 << 60) -> Fault:
    """A channel that is off by a constant, for some blocks."""

    def fault(block: Any, at: int, _memory: Memory) -> None:
        if at < until:
            block[channel] += by

    return fault


def noisy(channel: str, rms: float) -> Fault:
    """A channel with noise."""

    def fault(block: Any, _at: int, memory: Memory) -> None:
        block[channel] += memory.chance.normal(0.0, rms, block[channel].shape)

    return fault


def set_to(channel: str, value: float) -> Fault:
    """A channel that shows one value."""

    def fault(block: Any, _at: int, _memory: Memory) -> None:
        block[channel] = value

    return fault


def garbage(times: float) -> Fault:
    """Every channel with many times the noise of the paper's rig."""
    rms = dict(zip(CHANNELS, (0.02, 0.0015, 0.0015, 5e-7, 5e-7), strict=True))

    def fault(block: Any, _at: int, memory: Memory) -> None:
        for channel in CHANNELS:
            block[channel] += memory.chance.normal(0.0, times * rms[channel], block[channel].shape)

    return fault


class Outcome(NamedTuple):
    """Result of a fault."""

    over_s: float  # true v_a above 1.5 times the set point of 1.2 v_d
    peak: float  # true v_a over that set point
    at_end: float  # the same, mean of the last second
    slips: int  # of the slide, in truth
    reasons: dict[str, float]  # that were given after the fault, and their first time after it [s]
    limits: set[str]
    guard: str  # state of the rig at the end
    trace: Any


def suffer(
    fault: Fault,
    seconds: float = 12.0,
    from_s: float = 2.0,
    speed_mps: float = 5e-4,
    rig: dict[str, Any] | None = None,
    controller: dict[str, Any] | None = None,
    fast_mps: float = 0.01,
    mend_s: float = 1e9,
    operator: dict[int, int] | None = None,
) -> Outcome:
    """Run a rig whose blocks reach the controller with a fault from `from_s` to `mend_s`.

    Args:
        operator: commands to the controller, by the number of the block.

    """
    settings = rig or {"contact": {"pair": "C45-C45 @ 0.063"}, "drive": {"profile": [(0.0, speed_mps)]}}
    rig_config = validate(RigConfig, settings, "rig")
    plant = PlantNode(rig_config, 1, arm=True)
    node = ControllerNode(validate(ControllerConfig, controller or {}, "controller"))
    block_s = rig_config.solver.block_s
    layout = sensor_block(rig_config.solver.samples_per_block)
    memory = Memory()
    first = round(from_s / block_s)
    commands: list[bytes] = []
    traces: list[bytes] = []
    v_a_mps: list[float] = []
    slide_mps: list[float] = []
    for number in range(round(seconds / block_s)):
        sensors, _ = plant.advance(commands)
        for message in plant.announcements:
            node.announcement(message.payload)
        payload = sensors.payload
        if number >= first and number * block_s < mend_s:
            block = layout.read(payload, "sensors")
            if memory.first is None:
                memory.first = block.copy()
            fault(block, number - first, memory)
            payload = sealed(block.tobytes())
        if operator and number in operator:
            node.operator(operator[number])
        command = node.block(payload)
        assert command is not None
        commands = [command.payload]
        traces.extend(message.payload for message in node.rest(0) if message.topic is TRACE)
        p, s = plant._params[0], plant._state[0]  # pyright: ignore[reportPrivateUsage]
        v_a_mps.append(float(base_velocity_mps(p, s)))
        slide_mps.append(float(np.abs(plant.truth[2]).max()))
    trace = np.frombuffer(b"".join(traces), TRACE_LAYOUT.dtype)
    return _judged(trace, np.array(v_a_mps), np.array(slide_mps), first, block_s, speed_mps, fast_mps, plant)


def _judged(
    trace: Any, v_a_mps: Any, slide_mps: Any, first: int, block_s: float, speed_mps: float, fast_mps: float, plant: Any
) -> Outcome:
    share = v_a_mps[first:] / (1.2 * speed_mps)
    fast = slide_mps[first:] > fast_mps
    reasons: dict[str, float] = {}
    for at, reason in enumerate(trace["reason"][first:]):
        reasons.setdefault(wire.Reason.Name(int(reason)), round((at + 1) * block_s, 4))
    return Outcome(
        over_s=float((share > 1.5).sum() * block_s),
        peak=float(share.max()),
        at_end=float(share[-round(1.0 / block_s) :].mean()),
        slips=int(np.count_nonzero(fast[1:] & ~fast[:-1])),
        reasons=reasons,
        limits={wire.Limit.Name(int(limit)) for limit in set(trace["limit"][first:].tolist())},
        guard=wire.GuardState.Name(int(plant.applied["guard_state"])),
        trace=trace,
    )
