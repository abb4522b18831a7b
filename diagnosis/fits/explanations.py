"""Fits of one effect and of two: of every effect the best start, and refits of the starts that promise most."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from bridge.arrays import Floats
from diagnosis.fits.baseline import Baseline, Progress
from diagnosis.fits.batch import together
from diagnosis.fits.evidence import cost_of_freedom, of_remainder
from diagnosis.fits.fit import NOISE, Fit
from diagnosis.fits.gauss_newton import FAR_KNEE, Fitter
from diagnosis.fits.screening import Screened, Screening
from diagnosis.gap.measure import KNEE
from diagnosis.hypotheses.hypothesis import LEVELS, NOTHING, Hypothesis
from diagnosis.hypotheses.starts import Trial
from diagnosis.model.per_run import is_phase

Names = frozenset[str]
_Formed = TypeVar("_Formed", Fit, Screened)
# Starts that get two steps of a refit, of the rig as refitted and as described, and fits that go on to the end. Fewer: a right
# effect is passed over, as a promise is rough. More: 0.3 s and 1 s of CPU each.
_QUICK, _FULL, _FULL_PAIRS = (5, 4), 2, 1
_SECOND = 4  # effects that get two steps on top of the best single effect
_NEAR = 0.6  # of the remainder without effects: an effect that leaves more may win by a better valley of a jagged chi2
# Pairs are tried where the best single effect leaves more than this many times a right explanation's remainder,
_MUCH_LEFT = 1.3
_CLOSES = 0.8  # and has a relation that shows it, or leaves less than this share of the remainder without effects.


class Place(NamedTuple):
    """A rig without effects, and trials predicted there."""

    fit: Fit
    knee: float  # of the compression
    base: Floats  # features of the rig [features]
    moved: list[tuple[Trial, Floats]]  # the same with each trial


class Search:
    """The fits of explanations. Its attributes are valid at any time, also where the time ends within `run`.

    Attributes:
        rig: the rig without effects; it may be found better on the way.
        fits: the best fit of each set of effects; the first is the rig without effects.
        promised: the best start of each effect.

    """

    def __init__(self, rig: Baseline, trials: list[Trial], related: Callable[[Names], float]) -> None:
        """`related`: log evidence of the relations for a set of effects, against no effect."""
        self.rig = rig
        self.fits = [rig.fit]
        self.promised: dict[Names, Screened] = {}
        self._trials, self._related = trials, related
        self._places: list[Place] = []

    @property
    def left(self) -> dict[Names, float]:
        """chi2 of every set of effects; by its start where it has no fit."""
        promised = {names: start.chi2 for names, start in self.promised.items()}
        known = promised | {frozenset(fit.effects): fit.chi2 for fit in self.fits}
        return {names: min(chi2, self.rig.fit.chi2) for names, chi2 in known.items()}  # an effect may have no size

    def run(self, shown: Names, progress: Progress) -> None:
        """Predict every trial at two places, refit those that promise most, then pairs; effects that are `shown` as well."""
        self._predict()
        promises = [self._promises(place.fit, place) for place in self._places]
        self.promised = {frozenset(start.hypothesis.effects): start for start in promises[0]}
        progress("every effect was tried; the leading ones are fitted", 0.45)
        starts = [start for of_place, count in zip(promises, _QUICK, strict=True) for start in of_place[:count]]
        starts += [start for start in promises[0][_QUICK[0] :] if shown.issuperset(start.hypothesis.effects)]
        singles = refitted(self.rig.fitter, starts, _FULL)
        self._improve_baseline(singles)
        self.fits = [self.rig.fit, *singles]
        for lead in sorted(singles, key=lambda fit: -self._worth(fit))[:1]:
            founded = lead.chi2 < _CLOSES * self.rig.fit.chi2 or self._related(frozenset(lead.effects)) > 0.0
            if founded and lead.chi2 > _MUCH_LEFT * NOISE * len(lead.residual):
                progress(f"best single effect: {', '.join(lead.effects)}; looking for a second", 0.65)
                pairs = self._pairs(lead, shown)
                singles = best_of_each(sorted([*singles, *self._within(pairs[:1], singles)], key=lambda fit: fit.chi2))
                self.fits = [self.rig.fit, *singles, *pairs]

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
        return _further(self.rig.fitter, [fit])[0]

    def _predict(self) -> None:
        """Predict the rig without effects, and every trial, as refitted and as described.

        A large effect has moved the refitted rig away, where the same effect, added, no longer helps. A wave moves no number.
        """
        fitter, near = self.rig.fitter, self.rig.fit.deviations
        described = np.zeros_like(near)
        steady = [
            trial for trial in self._trials if not any(is_phase(axis.name) for axis in trial.hypothesis.coordinates)
        ]
        places = [(near, self._trials), (described, steady)]
        points = [
            (at, table)
            for at, trials in places
            for table in ({}, *(trial.hypothesis.tables(trial.w) for trial in trials))
        ]
        predicted = fitter.predicted_many(points)
        base, far = predicted[0], predicted[1 + len(self._trials)]
        self._places = [
            Place(self.rig.fit, KNEE, base, list(zip(self._trials, predicted[1:], strict=False))),
            Place(
                fitter.bare(described, far, FAR_KNEE), FAR_KNEE, far,
                list(zip(steady, predicted[2 + len(self._trials) :], strict=True)),
            ),
        ]  # fmt: skip

    def _promises(self, fit: Fit, place: Place) -> list[Screened]:
        """The best start of every effect on top of a fit, the most promising first, by the trials at a place."""
        fitter, screening = self.rig.fitter, Screening(fit)

        def left(start: tuple[Hypothesis, Floats, Floats], features: Floats) -> Screened:
            return screening.eased(*start, fitter.whitened(features, place.knee)[0])

        known = [tried for tried in place.moved if not set(tried[0].hypothesis.effects) & set(fit.effects)]
        features = place.base if fit is place.fit else fitter.predicted(fit.deviations, fit.effects)
        slope = fitter.whitened(features, place.knee)[1]
        promised = [screening.promised(trial, fitter.column(place.base, moved, slope)) for trial, moved in known]
        linear = best_of_each(sorted((start for start in promised if start), key=lambda start: start.chi2))
        points = [(start.deviations, start.hypothesis.tables(start.w)) for start in linear]
        predicted = fitter.predicted_many(points)
        starts = [left(start[:3], features) for start, features in zip(linear, predicted, strict=True)]
        if fit is place.fit:
            starts += [left((trial.hypothesis, fit.deviations, trial.w), moved) for trial, moved in known]
        return best_of_each(sorted(starts, key=lambda start: start.chi2))

    def _beside(self, names: Names) -> Screened | None:
        """The start of two effects on top of the better fit of one of them."""
        alone = [fit for fit in self.fits[1:] if names > set(fit.effects)]
        starts = self._promises(min(alone, key=lambda fit: fit.chi2), self._places[0]) if alone else []
        return next((start for start in starts if frozenset(start.hypothesis.effects) == names), None)

    def _improve_baseline(self, singles: Sequence[Fit]) -> None:
        """Refit the rig from the numbers of its nearest rival as well: more starts find deeper valleys of chi2."""
        near = [(NOTHING, fit.deviations, np.zeros(0)) for fit in singles[:1] if fit.chi2 > _NEAR * self.rig.fit.chi2]
        fits = [self.rig.fit, *(self.rig.fitter.refit(*start) for start in near)]
        self.rig = self.rig._replace(fit=min(fits, key=lambda fit: fit.chi2))

    def _worth(self, fit: Fit) -> float:
        """The evidence of a fit without the kept runs."""
        fitted = of_remainder(fit.chi2, len(fit.residual)) + cost_of_freedom(fit, fit.chi2 / len(fit.residual))
        return fitted + self._related(frozenset(fit.effects))

    def _pairs(self, best: Fit, shown: Names) -> list[Fit]:
        """The best single effect with effects that relations show, and that promise most on top of it."""
        promised = self._promises(best, self._places[0])
        others = [start for start in promised if set(start.hypothesis.effects) & (shown - set(best.effects))]
        return refitted(self.rig.fitter, best_of_each([*others, *promised[:_SECOND]]), _FULL_PAIRS)

    def _within(self, pairs: Sequence[Fit], singles: Sequence[Fit]) -> list[Fit]:
        """Each effect of two alone, refitted from their fit where that leaves less than its own fit."""
        nuisances, starts = self.rig.fitter.nuisances, list[Screened]()
        for fit in pairs:
            axes = list(zip(fit.hypothesis.coordinates, fit.w.tolist(), strict=True))
            for name, form in fit.hypothesis.forms.items():
                deviations = fit.deviations.copy()
                for axis, w in axes:
                    number = LEVELS.get(axis.effect)
                    if axis.effect != name and number in nuisances.rig_names:  # the number can move instead
                        deviations[nuisances.rig_names.index(number)] += axis.value(w) / nuisances.tolerance[number]
                alone = [(axis, w) for axis, w in axes if axis.effect == name]
                hypothesis = Hypothesis({name: form}, tuple(axis for axis, _ in alone))
                deviations = np.clip(deviations, -self.rig.fitter.most, self.rig.fitter.most)
                at = deviations, np.array([w for _, w in alone])
                starts.append(Screened(hypothesis, *at, fit.chi2, at))
        left = {frozenset(fit.effects): fit.chi2 for fit in singles}
        quick = _quick(self.rig.fitter, starts)
        better = [fit for fit in quick if fit.chi2 < left.get(frozenset(fit.effects), math.inf)]
        return _further(self.rig.fitter, better)


def refitted(fitter: Fitter, starts: Sequence[Screened], full: int) -> list[Fit]:
    """The best fit of every set of effects: two steps each, and the best `full` of them to the end."""
    quick = best_of_each(sorted(_quick(fitter, starts), key=lambda fit: fit.chi2))
    further = _further(fitter, quick[:full])
    return best_of_each(sorted([*further, *quick], key=lambda fit: fit.chi2))


def _quick(fitter: Fitter, starts: Sequence[Screened]) -> list[Fit]:
    works = [fitter.quick(start.hypothesis, ((start.deviations, start.w), start.before)) for start in starts]
    return together(fitter.predicted_many, works)


def _further(fitter: Fitter, fits: Sequence[Fit]) -> list[Fit]:
    return together(fitter.predicted_many, [fitter.going_further(fit) for fit in fits])


def best_of_each(formed: list[_Formed]) -> list[_Formed]:
    """The first of every set of effects, in the order of `formed`."""
    seen: dict[frozenset[str], _Formed] = {}
    for candidate in formed:
        seen.setdefault(frozenset(candidate.hypothesis.effects), candidate)
    return list(seen.values())
