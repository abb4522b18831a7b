"""What every trial promises, from derivatives at the baseline: cheap, and only good enough to choose what is refitted."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.fits.fit import Fit, step_within
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.gap.floor import KNEE
from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.hypotheses.trials import Trial
from diagnosis.processes import each

Floats = npt.NDArray[np.floating[Any]]

_FURTHEST = 8.0  # times the starting size that a screening may go
_FURTHEST_TOLERANCES = 3.0


class Screened(NamedTuple):
    """A trial with a better start, and the chi2 that its direction would leave if everything were linear."""

    hypothesis: Hypothesis  # with the effects of the base
    deviations: Floats
    w: Floats
    chi2: float  # infinite where nothing was screened
    others: tuple[tuple[Floats, Floats], ...]  # more starts, deviations and w: a refit takes the best of all


class Origin(NamedTuple):
    """A fit of the rig without effects that a search starts from, and the knee it was fitted under."""

    fit: Fit
    knee: float


class _Base(NamedTuple):
    """A fit that trials are added to, what it predicts [features] and the slope of the compression there [compared]."""

    fit: Fit
    predicted: Floats
    slope: Floats
    directions: "Directions"


class Directions:
    """The nuisances' columns at a fit, to let them move along with any other direction.

    What stands at its bound stays there. Where it was let go beyond, it took what a longer delay of the force would have taken:
    chi2 585, 268 left without any effect, 167 with the delay, which was never tried.
    """

    def __init__(self, fit: Fit, most: Floats) -> None:
        held = [1.0] * len(fit.deviations) + [1.0 / axis.prior for axis in fit.hypothesis.coordinates]
        self._at = np.concatenate([fit.deviations, fit.w])
        columns = np.vstack([fit.columns, np.diag(held)])
        self.residual = np.concatenate([fit.residual, -np.array(held) * self._at])
        _, free = step_within(columns.T @ columns, columns.T @ self.residual, self._at, most)
        self._columns = columns * free
        self._inverse = np.linalg.inv(self._columns.T @ self._columns + np.diag(1.0 - free))
        self.left = self.freed(self.residual)

    def freed(self, column: Floats) -> Floats:
        """What is left of a whitened direction [compared] when the nuisances move along, [compared + nuisances]."""
        full = np.concatenate([column, np.zeros(len(self.residual) - len(column))])
        return full - self._columns @ (self._inverse @ (self._columns.T @ full))

    def moved(self, column: Floats, size: float) -> Floats:
        """Where nuisances and axes go when `size` of a direction [compared] is taken out of the differences."""
        rest = self.residual.copy()
        rest[: len(column)] -= size * column
        return self._at + self._inverse @ (self._columns.T @ rest)


def added(base: Hypothesis, more: Hypothesis) -> Hypothesis:
    """Both effects at once."""
    return Hypothesis(base.forms | more.forms, (*base.coordinates, *more.coordinates))


def _screen(fitter: Fitter, origin: _Base, trial: Trial, there: Floats) -> Screened | None:
    """Scale a trial's start, where the model predicts `there`, so that it explains most; nothing where it changes nothing."""
    base, directions = origin.fit, origin.directions
    column = fitter.column(origin.predicted, there, origin.slope)
    direction = directions.freed(column)
    power = float(direction @ direction)
    if power < 1e-6:
        return None
    along = float(direction @ directions.left)
    size = along / power
    w = trial.w.copy()
    if trial.hypothesis.coordinates[0].logarithmic:
        size = min(max(size, 1.0 / _FURTHEST), _FURTHEST)
        rolls_off = trial.hypothesis.coordinates[0].name in {"corner_Hz", "resonance_Hz"}  # larger is less
        w[0] += (-0.5 if rolls_off else 1.0) * math.log(size)
    else:
        size = min(max(size, -_FURTHEST), _FURTHEST)
        w[0] *= size
    moved = directions.moved(column, size)
    own = len(base.deviations)
    deviations = np.clip(moved[:own], -_FURTHEST_TOLERANCES, _FURTHEST_TOLERANCES)
    chi2 = float(directions.left @ directions.left) - 2.0 * size * along + size * size * power
    unmoved = (base.deviations, np.concatenate([base.w, w]))
    return Screened(
        added(base.hypothesis, trial.hypothesis), deviations, np.concatenate([moved[own:], w]), chi2, (unmoved,)
    )


def screened(fitter: Fitter, origins: list[Origin], trials: list[Trial], jobs: int = 1) -> list[list[Screened]]:
    """All trials that change anything from each origin, the most promising first."""
    return [_screened(fitter, one.fit, one.knee, trials, jobs) for one in origins]


def _screened(fitter: Fitter, base: Fit, knee: float, trials: list[Trial], jobs: int) -> list[Screened]:
    """All trials that change anything, the most promising first."""
    shares = each(jobs, _screened_share, fitter, [(base, knee, trials[i::jobs]) for i in range(jobs)])
    # in the order of the trials, or which of two as good comes first would depend on `jobs`
    in_order = (shares[number % jobs][number // jobs] for number in range(len(trials)))
    return sorted((one for one in in_order if one is not None), key=lambda one: one.chi2)


def beside_origin(fitter: Fitter, first: Fit, trials: list[Trial], jobs: int) -> list[Screened]:
    """The trials of other effects beside one that is there."""
    others = [trial for trial in trials if not set(trial.hypothesis.effects) & set(first.hypothesis.effects)]
    return _screened(fitter, first, KNEE, others, jobs)


def _screened_share(fitter: Fitter, work: tuple[Fit, float, list[Trial]]) -> list[Screened | None]:
    base, knee, trials = work
    predicted = fitter.predicted(base.deviations, base.effects)
    origin = _Base(base, predicted, fitter.whitened(predicted, knee)[1], Directions(base, fitter.most))
    there = fitter.predicted_many(
        [(base.deviations, base.effects | trial.hypothesis.tables(trial.w)) for trial in trials]
    )
    return [_screen(fitter, origin, *one) for one in zip(trials, there, strict=True)]
