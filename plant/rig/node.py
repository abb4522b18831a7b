"""The simulated rig as a participant of the bus: the guard and the physics in one compiled step."""

import math
from collections.abc import Sequence

import numpy as np

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.guard.core import NO_COMMAND
from bridge.guard.states import LEAVE, apply_order
from bridge.rig.faults.schedule import Faults
from bridge.rig.faults.table import FaultTable
from bridge.rig.node import GuardedNode, Served
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.messages import sensor_block
from bridge.wire.topics import ANNOUNCE, Outgoing
from plant.config import RigConfig
from plant.inputs import RigInputs
from plant.piezo import base_velocity_mps
from plant.records import TRUTH, build, guard_records, notes, set_load
from plant.rig.exciter_faults import ExciterFaults
from plant.step import act, report

_VELOCITY = TRUTH.index("true_velocity_mps")
_BATCH_BLOCKS = 64  # noise and drive velocity are drawn for this many blocks at once; fewer take more time per block


class PlantNode(GuardedNode):
    """The rig, advanced block by block.

    Args:
        config: the rig file.
        seed: seed of the sensor noise; the same seed gives the same bytes.
        run: the number that each command must carry.
        arm: start ARMED, as only a simulated rig may.
        faults: injected into the rig.

    """

    kernels = "the plant"

    def __init__(
        self, config: RigConfig, seed: int, run: int = 1, arm: bool = False, faults: Sequence[FaultTable] = ()
    ) -> None:
        self._config = config
        self._params, self._state = build(config)
        self._inputs = RigInputs(config, seed)
        solver = config.solver
        injected = Faults(faults, seed, solver.block_s, solver.samples_per_block, ExciterFaults(self._params[0]).set)
        super().__init__(
            guard_records(config, run, arm), round(solver.block_s * 1e9), solver.samples_per_block, injected
        )
        self._analogue = np.zeros((len(CHANNELS), self._samples))
        self.truth = np.empty(
            (len(TRUTH), self._samples)
        )  # true quantities in the last block, rows as plant.records.TRUTH
        self._drawn = self._inputs.draw(0)
        self._announced = 0  # number of the drawn announcements already sent

    def _step_copies(self) -> None:
        guard = self._guard_state.copy()
        apply_order(guard[0], LEAVE)
        state, sensors, noise = self._state.copy(), sensor_block(self._samples).blank(), self._analogue.copy()
        act(
            self._params, state, self._guard_params, guard, 0.0, COMMAND_LAYOUT.blank(0), 0, self._drawn.announce,
            noise, self._analogue, self.truth, sensors,
        )  # fmt: skip
        report(state, self._guard_params, guard, 0, 0, 0, 0, sensors, APPLIED_LAYOUT.blank())

    def _act(self, commands: Records) -> int:
        at = self.block % _BATCH_BLOCKS
        if at == 0:
            self._drawn = self._inputs.draw(_BATCH_BLOCKS)
            self._announced = 0
        velocity_mps, noise, delay_blocks, announcements, announce = self._drawn
        first, self._announced = self._announced, self._announced + int(announcements[at])
        self.announcements = [
            Outgoing(ANNOUNCE, announce[row : row + 1].tobytes()) for row in range(first, self._announced)
        ]
        return act(
            self._params, self._state, self._guard_params, self._guard_state, velocity_mps[at], commands,
            int(delay_blocks[at]), announce[first : self._announced], noise[at], self._analogue, self.truth, self._sensors,
        )  # fmt: skip

    def _report(self, accepted: int, commands_late: int, round_trip_ns: int, late_ns: int) -> None:
        report(
            self._state, self._guard_params, self._guard_state, accepted, commands_late, round_trip_ns, late_ns,
            self._sensors, self._applied,
        )  # fmt: skip
        if not math.isfinite(self.truth[_VELOCITY, -1]):  # NaN anywhere in the state reaches the velocity within a step
            raise no_number(self._config, self.block - 1)

    def set_load(self, ratio: float) -> None:
        """Set the normal load, in multiples of the configured one, from the next block on."""
        set_load(self._params, self._config, ratio)

    def let_go(self) -> None:
        """Drop all commands in force or delayed and enter DISARMED: the vibration fades to zero at the exciter's rate."""
        self._state["command_block"] = NO_COMMAND
        self._state["line_count"] = 0
        self.apply_order(LEAVE)

    @property
    def vibration_mps(self) -> float:
        """The true velocity amplitude v_a of the base at the end of the last block [m/s]."""
        return base_velocity_mps(self._params[0], self._state[0])

    @property
    def at_rest(self) -> bool:
        """Whether the base is at rest."""
        return self._state["amplitude_m"][0] == 0.0

    def close(self) -> None:
        """A simulated rig has no connection to end."""


def served(config: RigConfig, seed: int, arm: bool, faults: Sequence[FaultTable] = ()) -> Served:
    """The simulated rig for `bridge.rig.process.serve`; it starts ARMED if `arm` and no stop is kept."""

    def make(run: int, may_arm: bool) -> PlantNode:
        return PlantNode(config, seed, run, arm and may_arm, faults)

    return Served(config.name, config.guard, notes(config), make)


def no_number(config: RigConfig, block: int) -> Fault:
    """The fault of a rig whose state became NaN or infinite in a block."""
    solver = config.solver
    line = (
        f"{config.name}: the slide's velocity is not finite at {(block + 1) * solver.block_s:.3f} s: this rig cannot be stepped "
        f"with solver.step_s = {solver.step_s:g}; shorten it, or weaken extreme values"
    )
    return Fault("CONFIG", line)
