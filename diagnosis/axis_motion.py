"""The motion of a force-driven axis: what a model of it is led along, so that the force it needs can be compared.

A model that is driven by the measured force alone drifts away within a stroke, since 1 % of friction is 2 mm after a second on an
axis of 95 kg. Led along the measured motion it needs a force, and that force is what the model says; it does not drift, and a
mass, a friction or a gain that is wrong shows where it acts.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from diagnosis.reduced import BLOCK_S

Floats = npt.NDArray[np.floating[Any]]
_WINDOW = 31  # blocks, of a cubic: 0.2 um of encoder noise are 4e-6 m/s and 1e-3 m/s^2


class Motion(NamedTuple):
    """One value a block, at the block's start as a sampled control has it. The last three are smoothed, for sorting only."""

    position_m: Floats
    velocity_mps: Floats
    accel_mps2: Floats
    inertia_N: Floats  # force that accelerates the mass as described


def motion_of(signals: dict[str, Floats], samples_per_block: float, mass_kg: float) -> Motion:
    """The motion of a reduced run, from its position, or from its acceleration where there is none."""
    position = signals.get("mass_position_m")
    if position is None:
        position = _integrated(_integrated(signals["mass_accel_mps2"]))
    elif samples_per_block >= 2.0:  # a mean belongs to the middle of its block
        at = np.arange(len(position), dtype=np.float64)
        position = np.interp(at - 0.5, at, position)
    velocity = np.asarray(savgol_filter(position, _WINDOW, 3, deriv=1, delta=BLOCK_S), np.float64)
    accel = np.asarray(savgol_filter(position, _WINDOW, 3, deriv=2, delta=BLOCK_S), np.float64)
    return Motion(position, velocity, accel, mass_kg * accel)


def _integrated(values: Floats) -> Floats:
    """Integral without its line: an accelerometer knows neither its zero nor where it is."""
    sums = np.cumsum(values) * BLOCK_S
    at = np.arange(len(sums), dtype=np.float64)
    return sums - np.polyval(np.polyfit(at, sums, 1), at)
