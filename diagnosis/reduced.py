"""A run on a grid of 1 ms: block means of every channel, and how much an accelerometer shakes within a block.

Measured and predicted runs are reduced alike, so what the reduction loses it loses on both sides. 1 ms resolves a slip (36 ms
on the paper's spring) and averages 20 samples of noise; vibration is too fast for it and is kept as an rms.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.evidence import Run

Floats = npt.NDArray[np.floating[Any]]
BLOCK_S = 1e-3
MEANS = ("drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m")
SHAKES = ("mass_shake_mps2", "base_shake_mps2")  # rms within a block, about the block's mean
SIGNALS = (*MEANS, *SHAKES)
_SHAKEN = {"mass_shake_mps2": "mass_accel_mps2", "base_shake_mps2": "base_accel_mps2"}
# fewer samples a block than this cannot tell an rms
_FEWEST_FOR_SHAKE = 8


def reduce_run(run: Run) -> tuple[float, dict[str, Floats]]:
    """Start [s] and the signals of a measured run by name, [blocks] each; what it lacks is not there.

    A block without a sample, in a gap or between slow samples, is interpolated.
    """
    start_s = float(run.t_s[0])
    index = np.floor((run.t_s - start_s) / BLOCK_S + 1e-6).astype(np.int64)
    blocks = int(index[-1]) + 1
    count = np.bincount(index, minlength=blocks)
    empty = np.flatnonzero(count == 0)
    filled = np.flatnonzero(count)
    reduced: dict[str, Floats] = {}
    for name in MEANS:
        if name in run.columns:
            mean = np.bincount(index, run.columns[name], blocks) / np.maximum(count, 1)
            if len(empty):
                mean[empty] = np.interp(empty, filled, mean[filled])
            reduced[name] = mean
    per_block = len(run.t_s) / max(len(filled), 1)
    if per_block >= _FEWEST_FOR_SHAKE:
        for name, source in _SHAKEN.items():
            if source in reduced:
                about = run.columns[source] - reduced[source][index]
                power = np.bincount(index, about * about, blocks) / np.maximum(count, 1)
                power[empty] = np.median(power)
                reduced[name] = np.sqrt(power)
    return start_s, reduced
