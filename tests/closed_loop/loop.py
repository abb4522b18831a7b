"""The controller on the rig, both in this process: the loop, sample by sample."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from bridge.config import validate
from bridge.wire.messages import TRACE as TRACE_LAYOUT
from bridge.wire.messages import sealed
from bridge.wire.topics import TRACE
from cockpit.run.closed_loop import ClosedLoop
from controller.config import ControllerConfig
from controller.node import ControllerNode
from plant.config import RigConfig
from plant.records import TRUTH
from plant.rig.node import PlantNode


class Loop(NamedTuple):
    """Arrays of [blocks]."""

    t_s: Any
    trace: Any
    drive_force_N: Any  # the true one, at the end of each block
    velocity_mps: Any  # of the slide, true: the fastest of each block, backwards below 0

    def modes(self) -> list[int]:
        """The modes in the order in which they came."""
        mode = self.trace["mode"].astype(int)
        return [int(mode[0]), *mode[1:][np.diff(mode) != 0].tolist()]

    def slips(self, from_s: float, to_s: float = 1e9, fast_mps: float = 0.01) -> int:
        """Slips as the slide's own speed shows them: it passes 10 mm/s (a slip of the paper's rig reaches 22)."""
        fast = (np.abs(self.velocity_mps) > fast_mps) & (self.t_s >= from_s) & (self.t_s < to_s)
        return int(np.count_nonzero(fast[1:] & ~fast[:-1]))

    def ratio(self, from_s: float, to_s: float = 1e9) -> Any:
        """v_a / v_d as measured."""
        inside = (self.t_s >= from_s) & (self.t_s < to_s)
        return self.trace["vibration_velocity_mps"][inside] / np.abs(self.trace["drive_velocity_mps"][inside])

    def held(self, from_s: float, to_s: float = 1e9) -> Any:
        """Measured over wanted v_a, where a vibration is wanted."""
        inside = (self.t_s >= from_s) & (self.t_s < to_s) & (self.trace["wanted_velocity_mps"] > 0.0)
        return self.trace["vibration_velocity_mps"][inside] / self.trace["wanted_velocity_mps"][inside]

    def reasons(self, from_s: float, to_s: float = 1e9) -> set[int]:
        """The reasons that were given."""
        return set(self.trace["reason"][(self.t_s >= from_s) & (self.t_s < to_s)].tolist())

    def excited(self, from_s: float, to_s: float = 1e9) -> float:
        """Share of the time in which a vibration was wanted."""
        return float((self.trace["wanted_velocity_mps"][(self.t_s >= from_s) & (self.t_s < to_s)] > 0.0).mean())

    def longest_s(self, is_so: Any) -> float:
        """Longest time for which something is so, of [blocks]."""
        edges = np.flatnonzero(np.diff(np.concatenate(([0], np.asarray(is_so, int), [0]))))
        return float((edges[1::2] - edges[::2]).max(initial=0) * np.diff(self.t_s[:2])[0])


def close_the_loop(
    seconds: float,
    rig: dict[str, Any] | None = None,
    controller: dict[str, Any] | None = None,
    pair: str = "C45-C45 @ 0.063",
    seed: int = 1,
    deliver: Callable[[int, bytes], bytes | None] | None = None,
) -> Loop:
    """Run the loop in lockstep for `seconds`; `deliver` returns each block as it arrives, None for a lost one.

    Without `deliver` a block takes 20 µs of compiled code, with it 150 µs; both make the same bits.
    """
    rig_config = validate(RigConfig, {"contact": {"pair": pair}} | (rig or {}), "rig")
    config = validate(ControllerConfig, controller or {}, "controller")
    blocks = round(seconds / rig_config.solver.block_s)
    if deliver is not None:
        return _block_by_block(blocks, rig_config, config, seed, deliver)
    stretch = ClosedLoop(rig_config, seed, config, arm=True).advance(blocks)
    force_N, velocity_mps = (
        stretch.truth[:, TRUTH.index(name)] for name in ("true_drive_force_N", "true_velocity_mps")
    )
    return _looped(stretch.trace, force_N, velocity_mps)


def _looped(trace: Any, drive_force_N: Any, velocity_mps: Any) -> Loop:
    """Of traces and of the truth, [blocks, samples]."""
    fastest = np.abs(velocity_mps).argmax(axis=1)[:, None]
    fastest_mps = np.take_along_axis(velocity_mps, fastest, axis=1)[:, 0]
    return Loop(trace["t_ns"] * 1e-9, trace, drive_force_N[:, -1], fastest_mps)


def _block_by_block(
    blocks: int, rig: RigConfig, config: ControllerConfig, seed: int, deliver: Callable[[int, bytes], bytes | None]
) -> Loop:
    plant, node = PlantNode(rig, seed, arm=True), ControllerNode(config)
    traces: list[bytes] = []
    truth: list[Any] = []
    commands: list[bytes] = []
    for block in range(blocks):
        sensors, _ = plant.advance(commands)
        for message in plant.announcements:
            node.announcement(message.payload)
        payload = deliver(block, sensors.payload)
        if payload is None:
            commands = []
            continue
        command = node.block(sealed(payload))
        assert command is not None
        commands = [command.payload]
        traces.extend(message.payload for message in node.rest(0) if message.topic is TRACE)
        truth.append(plant.truth[[0, 2]])
    trace = np.frombuffer(b"".join(traces), TRACE_LAYOUT.dtype)
    return _looped(trace, *np.stack(truth, axis=1))
