"""Fits of one effect and of two: the few that the linear model of the rig promises most, refitted."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from bridge.arrays import Floats
from diagnosis.fits.baseline import Baseline, Progress
from diagnosis.fits.batch import Work, together
from diagnosis.fits.evidence import NOISE, cost_of_freedom, of_remainder
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.refits import Start, best_of_each, each_beside, refits
from diagnosis.fits.screening import Screened, Screening, beside, of_changes
from diagnosis.hypotheses.hypothesis import LEVELS, NOTHING
from diagnosis.hypotheses.starts import Trial
from diagnosis.processes import spread

Names = frozenset[str]
# Effects that get two steps of a refit, and how many go on to the end. Fewer: a right effect is passed over, as the promise of a
# trial is linear. More: 0.5 s and 2 s of CPU each.
_QUICK, _FULL, _FULL_PAIRS = 6, 2, 1
_SIZES = (
    -2.0,
    -1.0,
    -0.5,
    0.5,
    1.0,
    2.0,
)  # of a level's scale, at which a refit may begin, with the other numbers as described
_LARGER = (3.0, 10.0)  # times the promised size, that a refit may begin with as well: one prediction each
# Second effects on top of the best one, and pairs by the columns of the rig without effects, that get two steps.
_SECOND, _PAIRS = 3, 1
_NEAR = 0.6  # of the remainder without effects: an effect that leaves more may win by a better valley of a jagged chi2
# Pairs are tried where the best single effect leaves more than this many times a right explanation's remainder,
_MUCH_LEFT = 2.0
_CLOSES = 0.8  # and has a relation that shows it, or leaves less than this share of the remainder without effects.


class Search:
    """The fits of explanations. Its attributes are valid at any time, also where the time ends within `run`.

    Attributes:
        rig: the rig without effects; it may be found better on the way.
        fits: the best fit of each set of effects; the first is the rig without effects.
        promised: the best start of each set of effects by the linear model of the rig.

    """

    def __init__(self, rig: Baseline, trials: list[Trial], related: Callable[[Names], float], jobs: int = 1) -> None:
        """`related`: log evidence of the relations for a set of effects, against no effect."""
        self.rig = rig
        self.fits = [rig.fit]
        self.promised: dict[Names, Screened] = {}
        self._trials, self._related, self._jobs = trials, related, jobs
        self._base = np.zeros(0)  # features of the rig without effects [features]
        self._moved: list[Floats] = []  # the same with each trial

    @property
    def left(self) -> dict[Names, float]:
        """chi2 of every set of effects; by the linear model of the rig where it has no fit."""
        promised = {names: max(start.chi2, 0.0) for names, start in self.promised.items()}
        return promised | {frozenset(fit.effects): fit.chi2 for fit in self.fits}

    def run(self, shown: Names, progress: Progress) -> None:
        """Predict every trial once, refit those that promise most, then pairs; effects that are `shown` are refitted anyway."""
        self._predict()
        promises = self._promises(self.rig.fit, paired=True)
        of_each = best_of_each([*promises.singles, *promises.pairs])
        self.promised = {frozenset(start.hypothesis.effects): start for start in of_each}
        progress("every effect was tried once; the leading ones are fitted", 0.45)
        best = best_of_each(promises.singles)
        asked = shown | LEVELS.keys()
        starts = best[:_QUICK] + [start for start in best[_QUICK:] if asked.issuperset(start.hypothesis.effects)]
        singles = refitted(self.rig.fitter, starts, _FULL, self._jobs)
        self._improve_baseline(singles)
        self.fits = [self.rig.fit, *singles]
        for lead in sorted(singles, key=lambda fit: -self._worth(fit))[:1]:
            founded = lead.chi2 < _CLOSES * self.rig.fit.chi2 or self._related(frozenset(lead.effects)) > 0.0
            if founded and lead.chi2 > _MUCH_LEFT * NOISE * len(lead.residual):
                progress(f"best single effect: {', '.join(lead.effects)}; looking for a second", 0.65)
                self.fits += self._pairs(promises.pairs, lead, shown)

    def fitted(self, names: Names) -> Fit | None:
        """The fit of these effects; None without one."""
        return next((fit for fit in self.fits if frozenset(fit.effects) == names), None)

    def add(self, names: Names) -> bool:
        """Fit these effects; False where that was done, or no trial has them."""
        if self.fitted(names) is not None or (start := self.promised.get(names) or self._beside(names)) is None:
            return False
        self.fits += refitted(self.rig.fitter, [start], 1)
        return True

    def of(self, names: Names) -> Fit | None:
        """The fit of these effects, refitted as long as that gains; None where no trial has them."""
        self.add(names)
        fit = self.fitted(names)
        if fit is None or not names:
            return fit
        return together(self.rig.fitter.predicted_many, [self.rig.fitter.going_further(fit)])[0]

    def _predict(self) -> None:
        at = self.rig.fit.deviations
        points = [(at, {}), *((at, trial.hypothesis.tables(trial.w)) for trial in self._trials)]
        self._base, *self._moved = spread(self._jobs, Fitter.predicted_many, self.rig.fitter, points)

    def _promises(self, fit: Fit, paired: bool = False) -> Screening:
        """Promises of the trials on top of a fit, by the columns of the rig without effects."""
        fitter = self.rig.fitter
        slope = fitter.whitened(fitter.predicted(fit.deviations, fit.effects))[1]
        trials = beside(fit, self._trials)
        kept = {id(trial) for trial in trials}
        changes = [
            fitter.column(self._base, moved, slope)
            for trial, moved in zip(self._trials, self._moved, strict=True)
            if id(trial) in kept
        ]
        return of_changes(fitter, fit, trials, changes, paired)

    def _beside(self, names: Names) -> Screened | None:
        """The start of two effects on top of the better fit of one of them."""
        alone = [fit for fit in self.fits[1:] if names > set(fit.effects)]
        starts = self._promises(min(alone, key=lambda fit: fit.chi2)).singles if alone else []
        return next((start for start in starts if frozenset(start.hypothesis.effects) == names), None)

    def _improve_baseline(self, singles: Sequence[Fit]) -> None:
        """Refit the rig from the numbers of its nearest rival as well: more starts find deeper valleys of chi2."""
        near = [(NOTHING, fit.deviations, np.zeros(0)) for fit in singles[:1] if fit.chi2 > _NEAR * self.rig.fit.chi2]
        fits = [self.rig.fit, *refits(self.rig.fitter, near, 1)]
        self.rig = self.rig._replace(fit=min(fits, key=lambda fit: fit.chi2))

    def _worth(self, fit: Fit) -> float:
        """The evidence of a fit without the kept runs."""
        fitted = of_remainder(fit.chi2, len(fit.residual)) + cost_of_freedom(fit, fit.chi2 / len(fit.residual))
        return fitted + self._related(frozenset(fit.effects))

    def _pairs(self, pairs: Sequence[Screened], best: Fit, shown: Names) -> list[Fit]:
        """The best single effect with effects that relations show and trials promise on top of it, and the promised pairs."""
        promised = best_of_each(self._promises(best).singles)
        others = [start for start in promised if set(start.hypothesis.effects) & (shown - set(best.effects))]
        starts = best_of_each([*others, *promised[:_SECOND], *pairs[:_PAIRS]])
        return refitted(self.rig.fitter, starts, _FULL_PAIRS, self._jobs)


def refitted(fitter: Fitter, starts: Sequence[Screened], full: int, jobs: int = 1) -> list[Fit]:
    """The best fit of every set of effects: two steps each, and the best `full` of them to the end."""
    quick = best_of_each(sorted(each_beside(jobs, _quick, fitter, starts), key=lambda fit: fit.chi2))
    further: list[Start] = [(fit.hypothesis, fit.deviations, fit.w) for fit in quick[:full]]
    return best_of_each(sorted([*refits(fitter, further, jobs), *quick], key=lambda fit: fit.chi2))


def _quick(fitter: Fitter, start: Screened) -> Work[Fit]:
    """Two steps from the best of the promised start and of further sizes, from where the rig is described.

    A large effect is not linear, and the refitted rig has taken up a part of it; of a level it has taken up most.
    """
    effects = set(start.hypothesis.effects)
    sizes = [np.array([size]) for size in _SIZES] if effects <= LEVELS.keys() else [_times(start, x) for x in _LARGER]
    further = [(np.zeros_like(start.deviations), w) for w in sizes] if len(effects) == 1 else []
    return fitter.quick(start.hypothesis, ((start.deviations, start.w), *start.others, *further))


def _times(start: Screened, factor: float) -> Floats:
    """The coordinates of a start whose effect is larger by a factor."""
    w = start.w.copy()
    first = start.hypothesis.coordinates[0]
    if first.logarithmic:
        w[0] += -0.5 * math.log(factor) if first.name in {"corner_Hz", "resonance_Hz"} else math.log(factor)
    else:
        w[0] *= factor
    return w
