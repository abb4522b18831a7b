"""What a feature is: one number of a run that does not depend on when the run slips, its band and its scales."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.evidence.manifest import RigTable

Floats = npt.NDArray[np.floating[Any]]
Signals = dict[str, Floats]
Band = tuple[float, float]
LOW: Band = (0.0, 5.0)
MIDDLE: Band = (5.0, 50.0)
HIGH: Band = (50.0, 500.0)
# features that are powers of what is left: noise and roughness add to them
POWERS = frozenset({"scatter", "ring", "ripple", "rest", "spring rest"})
DRIVE_WAVES = 24
RESOLVED_M = 1e-9  # a commanded position that was logged as measured has no noise but the rounding of its sums


class Feature(NamedTuple):
    """What a number of the vector is, and where it belongs."""

    name: str
    signal: str
    regime: str  # stick, breakaway, slip, restick, steady
    band_Hz: Band
    segment: int  # of the run; -1: the whole run


class Scales(NamedTuple):
    """Typical numbers of a rig, by which windows are sized and logarithms kept finite."""

    force_N: float  # static friction
    slip_s: float  # half a period of the mass on its spring
    drop_N: float  # smallest fall of the force that is a slip
    stiffness_N_per_m: float
    fall_N: float  # of the force in a slip: twice the static less the Coulomb friction


class Features:
    """Collects features of one run."""

    def __init__(self) -> None:
        self._labels: list[tuple[str, str, str, Band, int]] = []
        self.values: list[float] = []

    @property
    def labels(self) -> list[Feature]:
        """What the values are; a prediction is never asked, and thousands are made."""
        return [Feature(*label) for label in self._labels]

    def add(self, name: str, signal: str, regime: str, band_Hz: Band, segment: int, value: float) -> None:
        """Append one number; NaN where this run has no such thing."""
        self._labels.append((name, signal, regime, band_Hz, segment))
        self.values.append(value)


_SMALLEST_DROP = 0.03  # of the static friction: a smaller fall of the force is no slip


def scales_of(rig: RigTable) -> Scales:
    """The scales of a rig with a spring drive; with a force drive only the force means something."""
    stiffness = rig.drive_stiffness_N_per_m or 1.0
    slip_s = float(np.pi * np.sqrt(rig.mass_kg / stiffness))
    fall_N = 2.0 * max(rig.static_force_N - rig.coulomb_force_N, 0.02 * rig.static_force_N)
    return Scales(rig.static_force_N, slip_s, _SMALLEST_DROP * rig.static_force_N, stiffness, fall_N)
