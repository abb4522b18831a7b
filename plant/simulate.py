"""A run of the rig without bus, sensors or controller: for the paper's figures, for tests, for benches."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.kernel import kernel
from bridge.wire.messages import CHANNELS
from plant.config import RigConfig
from plant.core import advance, advance_disturbed
from plant.records import TRUTH, build

Floats = npt.NDArray[np.floating[Any]]


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
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
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
    for block in range(drive.shape[0]):
        rows = slice(block * samples, (block + 1) * samples)
        if params[0].disturbed:
            advance_disturbed(
                params, state, drive[block], frequency_Hz[block], amplitude_m[block], analogue[:, rows], truth[:, rows]
            )
        else:
            advance(
                params, state, drive[block], frequency_Hz[block], amplitude_m[block], analogue[:, rows], truth[:, rows]
            )


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
    velocity_mps = drive_velocity_mps(config, t_block_s)
    on = np.arange(blocks) >= round(vibration_from_s / block_s)
    samples = solver.samples_per_block
    truth = np.empty((len(TRUTH), blocks * samples))
    analogue = np.empty((len(CHANNELS), blocks * samples))
    run_blocks(params, state, velocity_mps, on * frequency_Hz, on * amplitude_m, analogue, truth)
    t_s = (np.arange(blocks * samples) + 1) * (block_s / samples)
    return Simulation(t_s, truth[0], truth[1], truth[2], truth[4], truth[5])


def drive_velocity_mps(config: RigConfig, t_s: Floats) -> Floats:
    """Drive velocity [m/s] at the times `t_s` [s], linear between the points of the profile, constant outside them."""
    profile = np.array(config.drive.profile)
    return np.interp(t_s, profile[:, 0], profile[:, 1])
