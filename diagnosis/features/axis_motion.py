"""The measured motion of a force-driven axis: the model follows it, and the force that this needs is compared.

A model that is driven by the measured force alone drifts away within a stroke: 1 % of friction is 2 mm after a second on an axis
of 95 kg. A model that follows the measured motion cannot drift. The force that it needs is its prediction, and a wrong mass,
friction or gain shows where it acts.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.signal import savgol_filter

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.grid import BLOCK_S

# Blocks over which a cubic smooths the position. Too small: noise of the encoder; too large: reversals are smeared.
# With 31 blocks, 0.2 um of encoder noise give 1e-5 m/s and 1e-3 m/s^2.
WINDOW = 31
_EVERY = 5  # the search for zero and speed uses every fifth block; more blocks only cost time


class SlideMotion(NamedTuple):
    """Motion of the slide, [blocks] each, at the start of each block, as in a sampled control.

    Velocity, acceleration and inertia are smoothed; they only sort the blocks into bins.
    """

    position_m: Floats
    velocity_mps: Floats
    accel_mps2: Floats
    inertia_N: Floats  # force that accelerates the mass of the rig table


def motion_of(signals: dict[str, Floats], samples_per_block: float, rig: RigTable) -> SlideMotion:
    """The motion of a reduced run, from its position; from its acceleration where no position was measured.

    Args:
        signals: by name, [blocks] each.
        samples_per_block: samples in a block of the measured run; with 2 or more a block mean belongs to the middle.
        rig: the described rig.

    """
    position = signals.get("mass_position_m")
    if position is None:
        position = _from_acceleration(signals["mass_accel_mps2"], signals["drive_force_N"], rig)
    elif samples_per_block >= 2.0:
        at = np.arange(len(position), dtype=np.float64)
        position = np.interp(at - 0.5, at, position)
    velocity = np.asarray(savgol_filter(position, WINDOW, 3, deriv=1, delta=BLOCK_S), np.float64)
    accel = np.asarray(savgol_filter(position, WINDOW, 3, deriv=2, delta=BLOCK_S), np.float64)
    return SlideMotion(position, velocity, accel, rig.mass_kg * accel)


def _from_acceleration(accel_mps2: Floats, force_N: Floats, rig: RigTable) -> Floats:
    """Position [m] from an acceleration whose zero and whose speed at the start are unknown.

    Both are chosen so that inertia and the described friction explain the force best. Subtracting a line from the velocity would
    be enough for a long record, but in three strokes it removes a fifth of the motion.
    """
    integral_mps = np.cumsum(accel_mps2) * BLOCK_S
    time = np.arange(len(integral_mps)) / len(integral_mps)
    thinned = slice(None, None, _EVERY)
    left_N = (force_N - rig.mass_kg * (accel_mps2 - accel_mps2.mean()))[thinned]

    def rest(line: Floats) -> float:
        v = integral_mps[thinned] - line[0] - line[1] * time[thinned]
        friction_N = rig.coulomb_force_N * np.tanh(v / rig.stribeck_velocity_mps) + rig.viscous_damping_Ns_per_m * v
        return float(np.var(left_N - friction_N))

    slope, start = np.polyfit(time, integral_mps, 1)
    size = max(float(np.std(integral_mps - start - slope * time)), rig.stribeck_velocity_mps)
    corners = np.array([[start, slope], [start + size, slope], [start, slope + size]])
    optimum = minimize(rest, corners[0], method="Nelder-Mead", options={"initial_simplex": corners})
    line = np.asarray(optimum.x)
    return np.cumsum(integral_mps - line[0] - line[1] * time) * BLOCK_S
