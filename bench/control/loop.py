"""A rig with the controller or a rival, many blocks in one call of compiled code, with the truth of all of them."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from bench.control.rules import step as rule_step
from bridge.guard.config import Level
from bridge.guard.core import accept
from bridge.guard.estimates import expect_drive
from bridge.kernel import unlocked_kernel
from bridge.wire.messages import APPLIED, CHANNELS, COMMAND, TRACE, Records, sensor_block
from controller.announced import take_announcement
from controller.codes import ANNOUNCED, BLOCK
from controller.core import step as controller_step
from plant.config import RigConfig
from plant.inputs import RigInputs
from plant.piezo import base_velocity_mps, delivered_share
from plant.records import TRUTH, guard_records
from plant.records import build as plant_records
from plant.simulate import held_velocity
from plant.step import step as plant_step

_VELOCITY = TRUTH.index("true_velocity_mps")
Pair = tuple[npt.NDArray[Any], npt.NDArray[Any]]  # parameters and memory, one record each


@unlocked_kernel
def advance_with_truth(
    plant_params: npt.NDArray[Any],
    plant_state: npt.NDArray[Any],
    guard_params: npt.NDArray[Any],
    guard_state: npt.NDArray[Any],
    velocity_mps: npt.NDArray[Any],
    noise: npt.NDArray[np.float64],
    by_rule: bool,
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    rule_params: npt.NDArray[Any],
    rule_state: npt.NDArray[Any],
    delay_blocks: npt.NDArray[np.int64],
    announcements: npt.NDArray[np.int64],
    announce: npt.NDArray[Any],
    known_mps: npt.NDArray[np.float64],
    answered: int,
    analogue: npt.NDArray[np.float64],
    sensors: npt.NDArray[Any],
    applied: npt.NDArray[Any],
    commands: npt.NDArray[Any],
    traces: npt.NDArray[Any],
    truth: npt.NDArray[np.float64],
    v_a_mps: npt.NDArray[np.float64],
    frequency_Hz: npt.NDArray[np.float64],
    gain: npt.NDArray[np.float64],
) -> int:
    """Advance a rig and its controller in place; return the number of blocks done.

    Args:
        plant_params, plant_state, guard_params, guard_state, params, state, rule_params, rule_state: one record each.
        velocity_mps: of the drive, [blocks].
        noise: standard normal numbers, [blocks, 5, samples].
        by_rule: whether a rule of `bench.control.rules` replaces the controller.
        delay_blocks: that the command takes to the exciter besides, [blocks].
        announcements, announce: how many the rig makes before it sends its samples, [blocks], and these in order.
        known_mps: speed of the drive that the rules which know the truth vibrate for, [blocks].
        answered: 1 where `commands[0]` answers the block before the first, 0 at the start of a run.
        analogue, sensors, applied: [5, samples] and one record each, overwritten by every block.
        commands: message records [blocks + 1]; the first goes to the rig first, the others are filled.
        truth: filled, [blocks, 6, samples], rows as `plant.records.TRUTH`.
        traces, v_a_mps, frequency_Hz, gain: filled, as `bench.control.watch.watch` takes them.

    Fewer blocks than asked are done where the slide's velocity becomes NaN or infinite.

    """
    samples = analogue.shape[1]
    blocks, announced = noise.shape[0], 0
    for i in range(blocks):
        rows = truth[i]
        came = answered if i == 0 else 1
        if came == 1 and not accept(guard_params[0], guard_state[0], commands[i]):
            came = 0
        first, announced = announced, announced + announcements[i]
        for row in range(first, announced):
            expect_drive(guard_state[0], announce[row].drive_velocity_mps)
        plant_step(
            plant_params, plant_state, guard_params, guard_state, velocity_mps[i], commands[i : i + 1], came,
            delay_blocks[i], noise[i], 0, 0, 0, analogue, rows, sensors, applied,
        )  # fmt: skip
        if not math.isfinite(rows[_VELOCITY, samples - 1]):
            return i
        p, s = plant_params[0], plant_state[0]
        v_a_mps[i] = base_velocity_mps(p, s)
        frequency_Hz[i] = s.frequency_Hz
        gain[i] = delivered_share(p, s.frequency_Hz) * 2.0 * math.pi * s.frequency_Hz
        if s.amplitude_m > 0.0:
            gain[i] = v_a_mps[i] / s.amplitude_m
        answer = commands[i + 1 : i + 2]
        if by_rule:
            rule_step(
                rule_params, rule_state, sensors, sensors[0].t_ns, known_mps[i], gain[i], answer, traces[i : i + 1]
            )
        else:
            events = BLOCK
            for row in range(first, announced):
                take_announcement(state[0], announce[row].holds_from_ns, announce[row].drive_velocity_mps)
                events |= ANNOUNCED
            controller_step(params, state, sensors, events, 0, sensors[0].t_ns, answer, traces[i : i + 1])
    return blocks


class Hum(NamedTuple):
    """A sine on the force and on both positions, as mains and a carrier make it."""

    frequency_Hz: float
    force_N: float
    position_m: float


class Stretch(NamedTuple):
    """Truth and traces of a stretch; [6, samples] and [blocks] each."""

    truth: npt.NDArray[np.float64]
    v_a_mps: npt.NDArray[np.float64]
    frequency_Hz: npt.NDArray[np.float64]
    gain: npt.NDArray[np.float64]
    traces: Records


class JudgedLoop:
    """A rig and its controller, in lockstep.

    Args:
        rig: the rig file.
        seed: of the sensor noise.
        subject: parameters and memory of the controller.
        rule: parameters and memory of a rule.
        by_rule: which of the two controls.
        hum: on the sensors; the noise must not be 0 where it has a size.
        sees_blocks: first and last block from the present one on of which a rule that knows the truth knows v_d.

    """

    def __init__(
        self,
        rig: RigConfig,
        seed: int,
        subject: Pair,
        rule: Pair,
        by_rule: bool,
        hum: Hum,
        sees_blocks: tuple[int, int] = (0, 0),
    ) -> None:
        self.block = 0
        self._rig, self._hum, self._by_rule = rig, hum, by_rule
        self._inputs, self._velocity_mps = RigInputs(rig, seed), held_velocity(rig)
        self._plant, self._subject, self._rule = plant_records(rig), subject, rule
        # the guard must not limit a rival
        free = Level(alarm=1e12, abort=1e12)
        guard = rig.guard.model_copy(update={"loud_ratio": free}) if by_rule else rig.guard
        self._guard = guard_records(rig.model_copy(update={"guard": guard}), 1, arm=True)
        samples = rig.solver.samples_per_block
        self._sees_blocks = sees_blocks
        self._analogue = np.empty((len(CHANNELS), samples))
        self._sensors, self._applied = sensor_block(samples).blank(), APPLIED.blank()
        self._last_command = COMMAND.blank()

    def _add_hum(self, noise: npt.NDArray[np.float64]) -> None:
        block_s, samples = self._rig.solver.block_s, self._rig.solver.samples_per_block
        blocks = len(noise)
        hum, sensors = self._hum, self._rig.sensors
        t_s = (self.block + (np.arange(blocks * samples) + 1.0).reshape(blocks, samples) / samples) * block_s
        wave = np.sin(2.0 * np.pi * hum.frequency_Hz * t_s)
        if hum.force_N:
            noise[:, 0] += hum.force_N / sensors.force_noise_N * wave
        if hum.position_m:
            noise[:, 3:] += (hum.position_m / sensors.position_noise_m * wave)[:, None]

    def advance(self, blocks: int) -> Stretch:
        """Advance by `blocks`; fewer come back where the rig's state became NaN or infinite."""
        _, noise, delay_blocks, announcements, announce = self._inputs.draw(blocks)
        self._add_hum(noise)
        samples, block_s = self._rig.solver.samples_per_block, self._rig.solver.block_s
        first, last = self._sees_blocks
        velocity_mps = self._velocity_mps((self.block + np.arange(blocks + last)) * block_s)
        known_mps = sliding_window_view(np.abs(velocity_mps[first:]), last - first + 1).max(axis=1)
        commands = COMMAND.blank(blocks + 1)
        commands[:1] = self._last_command
        traces, truth = TRACE.blank(blocks), np.empty((blocks, len(TRUTH), samples))
        v_a_mps, frequency_Hz, gain = (np.empty(blocks) for _ in range(3))
        done = advance_with_truth(
            *self._plant, *self._guard, velocity_mps[:blocks], noise, self._by_rule, *self._subject, *self._rule,
            delay_blocks, announcements, announce, known_mps, min(self.block, 1), self._analogue, self._sensors,
            self._applied, commands, traces, truth, v_a_mps, frequency_Hz, gain,
        )  # fmt: skip
        self.block += done
        self._last_command = commands[done : done + 1]
        in_time = truth[:done].transpose(1, 0, 2).reshape(len(TRUTH), done * samples)
        return Stretch(in_time, v_a_mps[:done], frequency_Hz[:done], gain[:done], traces[:done])
