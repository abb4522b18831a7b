"""A run of the rig without bus, sensors or controller: for the paper's figures, for tests, for benches."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.kernel import kernel
from plant.config import RigConfig
from plant.core import advance, advance_disturbed
from plant.records import CHANNELS, TRUTH, build

Floats = npt.NDArray[np.floating[Any]]


class Simulation(NamedTuple):
    """What a simulated run did; arrays of [samples], SI units, no sensor in between."""

    t_s: Floats
    drive_force_N: Floats
    friction_force_N: Floats
    velocity_mps: Floats
    position_m: Floats
    drive_position_m: Floats


@kernel
def _run(
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    drive_velocity_mps: Floats,
    frequency_Hz: Floats,
    amplitude_m: Floats,
    analogue: Floats,
    truth: Floats,
    out: Floats,
) -> None:
    samples = truth.shape[1]
    for block in range(drive_velocity_mps.shape[0]):
        if params[0].disturbed:
            advance_disturbed(
                params, state, drive_velocity_mps[block], frequency_Hz[block], amplitude_m[block], analogue, truth
            )
        else:
            advance(params, state, drive_velocity_mps[block], frequency_Hz[block], amplitude_m[block], analogue, truth)
        for sample in range(samples):
            for row in range(truth.shape[0]):
                out[row, block * samples + sample] = truth[row, sample]


def simulate(
    config: RigConfig,
    duration_s: float,
    frequency_Hz: float = 0.0,
    amplitude_m: float = 0.0,
    vibration_from_s: float = 0.0,
) -> Simulation:
    """Run a rig, with a constant vibration from `vibration_from_s` on.

    The ramp of the piezo is the configuration's; the paper's runs switch at once (`amplitude_slew_m_per_s = 0`).
    The vibration starts with a block; a start inside a block is reached by shortening the blocks.
    """
    params, state = build(config)
    solver = config.solver
    block_s = solver.block_s
    blocks = round(duration_s / block_s)
    t_block_s = np.arange(blocks) * block_s
    velocity_mps = drive_velocity_mps(config, t_block_s)
    on = np.arange(blocks) >= round(vibration_from_s / block_s)
    samples = solver.samples_per_block
    out = np.empty((len(TRUTH), blocks * samples))
    analogue = np.empty((len(CHANNELS), samples))
    truth = np.empty((len(TRUTH), samples))
    _run(params, state, velocity_mps, on * frequency_Hz, on * amplitude_m, analogue, truth, out)
    t_s = (np.arange(blocks * samples) + 1) * (block_s / samples)
    drive_m = out[4] + out[0] / config.drive.stiffness_N_per_m
    return Simulation(t_s, out[0], out[1], out[2], out[4], drive_m)


def drive_velocity_mps(config: RigConfig, t_s: Floats) -> Floats:
    """Drive velocity [m/s] at the times `t_s` [s], linear between the points of the profile."""
    profile = np.array(config.drive.profile)
    return np.interp(t_s, profile[:, 0], profile[:, 1])
