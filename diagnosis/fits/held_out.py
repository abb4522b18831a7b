"""How far an explanation closes the gap, on runs that no fit has seen.

The held-out runs are another problem: the fitter that knows the fitted runs never holds them, so nothing can leak.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.fits.baseline import Baseline
from diagnosis.fits.fit import Fit
from diagnosis.gap.measure import Floor, cell_squares, chi2_of, differences, floor_of, replicates, whitened
from diagnosis.gap.problem import Problem
from diagnosis.model.per_run import has_own_phases

_REPLICATES = 24  # for the floor of the held-out runs. Fewer: it is uncertain. More: 0.01 s of CPU each
_RESAMPLES = 400  # of the cells
_SEED = 3  # of the replicates and of the intervals
_SMALLEST_GAP = 0.05  # above the floor: less leaves nothing to divide by
# Floors beyond which an answer leaves too much to be right. 111 right names on a sealed set left 2.2 at most, and 12 rigs without
# a gap 2.17; of 19 wrong names four left 2.4 to 4.8.
MORE_THAN_RIGHT: Final = 2.3


class GapLeft(NamedTuple):
    """The remainder of the gap under an explanation."""

    gap: float
    shrinkage: float | None  # (retuned - gap) / (retuned - floor); None: no gap to close
    interval_90: tuple[float, float] | None


class HeldOut:
    """The held-out runs and their floor, under the fit `best`.

    Attributes:
        problem: the held-out runs.
        floor: noise floor of each feature.
        nominal, retuned: gap of the rig as described, and of the baseline.

    """

    def __init__(self, problem: Problem, rig: Baseline, best: Fit) -> None:
        self.problem = problem
        self._rig, self._nuisances = rig, rig.fitter.nuisances
        known = {name: table for name, table in best.effects.items() if not has_own_phases(table)}
        self.floor: Floor = self._floor_at(best, known, None)
        self._wider = self.floor
        if len(known) < len(best.effects):
            # a wave of unknown phase is scatter: in the floor of models that have it
            wider = self._floor_at(best, best.effects, self.floor)
            self._wider = self.floor._replace(bias=wider.bias, scatter=wider.scatter, level=wider.level)
        described = rig.fit._replace(deviations=np.zeros(len(self._nuisances)))
        self.nominal = self._gap(self._squares([described])[0])
        (self._retuned,) = self._squares([rig.fit])
        self.retuned = self._gap(self._retuned)

    def left(self, fits: Sequence[Fit]) -> list[float]:
        """chi2 of these runs under each fit."""
        points = [self._nuisances.point(fit.deviations, fit.effects) for fit in fits]
        return [
            chi2_of(whitened(self.floor, self.problem, predicted)[0])
            for predicted in self.problem.predicted_many(points)
        ]

    def closed_by(self, fit: Fit) -> GapLeft:
        """The gap under a fit; the interval of its share is the spread over cells."""
        (squares,) = self._squares([fit])
        gap = self._gap(squares)
        if not self.retuned - 1.0 >= _SMALLEST_GAP:  # no number where nothing can be compared
            return GapLeft(gap, None, None)
        shrinkage = (self.retuned - gap) / (self.retuned - 1.0)
        picks = np.random.default_rng(_SEED).integers(len(squares), size=(_RESAMPLES, len(squares)))
        before, after = (np.sqrt(values[picks].mean(axis=1)) for values in (self._retuned, squares))
        gaps = before - 1.0 > _SMALLEST_GAP
        if 2 * gaps.sum() < _RESAMPLES:
            return GapLeft(gap, shrinkage, None)
        low, high = np.quantile((before - after)[gaps] / (before - 1.0)[gaps], (0.05, 0.95))
        return GapLeft(gap, shrinkage, (float(min(low, shrinkage)), float(max(high, shrinkage))))

    def left_by(self, fit: Fit) -> float:
        """The gap under a fit, in floors."""
        return self._gap(self._squares([fit])[0])

    def share_closed(self, before: Fit, after: Fit) -> float | None:
        """Share of the gap under one fit that another one closes; None where the first leaves no gap."""
        left = self.left_by(before)
        return (left - self.left_by(after)) / (left - 1.0) if left - 1.0 >= _SMALLEST_GAP else None

    def differences(self, fit: Fit) -> Floats:
        """Measured less predicted in floors [compared]."""
        return self._differences([fit])[0]

    def _floor_at(self, best: Fit, effects: dict[str, dict[str, float | str]], before: Floor | None) -> Floor:
        point = self._nuisances.point(best.deviations, effects)
        drawn = replicates(self.problem, point, self._rig.surface, _REPLICATES, _SEED)
        return floor_of(self.problem, point, drawn, before)

    def _squares(self, fits: Sequence[Fit]) -> list[Floats]:
        """The square of every cell in floors, under points of one hypothesis [cells]; 1 on average under a right model."""
        floor = self._floor_of(fits[0])
        return [cell_squares(floor, z) / floor.level**2 for z in self._differences(fits)]

    def _floor_of(self, fit: Fit) -> Floor:
        return self._wider if any(has_own_phases(table) for table in fit.effects.values()) else self.floor

    def _differences(self, fits: Sequence[Fit]) -> list[Floats]:
        floor = self._floor_of(fits[0])
        points = [self._nuisances.point(fit.deviations, fit.effects) for fit in fits]
        return [differences(floor, self.problem, predicted) for predicted in self.problem.predicted_many(points)]

    @staticmethod
    def _gap(squares: Floats) -> float:
        return float(np.sqrt(squares.mean())) if len(squares) else math.nan
