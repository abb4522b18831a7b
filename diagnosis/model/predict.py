"""Prediction of a run under its commands, reduced to the 1 ms grid.

The equations belong to the plant: `plant.core` with a force drive, `plant.four_rigs` with a spring drive. The bandwidths of
the plant's sensors are set very wide, since a manifest states none.

Every segment of the model begins with the force that was measured there. The phase of the stick-slip cycle at which the vibration
changes is random. For seconds this phase determines how the force settles without slips, and the number of slips in a segment; a
model with another phase would differ by chance.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats, Records
from bridge.kernel import unlocked_kernel
from bridge.layouts import PlantMemory, PlantParams
from bridge.wire.channels import CHANNELS
from diagnosis.features.grid import BLOCK_S, SIGNALS
from diagnosis.features.segments import CommandedRun
from diagnosis.model.rig import Rig, Start, StartState, built
from plant.config import RigConfig
from plant.core import advance_disturbed
from plant.four_rigs import advance_lanes
from plant.four_rigs_step import LANES, NARROW
from plant.records import TRUTH

# Natural frequency of the critically damped spring that holds a force-driven model to the measured motion (10 Hz).
# Too small: reversals are smeared; friction errors show up to this frequency only. Too large: the encoder's noise becomes force.
_HOLDING_RAD_PER_S = 2.0 * math.pi * 10.0
# Time constant of the damper's low-pass. Too small: noise; too large: the damper acts too late to damp.
# 3 ms keep 0.1 um of encoder noise to 0.2 N and turn the phase at 10 Hz by 11 degrees.
_RATE_FILTER_S = 3e-3


def predict(
    config: RigConfig, force_driven: bool, commands: CommandedRun, start: Start, entries: Sequence[StartState] = ()
) -> dict[str, Floats]:
    """Noise-free signals by name, [blocks] each, SI units, before the sensors.

    Args:
        config: the rig.
        force_driven: whether a force drives the rig; the model then follows the measured motion of `commands`.
        commands: commands of the run.
        start: state at the first block.
        entries: states at the start of the segments; a force drive has none.

    """
    (signals,) = predict_many([config], force_driven, commands, [start], [entries])
    assert signals is not None, "a wanted rig is predicted"  # noqa: S101
    return signals


def predict_many(
    configs: Sequence[RigConfig],
    force_driven: bool,
    commands: CommandedRun,
    starts: Sequence[Start],
    entries: Sequence[Sequence[StartState]],
    wanted: int | None = None,
) -> list[dict[str, Floats] | None]:
    """Result of `predict` for each of many rigs in the same run; the entries of all rigs are at the same blocks.

    With `wanted`, the first `wanted` rigs are predicted, and further rigs only in empty lanes, with None for the others.
    """
    rigs = [built(config, force_driven, commands, start) for config, start in zip(configs, starts, strict=True)]
    if force_driven:
        return [dict(zip(SIGNALS, _led(rig, commands), strict=True)) for rig in rigs]
    same_steps: dict[bytes, list[int]] = {}
    for number, rig in enumerate(rigs):
        same_steps.setdefault(rig.steps.tobytes(), []).append(number)
    by_number: dict[int, Floats] = {}
    for numbers in same_steps.values():
        needed = len(numbers) if wanted is None else sum(number < wanted for number in numbers)
        first = 0
        while first < needed:
            width = LANES if needed - first > NARROW else NARROW
            group = numbers[first : first + width]
            lanes = [*group, *[group[-1]] * (width - len(group))]
            signals = _side_by_side([rigs[number] for number in lanes], commands, [entries[lane] for lane in lanes])
            by_number |= zip(group, signals, strict=False)
            first += width
    return [
        dict(zip(SIGNALS, by_number[number], strict=True)) if number in by_number else None
        for number in range(len(rigs))
    ]


def _led(rig: Rig, commands: CommandedRun) -> Floats:
    """Signals of a rig with a force drive that follows the measured motion, [signals, blocks]."""
    assert commands.motion is not None, "a force drive without a motion is refused when it is read"  # noqa: S101
    params, state, steps = rig
    p: Any = params[0]
    out = np.empty((len(SIGNALS), len(commands.drive)))
    scratch = int(steps.max())
    analogue, truth = np.empty((len(CHANNELS), scratch)), np.empty((len(TRUTH), scratch))
    stiffness = p.m * _HOLDING_RAD_PER_S**2
    damping = 2.0 * p.m * _HOLDING_RAD_PER_S
    _follow(
        params, state, commands.drive, commands.frequency_Hz, commands.amplitude_m, steps,
        analogue, truth, out, commands.motion.position_m, stiffness, damping,
    )  # fmt: skip
    return out


def _side_by_side(rigs: Sequence[Rig], commands: CommandedRun, entries: Sequence[Sequence[StartState]]) -> Floats:
    """Signals of `NARROW` or `LANES` rigs with the same steps, [rigs, signals, blocks]."""
    blocks = np.array([entry.block for entry in entries[0]], np.int64)
    ages_s = [[math.nan if entry.age_s is None else entry.age_s for entry in of_rig] for of_rig in entries]
    forces_N = [[entry.force_N for entry in of_rig] for of_rig in entries]
    out = np.empty((len(rigs), len(SIGNALS), len(commands.drive)))
    advance_lanes(
        (1,) * len(rigs), np.concatenate([rig.params for rig in rigs]), np.concatenate([rig.state for rig in rigs]), BLOCK_S,
        commands.drive, commands.frequency_Hz, commands.amplitude_m, rigs[0].steps,
        blocks, np.array(forces_N).T.copy(), np.array(ages_s).T.copy(), out,
    )  # fmt: skip
    return out


@unlocked_kernel
def _follow(
    params: Records,
    state: Records,
    force_N: Floats,
    frequency_Hz: Floats,
    amplitude_m: Floats,
    steps: npt.NDArray[np.int64],
    analogue: Floats,
    truth: Floats,
    out: Floats,
    position_m: Floats,
    stiffness: float,
    damping: float,
) -> None:
    """Predict along a measured motion; the force in `out` is the force that keeps the model on this motion."""
    p: PlantParams = params[0]
    s: PlantMemory = state[0]
    channels, truths = analogue.shape[0], truth.shape[0]
    ahead_before_m = position_m[0] - s.x
    rate_mps = 0.0
    share = 1.0 - math.exp(-BLOCK_S / _RATE_FILTER_S)
    for block in range(force_N.shape[0]):
        ahead_m = position_m[block] - s.x
        rate_mps += share * ((ahead_m - ahead_before_m) / BLOCK_S - rate_mps)
        ahead_before_m = ahead_m
        force = force_N[block] + stiffness * ahead_m + damping * rate_mps
        samples = steps[block]
        p.samples_per_block = samples
        p.steps_per_sample = 1
        p.dt_s = BLOCK_S / samples
        # contiguous, as in all other calls: other arrays would make Numba compile the kernel again
        block_analogue = analogue.ravel()[: channels * samples].reshape((channels, samples))
        block_truth = truth.ravel()[: truths * samples].reshape((truths, samples))
        advance_disturbed(params, state, force, frequency_Hz[block], amplitude_m[block], block_analogue, block_truth)
        for row in range(channels):
            total = 0.0
            for i in range(samples):
                total += block_analogue[row, i]
            out[row, block] = total / samples
        for row in range(1, 3):
            total = 0.0
            for i in range(samples):
                about = block_analogue[row, i] - out[row, block]
                total += about * about
            out[4 + row, block] = math.sqrt(total / samples)
