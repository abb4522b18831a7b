"""An estimate of the gain of each trial and each pair of trials, from one prediction a trial: enough to choose the refits.

All directions are freed of the nuisances, which move along. From their inner products follow the gains of every trial alone and
of every pair of trials; no further prediction is needed.
"""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.fits.fit import Fit, step_within
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.hypotheses.starts import Trial

# Bounds of a screened start: times the trial's own size, and tolerances of a nuisance. Too small: large effects look too small
# to matter. Too large: starts lie where the derivatives no longer hold.
_FURTHEST = 8.0
_FURTHEST_TOLERANCES = 3.0  # of a nuisance
_LEAST_POWER = 1e-6  # of a direction, in chi2: less changes nothing
_LEAST_APART = 0.01  # sine squared of the angle between two directions, from which they are two
_PAIRS = 8  # of effects that a screening keeps


class Screened(NamedTuple):
    """A trial with a better start, and the chi2 that would be left if the model were linear."""

    hypothesis: Hypothesis  # the trial's effects, and the effects of the fit that the trial is added to
    deviations: Floats  # start of the nuisances, in tolerances [nuisances]
    w: Floats  # start of the coordinates [coordinates]
    chi2: float  # infinite for a start that was not screened
    others: tuple[tuple[Floats, Floats], ...]  # further starts, deviations and w; a refit takes the best of all starts


class Screening(NamedTuple):
    """The gains that the trials promise, the lowest estimated chi2 first."""

    singles: list[Screened]  # every trial that changes a prediction
    pairs: list[Screened]  # the best pair of trials of every two effects, the first few


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


def of_changes(fitter: Fitter, base: Fit, trials: list[Trial], changes: list[Floats], paired: bool = True) -> Screening:
    """The promises of trials whose changes [compared] are known, in addition to the effects of `base`."""
    directions = Directions(base, fitter.most)
    columns = [Column(trial, change, directions.freed(change)) for trial, change in zip(trials, changes, strict=True)]
    columns = [column for column in columns if float(column.direction @ column.direction) >= _LEAST_POWER]
    if not columns:
        return Screening([], [])
    inner = np.stack([column.direction for column in columns])
    towards = inner @ directions.left
    inner = inner @ inner.T
    low, high = np.array([_bounds(column.trial) for column in columns]).T
    left = float(directions.left @ directions.left)
    sizes = np.clip(towards / np.diag(inner), low, high)
    alone = left - 2.0 * sizes * towards + sizes**2 * np.diag(inner)
    singles = [
        _start(base, directions, [column], [size], chi2)
        for column, size, chi2 in zip(columns, sizes.tolist(), alone.tolist(), strict=True)
    ]
    best = best_pairs(columns, inner, towards, (low, high), left) if paired else []
    pairs = [_start(base, directions, [columns[i], columns[j]], sizes, chi2) for i, j, sizes, chi2 in best]
    return Screening(sorted(singles, key=lambda single: single.chi2), pairs)


def _bounds(trial: Trial) -> tuple[float, float]:
    """Of a trial's size, in times its own."""
    return (1.0 / _FURTHEST if trial.hypothesis.coordinates[0].logarithmic else -_FURTHEST), _FURTHEST


def best_pairs(
    columns: list[Column], inner: Floats, towards: Floats, bounds: tuple[Floats, Floats], left: float
) -> list[tuple[int, int, list[float], float]]:
    """The best two trials of every two effects: their numbers, sizes and estimated chi2; the first `_PAIRS`."""
    first, second = np.triu_indices(len(columns), 1)
    a, b, c = inner[first, first], inner[second, second], inner[first, second]
    apart = np.maximum(a * b - c * c, _LEAST_APART * a * b)  # of two directions that are one, one alone would do
    sizes = np.stack(
        [(b * towards[first] - c * towards[second]) / apart, (a * towards[second] - c * towards[first]) / apart]
    )
    low, high = bounds
    sizes = np.clip(sizes, np.stack([low[first], low[second]]), np.stack([high[first], high[second]]))
    first_size, other = sizes
    chi2 = left - 2.0 * (first_size * towards[first] + other * towards[second])
    chi2 += first_size**2 * a + other**2 * b + 2.0 * first_size * other * c
    names = [column.trial.hypothesis.effects[0] for column in columns]
    seen: set[frozenset[str]] = set()
    pairs: list[tuple[int, int, list[float], float]] = []
    for k in np.argsort(chi2, kind="stable").tolist():
        i, j = int(first[k]), int(second[k])
        both = frozenset((names[i], names[j]))
        if len(both) == 2 and both not in seen:
            seen.add(both)
            pairs.append((i, j, sizes[:, k].tolist(), float(chi2[k])))
            if len(pairs) == _PAIRS:
                break
    return pairs


def _start(base: Fit, directions: Directions, columns: list[Column], sizes: list[float], chi2: float) -> Screened:
    """Trials at these sizes on top of a fit."""
    change = np.zeros_like(columns[0].change)
    hypothesis, coordinates = base.hypothesis, [base.w]
    for column, size in zip(columns, sizes, strict=True):
        w = column.trial.w.copy()
        first = column.trial.hypothesis.coordinates[0]
        if first.logarithmic:
            w[0] += (-0.5 if first.name in {"corner_Hz", "resonance_Hz"} else 1.0) * math.log(size)  # larger is less
        else:
            w[0] *= size
        change += size * column.change
        hypothesis = added(hypothesis, column.trial.hypothesis)
        coordinates.append(w)
    moved = directions.moved(change)
    count = len(base.deviations)
    deviations = np.clip(moved[:count], -_FURTHEST_TOLERANCES, _FURTHEST_TOLERANCES)
    unmoved = np.concatenate(coordinates)
    # a large effect may have pulled the nuisances into another valley: the rig as described is a start as well
    others = ((base.deviations, unmoved), (np.zeros_like(base.deviations), unmoved))
    return Screened(hypothesis, deviations, np.concatenate([moved[count:], *coordinates[1:]]), chi2, others)
