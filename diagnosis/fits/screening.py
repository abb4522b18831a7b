"""An estimate of what each trial gains, from derivatives at the baseline: cheap, and good enough to choose what to refit."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.fits.fit import Fit, step_within
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.gap.floor import KNEE
from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.hypotheses.starts import Trial
from diagnosis.processes import each

Floats = npt.NDArray[np.floating[Any]]

# Bounds of a screened start: times the trial's own size, and tolerances of a nuisance. Too small: large effects look too small
# to matter. Too large: starts lie where the derivatives no longer hold.
_FURTHEST = 8.0
_FURTHEST_TOLERANCES = 3.0


class Screened(NamedTuple):
    """A trial with a better start, and the chi2 that would be left if the model were linear."""

    hypothesis: Hypothesis  # the trial's effects together with those of the fit that the trial is added to
    deviations: Floats  # start of the nuisances, in tolerances [nuisances]
    w: Floats  # start of the coordinates [coordinates]
    chi2: float  # infinite for a start that was not screened
    others: tuple[tuple[Floats, Floats], ...]  # further starts, deviations and w; a refit takes the best of all starts


class Origin(NamedTuple):
    """A fit without effects that a search starts from, and the knee of the compression that it was fitted under."""

    fit: Fit
    knee: float


class _Base(NamedTuple):
    """A fit that trials are added to, with the prediction and the nuisances' directions there."""

    fit: Fit
    predicted: Floats  # [features]
    slope: Floats  # derivative of the compression [compared]
    directions: "Directions"


class Directions:
    """The columns of a fit's nuisances and coordinates, which may move along with a further direction.

    A nuisance at its bound stays there; if it went beyond, it would take what an effect causes (docs/method/fits.md).
    """

    def __init__(self, fit: Fit, most: Floats) -> None:
        held = [1.0] * len(fit.deviations) + [1.0 / coordinate.prior for coordinate in fit.hypothesis.coordinates]
        self._at = np.concatenate([fit.deviations, fit.w])
        columns = np.vstack([fit.columns, np.diag(held)])
        self.residual = np.concatenate([fit.residual, -np.array(held) * self._at])
        _, free = step_within(columns.T @ columns, columns.T @ self.residual, self._at, most)
        self._columns = columns * free
        self._inverse = np.linalg.inv(self._columns.T @ self._columns + np.diag(1.0 - free))
        self.left = self.freed(self.residual)

    def freed(self, column: Floats) -> Floats:
        """The rest of a whitened direction [compared] when nuisances and coordinates move along [compared + parameters]."""
        full = np.concatenate([column, np.zeros(len(self.residual) - len(column))])
        return full - self._columns @ (self._inverse @ (self._columns.T @ full))

    def moved(self, column: Floats, size: float) -> Floats:
        """Nuisances and coordinates [parameters] after `size` times a direction [compared] is taken out of the differences."""
        rest = self.residual.copy()
        rest[: len(column)] -= size * column
        return self._at + self._inverse @ (self._columns.T @ rest)


def added(base: Hypothesis, more: Hypothesis) -> Hypothesis:
    """A hypothesis with the effects of both."""
    return Hypothesis(base.forms | more.forms, (*base.coordinates, *more.coordinates))


def _screen(fitter: Fitter, origin: _Base, trial: Trial, there: Floats) -> Screened | None:
    """Scale a trial's start, where the model predicts `there` [features], so that chi2 is least; None if nothing changes."""
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
    """For each origin all trials that change a prediction, the lowest estimated chi2 first; in `jobs` processes."""
    return [_screened(fitter, one.fit, one.knee, trials, jobs) for one in origins]


def _screened(fitter: Fitter, base: Fit, knee: float, trials: list[Trial], jobs: int) -> list[Screened]:
    """All trials that change a prediction, the lowest estimated chi2 first."""
    shares = each(jobs, _screened_share, fitter, [(base, knee, trials[i::jobs]) for i in range(jobs)])
    # in the order of the trials: otherwise `jobs` would decide which of two equal trials comes first
    in_order = (shares[number % jobs][number // jobs] for number in range(len(trials)))
    return sorted((one for one in in_order if one is not None), key=lambda one: one.chi2)


def beside_origin(fitter: Fitter, first: Fit, trials: list[Trial], jobs: int) -> list[Screened]:
    """The trials of all other effects, screened in addition to the effects of `first`; the lowest estimated chi2 first."""
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
