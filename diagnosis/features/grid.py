"""A run on a grid of 1 ms: block means of every channel, and the rms of each accelerometer within a block (its shake).

Measured and predicted runs are reduced in the same way and lose the same information. 1 ms resolves a slip (36 ms on the paper's
spring) and averages 20 samples of noise. Vibration is too fast for the grid and is kept as an rms.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from bridge.wire.channels import CHANNELS
from diagnosis.evidence.folder import SHAKE_RATE_HZ, MeasuredRun

BLOCK_S = 1e-3
MEANS = CHANNELS
SHAKES = ("mass_shake_mps2", "base_shake_mps2")  # rms within a block, about the block's mean
SIGNALS = (*MEANS, *SHAKES)
SHAKEN = {"mass_shake_mps2": "mass_accel_mps2", "base_shake_mps2": "base_accel_mps2"}
# Largest distance of a block to the two blocks that it is averaged with. Too small: no distance suits some frequencies.
# Too large: slips are smeared.
_FURTHEST_BLOCKS = 5
# Largest cosine of the phase that the vibration advances over this distance. Too large: the average amplifies noise.
# Too small: no distance suits more frequencies.
_LARGEST_COSINE = 0.3


def reduce_run(run: MeasuredRun) -> dict[str, Floats]:
    """The signals of a measured run by name, [blocks] each; only those that its columns allow.

    A block without a sample (in a gap, or between slow samples) is interpolated.
    """
    index = _index(run)
    count = np.bincount(index)
    reduced = block_means(run, MEANS)
    if len(run.t_s) / np.count_nonzero(count) >= SHAKE_RATE_HZ * BLOCK_S:
        for name, source in SHAKEN.items():
            if source in reduced:
                about = run.columns[source] - reduced[source][index]
                power = np.bincount(index, about * about) / np.maximum(count, 1)
                power[count == 0] = np.median(power)
                reduced[name] = np.sqrt(power)
    return reduced


def block_means(run: MeasuredRun, names: Sequence[str]) -> dict[str, Floats]:
    """Means of the columns `names` that the run has, [blocks] each; a block without a sample is interpolated."""
    index = _index(run)
    count = np.bincount(index)
    empty, filled = np.flatnonzero(count == 0), np.flatnonzero(count)
    reduced: dict[str, Floats] = {}
    for name in names:
        if name in run.columns:
            mean = np.bincount(index, run.columns[name]) / np.maximum(count, 1)
            if len(empty):
                mean[empty] = np.interp(empty, filled, mean[filled])
            reduced[name] = mean
    return reduced


def _index(run: MeasuredRun) -> npt.NDArray[np.int64]:
    """The block of every sample, [samples]."""
    return np.floor((run.t_s - run.t_s[0]) / BLOCK_S + 1e-6).astype(np.int64)


class Averaged(NamedTuple):
    """Blocks whose mean still holds some vibration, and the two blocks that each is averaged with, [averaged] each."""

    centre: npt.NDArray[np.int64]
    before: npt.NDArray[np.int64]
    after: npt.NDArray[np.int64]
    cosine: Floats  # cosine of the phase that the vibration advances from one of these blocks to the next


def averaged(frequency_Hz: Floats) -> Averaged:
    """The blocks to average under a vibration of `frequency_Hz` [blocks], 0 without a vibration.

    A block holds 4.5 periods of 4.5 kHz. Its mean keeps up to 7 % of the amplitude, with a sign that depends on the phase of the
    exciter, and no log holds this phase. So every block is averaged with a block before and a block after it. Their distance is
    chosen so that the phase advances by nearly half a turn; the weights remove its frequency and keep a constant.
    """
    shaken = np.flatnonzero(frequency_Hz)
    values_Hz, which = np.unique(frequency_Hz[shaken], return_inverse=True)
    turned = np.cos(2.0 * np.pi * BLOCK_S * np.outer(values_Hz, np.arange(1, _FURTHEST_BLOCKS + 1)))
    cosine = turned.min(axis=1, initial=1.0)[which]
    distance = (turned.argmin(axis=1) + 1)[which]
    affected, cosine, distance = (values[cosine < _LARGEST_COSINE] for values in (shaken, cosine, distance))
    return Averaged(
        affected, np.maximum(affected - distance, 0), np.minimum(affected + distance, len(frequency_Hz) - 1), cosine
    )


def without_vibration(signals: dict[str, Floats], blocks: Averaged) -> dict[str, Floats]:
    """The signals, with the remainder of the vibration moved from the mean accelerations to the shakes; new arrays.

    Args:
        signals: [blocks] each, measured or predicted.
        blocks: result of `averaged` for the vibration in the run.

    """
    blocks_of, before, after, cosine = blocks
    result = dict(signals)
    for shake, source in SHAKEN.items():
        if source in signals:
            mean = signals[source]
            steady = (mean[before] - 2.0 * cosine * mean[blocks_of] + mean[after]) / (2.0 - 2.0 * cosine)
            result[source] = mean.copy()
            result[source][blocks_of] = steady
            if shake in signals:
                result[shake] = signals[shake].copy()
                result[shake][blocks_of] = np.hypot(signals[shake][blocks_of], mean[blocks_of] - steady)
    return result
