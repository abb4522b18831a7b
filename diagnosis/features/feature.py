"""Definition of a feature: one number of a run that does not depend on the instants of the slips; its band and its scales."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable

Signals = dict[str, Floats]
Band = tuple[float, float]
LOW: Band = (0.0, 5.0)
MIDDLE: Band = (5.0, 50.0)
HIGH: Band = (50.0, 500.0)
# features that are mean squares: noise and roughness add to them
POWERS = frozenset({"scatter", "ring", "ripple", "rest", "spring rest"})
DRIVE_WAVES = 24  # waves of the drive position over a run; more waves show shorter ripples and cost time
# Least noise of a drive position, as a share of the travel; a commanded position in place of a measured one has only rounding,
# 3e-8 of the position where a file holds 32 bits. Larger: 2.5e-7 took an encoder of 2e6 counts on the travel for a command.
RESOLVED = 5e-8
# Change of a displacement sensor's slope over the travel: linear to 0.2 % of a range of eight travels, as 40 mm for the 5 mm of
# the paper's rig. Larger: the sensor explains a spring that hardens. Smaller: a sensor whose range is used up is a gap.
BOW = 1e-3


class Feature(NamedTuple):
    """Label of one number in the vector of features."""

    name: str
    signal: str
    regime: str  # stick, breakaway, slip, restick, steady
    band_Hz: Band  # lowest and highest frequency
    segment: int  # index in the run's segments; -1: the whole run


class Scales(NamedTuple):
    """Typical numbers of a rig, from which windows and limits follow."""

    force_N: float  # static friction
    slip_s: float  # duration of a slip: half a period of the mass on its spring
    drop_N: float  # smallest fall of the force that is a slip
    stiffness_N_per_m: float
    fall_N: float  # fall of the force in a slip: twice the difference of static and Coulomb friction


class Features:
    """Collector of the features of one run, each with its label."""

    def __init__(self) -> None:
        self._labels: list[tuple[str, str, str, Band, int]] = []
        self.values: list[float] = []

    @property
    def labels(self) -> list[Feature]:
        """Label of every value, in order."""
        return [Feature(*label) for label in self._labels]

    def add(self, name: str, signal: str, regime: str, band_Hz: Band, segment: int, value: float) -> None:
        """Append one number; NaN where this run has no such feature."""
        self.add_all([(name, regime)], signal, band_Hz, segment, [value])

    def add_all(
        self, names: Sequence[tuple[str, str]], signal: str, band_Hz: Band, segment: int, values: Sequence[float]
    ) -> None:
        """Append several numbers of one signal and band; `names`: name and regime of each."""
        self._labels += [(name, signal, regime, band_Hz, segment) for name, regime in names]
        self.values += values


# Smallest fall of the force that is a slip, as a share of the static friction.
# Too small: noise and ripple count as slips. Too large: the small slips near elimination are lost.
_SMALLEST_DROP = 0.03


def scales_of(rig: RigTable) -> Scales:
    """The scales of a rig. With a force drive only `force_N` has a meaning."""
    stiffness = rig.drive_stiffness_N_per_m or 1.0
    slip_s = float(np.pi * np.sqrt(rig.mass_kg / stiffness))
    fall_N = 2.0 * max(rig.static_force_N - rig.coulomb_force_N, 0.02 * rig.static_force_N)
    return Scales(rig.static_force_N, slip_s, _SMALLEST_DROP * rig.static_force_N, stiffness, fall_N)
