"""Stiffness from force and mass acceleration alone: it reveals a sensor with the wrong sign or unit.

A drive that moves evenly pulls with F = k (s - x). So F'' = -k x'' in every slip, for any friction and without a rig number.
"""

from collections.abc import Mapping

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from bridge.arrays import Floats

_BIN_S = 1e-3
# Standard deviation of the smoothing. Too small: noise; too large: slips are lost. A slip on the paper's spring takes about
# 40 ms, and 4 ms leave most of its acceleration.
_SMOOTH_BINS = 4.0
_BESIDE_BINS = 61  # bins left out around a vibration: its remainder in a mean over 1 ms is as large as a slip
_FEWEST_BINS = 500  # fewest bins of a run; a stiffness from fewer bins is noise
# Smallest correlation of force and acceleration for which a stiffness is returned. Too small: runs without slips, noise against
# noise, give a false stiffness. Too large: wrong signs and units stay unseen. Counted: docs/method/diagnosis.md.
_LEAST_CORRELATION = 0.9


def apparent_stiffness_N_per_m(t_s: Floats, columns: Mapping[str, Floats]) -> float | None:
    """The drive's stiffness from force and mass acceleration; below 0 when one of the two has the wrong sign.

    None where the two do not correlate or one is missing. The stiffness neglects the motion of the drive, so it is good for a
    sign and a unit only. `t_s` and every column are [samples].
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
    if abs(float(np.corrcoef(bent, moved)[0, 1])) < _LEAST_CORRELATION:
        return None
    return -float(bent @ moved) / float(moved @ moved)
