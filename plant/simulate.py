"""A run of the rig without bus, sensors or controller: for the paper's figures, for tests, for benches."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats, Records
from bridge.kernel import kernel
from bridge.wire.channels import CHANNELS
from plant.config import RigConfig
from plant.core import advance, advance_disturbed
from plant.drive_motion import mean_velocity_mps
from plant.records import TRUTH, build


class Simulation(NamedTuple):
    """The true signals of a simulated run, without sensors; arrays of [samples], SI units."""

    t_s: Floats
    drive_force_N: Floats
    friction_force_N: Floats
    velocity_mps: Floats
    position_m: Floats
    drive_position_m: Floats


@kernel
def run_blocks(
    params: Records,
    state: Records,
    drive: Floats,
    frequency_Hz: Floats,
    amplitude_m: Floats,
    analogue: Floats,
    truth: Floats,
) -> None:
    """Advance a rig by many blocks.

    Args:
        params, state: one record each of `plant.records.PARAMS` and `STATE`.
        drive, frequency_Hz, amplitude_m: arguments of `plant.core.advance`, one value a block [blocks].
        analogue, truth: filled, [rows, blocks * samples], rows as CHANNELS and TRUTH.

    """
    samples = params[0].samples_per_block
    # arrays of one block: slices of the run's arrays are not contiguous, and `advance` would be compiled for them too
    block_analogue, block_truth = np.empty((analogue.shape[0], samples)), np.empty((truth.shape[0], samples))
    for block in range(drive.shape[0]):
        if params[0].disturbed:
            advance_disturbed(
                params, state, drive[block], frequency_Hz[block], amplitude_m[block], block_analogue, block_truth
            )
        else:
            advance(params, state, drive[block], frequency_Hz[block], amplitude_m[block], block_analogue, block_truth)
        for i in range(samples):
            for row in range(analogue.shape[0]):
                analogue[row, block * samples + i] = block_analogue[row, i]
            for row in range(truth.shape[0]):
                truth[row, block * samples + i] = block_truth[row, i]


def simulate(
    config: RigConfig,
    duration_s: float,
    frequency_Hz: float = 0.0,
    amplitude_m: float = 0.0,
    vibration_from_s: float = 0.0,
) -> Simulation:
    """Run a rig, with a constant vibration from `vibration_from_s` on.

    The piezo ramps at the rate of the configuration; the paper's runs switch at once (`amplitude_slew_m_per_s = 0`).
    The vibration starts at the beginning of a block; shorter blocks allow a start in between.
    """
    params, state = build(config)
    solver = config.solver
    block_s = solver.block_s
    blocks = round(duration_s / block_s)
    t_block_s = np.arange(blocks) * block_s
    velocity_mps = held_velocity(config)(t_block_s)
    on = np.arange(blocks) >= round(vibration_from_s / block_s)
    samples = solver.samples_per_block
    truth = np.empty((len(TRUTH), blocks * samples))
    analogue = np.empty((len(CHANNELS), blocks * samples))
    run_blocks(params, state, velocity_mps, on * frequency_Hz, on * amplitude_m, analogue, truth)
    t_s = (np.arange(blocks * samples) + 1) * (block_s / samples)
    return Simulation(t_s, truth[0], truth[1], truth[2], truth[4], truth[5])


def held_velocity(config: RigConfig) -> Callable[[Floats], Floats]:
    """The drive's velocity [m/s] as a function: it is held over the blocks that begin at the times given [s], 0 or later.

    For a profile that runs once: the velocity at the begin of the block, linear between the points of the profile, constant
    outside them. For moves and repeated motions: the mean over the block, so that a cycle ends where it began.
    """
    drive, block_s = config.drive, config.solver.block_s
    if drive.moves or drive.repeat_every_s > 0.0:
        motion = drive.motion()
        return lambda t_s: mean_velocity_mps(motion, t_s, block_s)
    profile = np.array(drive.profile)
    return lambda t_s: np.interp(t_s, profile[:, 0], profile[:, 1])
