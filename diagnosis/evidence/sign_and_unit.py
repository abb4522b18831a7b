"""Whether the force bends as the mass accelerates, before anything of the rig is believed: a sensor the wrong way round, a unit.

A drive that moves evenly pulls with F = k (s - x), so F'' = -k x'', in every slip and whatever the friction is.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

Floats = npt.NDArray[np.floating[Any]]
_BIN_S = 1e-3
_SMOOTH_BINS = (
    4.0  # of 40 ms, which a slip on the paper's spring takes, a smoothing by 4 leaves most of the acceleration
)
_BESIDE_BINS = 61  # around a vibration, whose remainder in a mean over 1 ms is as large as a slip
_FEWEST_BINS = 500
_AS_ONE = 0.9  # correlation: 0.98 in the middle of 52 runs of made rigs; without slips it is noise against noise


def told_stiffness_N_per_m(t_s: Floats, columns: Mapping[str, Floats]) -> float | None:
    """The drive's stiffness as force and mass acceleration tell it, below 0 where one has the wrong sign; None: they do not.

    Without drive and friction in it, it is good for a sign and a unit only. `t_s` and every column are [samples].
    """
    if not {"drive_force_N", "mass_accel_mps2"} <= columns.keys():
        return None
    number = np.floor((t_s - t_s[0]) / _BIN_S).astype(np.int64)
    samples = np.bincount(number)
    if len(samples) < _FEWEST_BINS or (samples == 0).any():
        return None
    force_N, accel_mps2 = (
        gaussian_filter1d(np.bincount(number, columns[name]) / samples, _SMOOTH_BINS)
        for name in ("drive_force_N", "mass_accel_mps2")
    )
    vibrates = np.zeros(len(samples))
    if "vibration_amplitude_m" in columns:
        vibrates = np.bincount(number, np.abs(columns["vibration_amplitude_m"]) > 0.0)
    quiet = maximum_filter1d(vibrates, _BESIDE_BINS)[1:-1] == 0.0
    bent = np.diff(force_N, 2)[quiet] / _BIN_S**2
    moved = accel_mps2[1:-1][quiet]
    if len(moved) < _FEWEST_BINS or np.ptp(moved) == 0.0 or np.ptp(bent) == 0.0:
        return None
    if abs(float(np.corrcoef(bent, moved)[0, 1])) < _AS_ONE:
        return None
    return -float(bent @ moved) / float(moved @ moved)
