"""A tribologist's eight lines of numpy for comparison: peaks, troughs, and a line through the first stick."""

from typing import Any, NamedTuple

import numpy as np
from scipy.signal import find_peaks


class Rival(NamedTuple):
    """Results of the eight lines."""

    slips: int
    static_force_N: float
    kinetic_force_N: float
    stiffness_N_per_m: float
    period_s: float
    slip_s: float


def eight_lines(t_s: Any, force_N: Any, speed_mps: float) -> Rival:
    """Evaluate the record by peaks and troughs."""
    prominence = 0.3 * (force_N.max() - force_N[len(force_N) // 4 :].min())
    peaks, _ = find_peaks(force_N, prominence=prominence)
    troughs, _ = find_peaks(-force_N, prominence=prominence)
    top, bottom = force_N[peaks].mean(), force_N[troughs].mean()
    after = peaks[peaks > troughs[0]][0]
    slope = np.polyfit(t_s[troughs[0] : after], force_N[troughs[0] : after], 1)[0]
    period = np.diff(t_s[peaks]).mean()
    slip = (troughs[np.searchsorted(troughs, peaks[:-1])] - peaks[:-1]).mean() * (t_s[1] - t_s[0])
    return Rival(
        len(peaks), float(top), float(0.5 * (top + bottom)), float(slope / speed_mps), float(period), float(slip)
    )
