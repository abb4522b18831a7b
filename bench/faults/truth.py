"""A run in simulated time with the true motion of its rig, block by block."""

import contextlib
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.inbox import Received
from bridge.wire.payloads import parsed
from bridge.wire.topics import Outgoing
from cockpit.expect.events import word_of
from cockpit.run.scenario import Scenario
from cockpit.run.simulated.run import SimulatedRun
from plant.records import TRUTH
from plant.rig.node import PlantNode

_POSITION, _VELOCITY = TRUTH.index("true_drive_position_m"), TRUTH.index("true_velocity_mps")


class Truth(NamedTuple):
    """True motion of the rig, [blocks] each."""

    t_s: npt.NDArray[np.float64]  # simulated time at the end of each block
    amplitude_m: npt.NDArray[np.float64]  # of the base
    vibration_mps: npt.NDArray[np.float64]  # v_a of the base
    drive_mps: npt.NDArray[np.float64]  # v_d, mean of the block
    slide_mps: npt.NDArray[np.float64]  # slide velocity of largest magnitude in the block, negative backwards


class _TruthNode(PlantNode):
    """A rig that appends the truth of each block to a list."""

    def __init__(
        self,
        truths: list[tuple[float, ...]],
        now_ns: Callable[[], int],
        observe: Callable[[PlantNode], None],
        **rest: Any,
    ) -> None:
        PlantNode.__init__(self, **rest)
        self._truths, self._now_ns, self._observe = truths, now_ns, observe
        self._drive_m = 0.0

    def advance(
        self, commands: list[bytes], commands_late: int = 0, round_trip_ns: int = 0, late_ns: int = 0
    ) -> tuple[Outgoing, ...]:
        """Advance one block."""
        sent = PlantNode.advance(self, commands, commands_late, round_trip_ns, late_ns)
        drive_m, speeds = float(self.truth[_POSITION, -1]), self.truth[_VELOCITY]
        drive_mps = (drive_m - self._drive_m) / (self.block_ns * 1e-9)
        self._drive_m = drive_m
        fastest_mps = float(speeds[np.abs(speeds).argmax()])
        rad_per_s = 2.0 * math.pi * max(float(self.applied["frequency_Hz"]), 1.0)  # at rest it is 0
        v_a_mps = self.vibration_mps
        self._truths.append((self._now_ns() * 1e-9, v_a_mps / rad_per_s, v_a_mps, drive_mps, fastest_mps))
        self._observe(self)
        return sent


class TruthRun(SimulatedRun):
    """A simulated run, which keeps the truth of its rig."""

    def __init__(self, scenario: Scenario) -> None:
        SimulatedRun.__init__(self, scenario)
        self.scenario = scenario
        self._truths: list[tuple[float, ...]] = []
        self.heard: dict[str, list[float]] = {}  # times of arrival of each word of an event [s]
        self.listen(self._hear)

    def _hear(self, received: Received) -> None:
        if received.topic.message is wire.Event:
            with contextlib.suppress(Fault):  # a fault of the bus corrupts messages
                event = parsed(wire.Event, received.payload, received.topic.name)
                for word in {event.code, word_of(event)}:
                    self.heard.setdefault(word, []).append(received.arrival_ns * 1e-9)

    def plant_node(self, **settings: Any) -> PlantNode:
        """The rig, which appends the truth of each block."""
        return _TruthNode(self._truths, lambda: self._stage.now_ns, self.observe, **settings)

    def observe(self, node: PlantNode) -> None:
        """Look at the rig after each block. A subclass may override this."""

    @property
    def truth(self) -> Truth:
        """The truth of all blocks so far."""
        return Truth(*np.array(self._truths).reshape(-1, 5).T)
