"""An estimate of the gain of each trial, from one or two predictions: enough to choose the refits, and to begin them.

A trial's direction is freed of the nuisances, which move along.
"""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.fits.fit import Fit, prior_of, step_within
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.hypotheses.starts import Trial

# Bounds of a screened start: times the trial's own size, and tolerances of a nuisance. Too small: large effects look too small
# to matter. Too large: starts lie where the derivatives no longer hold.
_FURTHEST = 8.0
_FURTHEST_TOLERANCES = 3.0  # of a nuisance
_LEAST_POWER = 1e-6  # of a direction, in chi2: less changes nothing


class Screened(NamedTuple):
    """A trial with a better start, and the chi2 that it promises."""

    hypothesis: Hypothesis  # the trial's effects, and the effects of the fit that the trial is added to
    deviations: Floats  # start of the nuisances, in tolerances [nuisances]
    w: Floats  # start of the coordinates [coordinates]
    chi2: float


class Column(NamedTuple):
    """The change by a trial."""

    trial: Trial
    change: Floats  # of the whitened differences [compared]
    direction: Floats  # the change freed of the nuisances [compared + parameters]


class Directions:
    """The columns of a fit's nuisances and coordinates, which may move along with a further direction.

    A nuisance at its bound stays there; if it went beyond, it would take the place of an effect (docs/method/diagnosis.md).
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

    def moved(self, change: Floats) -> Floats:
        """Nuisances and coordinates [parameters] after a change [compared] is taken out of the differences."""
        rest = self.residual.copy()
        rest[: len(change)] -= change
        return self._at + self._inverse @ (self._columns.T @ rest)


def added(base: Hypothesis, more: Hypothesis) -> Hypothesis:
    """A hypothesis with the effects of both."""
    return Hypothesis(base.forms | more.forms, (*base.coordinates, *more.coordinates))


def beside(base: Fit, trials: list[Trial]) -> list[Trial]:
    """The trials of effects that a fit does not have."""
    return [trial for trial in trials if not set(trial.hypothesis.effects) & set(base.hypothesis.effects)]


def of_changes(fitter: Fitter, base: Fit, trials: list[Trial], changes: list[Floats]) -> list[Screened]:
    """Every trial whose change [compared] is known, on top of `base`, at the size of the lowest chi2 if all were linear."""
    directions = Directions(base, fitter.most)
    starts: list[Screened] = []
    for trial, change in zip(trials, changes, strict=True):
        direction = directions.freed(change)
        power = float(direction @ direction)
        if power >= _LEAST_POWER:
            towards = float(direction @ directions.left)
            size = min(max(towards / power, _bounds(trial)[0]), _bounds(trial)[1])
            chi2 = float(directions.left @ directions.left) - 2.0 * size * towards + size**2 * power
            starts.append(_start(base, directions, trial, size, change, chi2))
    return sorted(starts, key=lambda start: start.chi2)


def eased(fit: Fit, hypothesis: Hypothesis, at: tuple[Floats, Floats], residual: Floats) -> Screened:
    """A start after one step of the nuisances, and of the effects of `fit`, along the columns of `fit`.

    Args:
        fit: gives the columns; its effects are the first of the hypothesis.
        hypothesis: effects of the start.
        at: deviations and coordinates of the start.
        residual: whitened differences there [compared].

    """
    deviations, w = at
    first = len(fit.w)
    own = np.concatenate([deviations, w[:first]])
    held = prior_of(fit.hypothesis, deviations)
    columns = np.vstack([fit.columns, np.diag(held)])
    rest = np.concatenate([residual, -held * own])
    step = np.linalg.lstsq(columns, rest, rcond=None)[0]
    step[: len(deviations)] = (
        np.clip(own + step, -_FURTHEST_TOLERANCES, _FURTHEST_TOLERANCES)[: len(deviations)] - deviations
    )
    left = rest - columns @ step
    others = prior_of(hypothesis, deviations)[len(own) :] * w[first:]
    moved = own + step
    chi2 = float(left @ left + others @ others)
    return Screened(hypothesis, moved[: len(deviations)], np.concatenate([moved[len(deviations) :], w[first:]]), chi2)


def _bounds(trial: Trial) -> tuple[float, float]:
    """Of a trial's size, in times its own."""
    return (1.0 / _FURTHEST if trial.hypothesis.coordinates[0].logarithmic else -_FURTHEST), _FURTHEST


def _start(base: Fit, directions: Directions, trial: Trial, size: float, change: Floats, chi2: float) -> Screened:
    """A trial at this size on top of a fit."""
    w = trial.w.copy()
    first = trial.hypothesis.coordinates[0]
    if first.logarithmic:
        w[0] += (-0.5 if first.name in {"corner_Hz", "resonance_Hz"} else 1.0) * math.log(size)  # larger is less
    else:
        w[0] *= size
    moved = directions.moved(size * change)
    count = len(base.deviations)
    deviations = np.clip(moved[:count], -_FURTHEST_TOLERANCES, _FURTHEST_TOLERANCES)
    return Screened(added(base.hypothesis, trial.hypothesis), deviations, np.concatenate([moved[count:], w]), chi2)
