"""Fits of one effect and of two: the few that the linear model of the rig promises most, refitted."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bench.judge.linear.rig import Rig
from bridge.arrays import Floats
from diagnosis.fits.batch import Work, together
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.refits import Start, best_of_each, refits
from diagnosis.fits.screening import Screened, Screening, beside, of_changes
from diagnosis.hypotheses.hypothesis import NOTHING
from diagnosis.hypotheses.starts import Trial

Names = frozenset[str]
# Effects that get two steps of a refit, and how many go on to the end. Fewer: a right effect is passed over, as the promise of a
# trial is linear. More: 0.5 s and 2 s of CPU each.
_QUICK, _FULL, _FULL_PAIRS = 6, 2, 1
_LARGER = (3.0, 10.0)  # times the promised size, that a refit may begin with as well: one prediction each
# Second effects on top of the best one, and pairs by the columns of the rig without effects, that get two steps.
_SECOND, _PAIRS = 3, 1
_NEAR = 0.6  # of the remainder without effects: an effect that leaves more may win by a better valley of a jagged chi2


class Moved(NamedTuple):
    """The trials, and the features of each on the rig without effects."""

    trials: list[Trial]
    base: Floats  # [features]
    moved: list[Floats]  # [features] each

    def promised(self, fitter: Fitter, fit: Fit, paired: bool = False) -> Screening:
        """Promises of the trials on top of a fit, by the columns of the rig without effects."""
        slope = fitter.whitened(fitter.predicted(fit.deviations, fit.effects))[1]
        trials = beside(fit, self.trials)
        kept = {id(trial) for trial in trials}
        changes = [
            fitter.column(self.base, moved, slope)
            for trial, moved in zip(self.trials, self.moved, strict=True)
            if id(trial) in kept
        ]
        return of_changes(fitter, fit, trials, changes, paired)


def moved_by(rig: Rig, trials: list[Trial]) -> Moved:
    """One prediction for each trial."""
    points = [(rig.fit.deviations, trial.hypothesis.tables(trial.w)) for trial in trials]
    base, *moved = rig.fitter.predicted_many([(rig.fit.deviations, {}), *points])
    return Moved(trials, base, moved)


def singles_of(rig: Rig, promises: Screening, shown: Names) -> list[Fit]:
    """The refits of the effects that promise most, the lowest chi2 first; `shown` effects are refitted anyway."""
    best = best_of_each(promises.singles)
    starts = best[:_QUICK] + [start for start in best[_QUICK:] if set(start.hypothesis.effects) <= shown]
    return _refitted(rig.fitter, starts, _FULL)


def nothing_again(rig: Rig, singles: Sequence[Fit]) -> Fit:
    """The rig without effects, from the numbers of its nearest rival as well: more starts find deeper valleys of chi2."""
    near = [(NOTHING, fit.deviations, np.zeros(0)) for fit in singles[:1] if fit.chi2 > _NEAR * rig.fit.chi2]
    return min([rig.fit, *refits(rig.fitter, near, 1)], key=lambda fit: fit.chi2)


def pairs_of(rig: Rig, moved: Moved, pairs: Sequence[Screened], best: Fit, shown: Names) -> list[Fit]:
    """The best single effect with the effects that relations show and trials promise on top of it, and the promised pairs."""
    promised = best_of_each(moved.promised(rig.fitter, best).singles)
    others = [start for start in promised if set(start.hypothesis.effects) & (shown - set(best.effects))]
    starts = best_of_each([*others, *promised[:_SECOND], *pairs[:_PAIRS]])
    return _refitted(rig.fitter, starts, _FULL_PAIRS)


def _refitted(fitter: Fitter, starts: Sequence[Screened], full: int) -> list[Fit]:
    """The best fit of every set of effects: two steps each, and the best `full` of them to the end."""
    quick = together(fitter.predicted_many, [_quick(fitter, start) for start in starts])
    quick = best_of_each(sorted(quick, key=lambda fit: fit.chi2))
    further: list[Start] = [(fit.hypothesis, fit.deviations, fit.w) for fit in quick[:full]]
    return best_of_each(sorted([*refits(fitter, further, 1), *quick], key=lambda fit: fit.chi2))


def _quick(fitter: Fitter, start: Screened) -> Work[Fit]:
    """Two steps from the best of the promised start and of larger sizes, from where the rig is described.

    A large effect is not linear, and the refitted rig has taken up a part of it.
    """
    described = np.zeros_like(start.deviations)
    larger = [(described, _times(start, factor)) for factor in _LARGER] if len(start.hypothesis.effects) == 1 else []
    return fitter.quick(start.hypothesis, ((start.deviations, start.w), *start.others, *larger))


def _times(start: Screened, factor: float) -> Floats:
    """The coordinates of a start whose effect is larger by a factor."""
    w = start.w.copy()
    first = start.hypothesis.coordinates[0]
    if first.logarithmic:
        w[0] += -0.5 * math.log(factor) if first.name in {"corner_Hz", "resonance_Hz"} else math.log(factor)
    else:
        w[0] *= factor
    return w
