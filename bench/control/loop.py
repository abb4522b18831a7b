"""A rig with the controller or a rival, many blocks in one call of compiled code, with the truth of all of them."""

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from bench.control.rules import step as rule_step
from bridge.arrays import Floats, Records
from bridge.guard.config import Level
from bridge.kernel import kernel
from cockpit.run.closed_loop import ClosedLoop, Pair, Stretch, advancing
from controller.config import ControllerConfig
from plant.config import RigConfig
from plant.inputs import Inputs
from plant.simulate import held_velocity


@kernel
def _rule_answer(
    subject: tuple[Records, Records, Floats], i: int, _announce: Records, _events: int, made: Stretch
) -> None:
    rule_step(
        subject[0], subject[1], made.sensors[i : i + 1], made.sensors[i].t_ns, subject[2][i], made.gain[i],
        made.command[i : i + 1], made.trace[i : i + 1],
    )  # fmt: skip


_advance_by_rule = advancing(_rule_answer)


class Hum(NamedTuple):
    """A sine on the force and on both positions, as from the mains or a carrier."""

    frequency_Hz: float
    force_N: float
    position_m: float


class JudgedLoop(ClosedLoop):
    """A rig and its controller or a rule, in lockstep.

    Args:
        rig: the rig file.
        seed: seed of the sensor noise.
        subject: configuration of the controller, or parameters and memory of a rule.
        hum: sine on the sensors; force and position need noise above 0 where it is not 0.
        sees_blocks: a rule that knows the truth vibrates for the largest |v_d| from first to last, in blocks from now.

    """

    def __init__(
        self, rig: RigConfig, seed: int, subject: ControllerConfig | Pair, hum: Hum, sees_blocks: tuple[int, int]
    ) -> None:
        self._rule = None if isinstance(subject, ControllerConfig) else subject
        if self._rule is not None:  # the guard must not end the vibration of a rival
            free = Level(alarm=1e12, abort=1e12)
            guard = rig.guard.model_copy(update={"loud_ratio": free, "velocity_mps": free})
            rig = rig.model_copy(update={"guard": guard})
        config = subject if isinstance(subject, ControllerConfig) else ControllerConfig()
        super().__init__(rig, seed, config, arm=True)
        self._hum, self._sees_blocks, self._velocity_mps = hum, sees_blocks, held_velocity(rig)

    def advance(self, blocks: int, operator_events: int = 0) -> Stretch:
        """Advance by `blocks`; fewer are returned if the rig's state became NaN or infinite."""
        if self._rule is None:
            return super().advance(blocks, operator_events)
        return self._advance(_advance_by_rule, (*self._rule, self._known_mps(blocks)), self._draw(blocks))

    def _draw(self, blocks: int) -> Inputs:
        inputs = super()._draw(blocks)
        noise, hum, sensors = inputs.noise, self._hum, self._rig.sensors
        block_s, samples = self._rig.solver.block_s, self._rig.solver.samples_per_block
        t_s = (self.block + (np.arange(blocks * samples) + 1.0).reshape(blocks, samples) / samples) * block_s
        wave = np.sin(2.0 * np.pi * hum.frequency_Hz * t_s)
        if hum.force_N:
            noise[:, 0] += hum.force_N / sensors.force_noise_N * wave
        if hum.position_m:
            noise[:, 3:] += (hum.position_m / sensors.position_noise_m * wave)[:, None]
        return inputs

    def _known_mps(self, blocks: int) -> Floats:
        """Largest |v_d| in `sees_blocks` of each block, for the rules that know the truth [m/s], [blocks]."""
        first, last = self._sees_blocks
        velocity_mps = self._velocity_mps((self.block + np.arange(blocks + last)) * self._rig.solver.block_s)
        return sliding_window_view(np.abs(velocity_mps[first:]), last - first + 1).max(axis=1)
