"""From every effect of the library to the few that are refitted in full.

Screening only shortlists: one simulation a trial says how much of the remaining difference its direction could take, nuisances
moving along. It is done twice, where the rig was retuned and where it was described: a large effect pulls the retuned rig far
away, into a valley of its own. What survives is refitted, and only the refit counts.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.library import Trial
from diagnosis.refit import QUICK, Fit, Fitter, Form

Floats = npt.NDArray[np.float64]
_QUICK = 10  # trials of either screening that get two steps of a refit
_FULL = 4  # effects that are refitted to the end,
_WORTH_FULL = 0.2  # of the best one's gain, or they are too far behind to matter
_FURTHEST = 8.0  # times the starting size that a screening may go
_FURTHEST_TOLERANCES = 3.0


class Screened(NamedTuple):
    """A trial with a better start, and the chi2 that its direction would leave if everything were linear."""

    form: Form  # with the effects of the base
    deviations: Floats
    w: Floats
    chi2: float


class Directions:
    """The nuisances' columns at a fit, to let them move along with any other direction."""

    def __init__(self, fit: Fit) -> None:
        held = [1.0] * len(fit.deviations) + [1.0 / axis.prior for axis in fit.form.axes]
        self._at = np.concatenate([fit.deviations, fit.w])
        self._columns = np.vstack([fit.columns, np.diag(held)])
        self.residual = np.concatenate([fit.residual, -np.array(held) * self._at])
        self._inverse = np.linalg.inv(self._columns.T @ self._columns)
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


def added(base: Form, more: Form) -> Form:
    """Both effects at once."""
    return Form(base.forms | more.forms, (*base.axes, *more.axes))


def _screen(fitter: Fitter, base: Fit, knee: float, directions: Directions, trial: Trial) -> Screened | None:
    """Scale a trial's start so that it explains most; nothing where it changes nothing."""
    here = fitter.predicted(base.deviations, base.effects)
    _, slope = fitter.whitened(here, knee)
    there = fitter.predicted(base.deviations, base.effects | trial.form.tables(trial.w))
    column = fitter.column(here, there, slope)
    direction = directions.freed(column)
    power = float(direction @ direction)
    if power < 1e-6:
        return None
    along = float(direction @ directions.left)
    size = along / power
    w = trial.w.copy()
    if trial.form.axes[0].logarithmic:
        size = min(max(size, 1.0 / _FURTHEST), _FURTHEST)
        rolls_off = trial.form.axes[0].name in {"corner_Hz", "resonance_Hz"}  # larger is less
        w[0] += (-0.5 if rolls_off else 1.0) * math.log(size)
    else:
        size = min(max(size, -_FURTHEST), _FURTHEST)
        w[0] *= size
    moved = directions.moved(column, size)
    own = len(base.deviations)
    deviations = np.clip(moved[:own], -_FURTHEST_TOLERANCES, _FURTHEST_TOLERANCES)
    chi2 = float(directions.left @ directions.left) - 2.0 * size * along + size * size * power
    return Screened(added(base.form, trial.form), deviations, np.concatenate([moved[own:], w]), chi2)


def refitted(fitter: Fitter, origins: list[tuple[Fit, float]], trials: list[Trial]) -> list[Fit]:
    """The best fit of every effect that was worth one, each in its best form, best first.

    Args:
        origins: fits to start from, each with the knee it was fitted under; the first is the one to improve on.
        trials: what to add.

    """
    quickly: list[Fit] = []
    for base, knee in origins:
        directions = Directions(base)
        screened = [one for trial in trials if (one := _screen(fitter, base, knee, directions, trial)) is not None]
        screened.sort(key=lambda one: one.chi2)
        for one in screened[:_QUICK]:
            fit = fitter.fit(one.form, one.deviations, one.w, QUICK)
            quickly.append(fitter.judged(fit))
    quickly.sort(key=lambda fit: fit.chi2)
    best = _best_of_each(quickly)
    gain = origins[0][0].chi2 - best[0].chi2 if best else 0.0
    worth = [fit for fit in best[:_FULL] if origins[0][0].chi2 - fit.chi2 > _WORTH_FULL * gain]
    names = {fit.form.effects for fit in worth}
    finished: list[Fit] = []
    for effects in names:
        forms = _best_of_each([fit for fit in quickly if fit.form.effects == effects], by_form=True)
        finished += [fitter.refit(fit.form, fit.deviations, fit.w) for fit in forms[:2]]
    finished += [fit for fit in best if fit.form.effects not in names]
    finished.sort(key=lambda fit: fit.chi2)
    return _best_of_each(finished)


def _best_of_each(fits: list[Fit], by_form: bool = False) -> list[Fit]:
    """The first fit of every effect, or of every form of it, in their order."""
    seen: set[tuple[tuple[str, str], ...]] = set()
    result: list[Fit] = []
    for fit in fits:
        key = tuple((name, form if by_form else "") for name, form in fit.form.forms.items())
        if key not in seen:
            seen.add(key)
            result.append(fit)
    return result
