"""From every effect of the library to the few that are refitted in full.

Screening only shortlists: one simulation a trial says how much of the remaining difference its direction could take, nuisances
moving along. What survives is refitted, and only the refit counts.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.library import Trial
from diagnosis.refit import Fit, Fitter, Form

Floats = npt.NDArray[np.float64]
Map = Callable[[Callable[[Trial], "Screened"], list[Trial]], list["Screened"]]
_QUICK = 16  # trials that get one step of a refit
_FULL = 7  # effects that are refitted to the end
_FURTHEST = 8.0  # times the starting size that a screening may go


class Screened(NamedTuple):
    """A trial with a better start, and how far chi2 would fall if its direction were all there is."""

    trial: Trial
    gain: float


class Directions:
    """The nuisances' columns at a fit, to take out of any other direction what they could do as well."""

    def __init__(self, fit: Fit) -> None:
        held = [1.0] * len(fit.deviations) + [1.0 / axis.prior for axis in fit.form.axes]
        at = np.concatenate([fit.deviations, fit.w])
        self._columns = np.vstack([fit.columns, np.diag(held)])
        self.residual = np.concatenate([fit.residual, -np.array(held) * at])
        self._inverse = np.linalg.inv(self._columns.T @ self._columns)

    def freed(self, column: Floats) -> Floats:
        """What is left of a whitened direction [compared] when the nuisances move along, [compared + nuisances]."""
        full = np.concatenate([column, np.zeros(len(self.residual) - len(column))])
        return full - self._columns @ (self._inverse @ (self._columns.T @ full))


def added(base: Form, more: Form) -> Form:
    """Both effects at once."""
    return Form(base.forms | more.forms, (*base.axes, *more.axes))


def screen(fitter: Fitter, base: Fit, directions: Directions, trial: Trial) -> Screened:
    """Scale a trial's start so that it explains most, and say how much that is."""
    here = fitter.predicted(base.deviations, base.effects)
    _, slope = fitter.whitened(here)
    there = fitter.predicted(base.deviations, base.effects | trial.form.tables(trial.w))
    direction = directions.freed(fitter.column(there - here, slope))
    power = float(direction @ direction)
    if power < 1e-6:
        return Screened(trial, 0.0)
    size = float(direction @ directions.residual) / power
    w = trial.w.copy()
    if trial.form.axes[0].logarithmic:
        size = min(max(size, 1.0 / _FURTHEST), _FURTHEST)
        rolls_off = trial.form.axes[0].name in {"corner_Hz", "resonance_Hz"}  # larger is less
        w[0] += (-0.5 if rolls_off else 1.0) * math.log(size)
    else:
        w[0] *= min(max(size, -_FURTHEST), _FURTHEST)
    gain = 2.0 * size * float(direction @ directions.residual) - size * size * power
    return Screened(Trial(trial.form, w), gain)


def refitted(fitter: Fitter, base: Fit, trials: list[Trial], run: "Runner") -> list[Fit]:
    """The best fit of every effect that was worth one, best first. Each effect with its best form."""
    directions = Directions(base)
    screened = run(lambda trial: screen(fitter, base, directions, trial), trials)
    screened.sort(key=lambda one: -one.gain)

    def quick(trial: Trial) -> Fit:
        return fitter.fit(added(base.form, trial.form), base.deviations, np.concatenate([base.w, trial.w]), steps=1)

    quickly = run(quick, [one.trial for one in screened[:_QUICK]])
    quickly.sort(key=lambda fit: fit.chi2)
    best: list[Fit] = []
    full: set[tuple[str, ...]] = set()
    for fit in quickly:
        names = fit.form.effects
        if len(full) < _FULL or names in full:
            full.add(names)
            best.append(fit)
    finished = run(lambda fit: fitter.fit(fit.form, fit.deviations, fit.w), best)
    finished += [fit for fit in quickly if fit.form.effects not in full]
    finished.sort(key=lambda fit: fit.chi2)
    seen: set[tuple[str, ...]] = set()
    result: list[Fit] = []
    for fit in finished:
        if fit.form.effects not in seen:
            seen.add(fit.form.effects)
            result.append(fit)
    return result


class Runner:
    """Runs a function over a list, in this process."""

    def __call__(self, function, items):
        return [function(item) for item in items]
