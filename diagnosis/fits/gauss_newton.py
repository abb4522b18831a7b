"""Fitting the model to the measured features: nuisances inside their tolerances, and the coordinates of an effect.

The method is Gauss-Newton on whitened, compressed differences. The derivatives of the nuisances are computed once, at the
baseline, and again only where no step gains. The derivatives of an effect are computed at every step, as effects are strongly
nonlinear: a clearance opens, a wave passes. Case histories of the constants: docs/method/diagnosis.md.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.fits.batch import At, Question, Work, together
from diagnosis.fits.fit import Fit, prior_of, step_within
from diagnosis.gap.measure import KNEE, Floor, differences, whitened
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.hypothesis import LEVELS, NOTHING, Hypothesis
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import Effects

# Coordinates with a prior below this take the short derivative step of `_coordinate_steps`. Too small: the common step leaves
# the narrow line of a wave's period. Too large: coarser coordinates get derivatives of mere grid noise.
_NARROW = 0.1
# Bounds of the rig's numbers, in tolerances: a deviation beyond is a gap, not a tolerance.
# Too small: a right rig is held back. Too large: the rig absorbs an effect. Counted: docs/method/diagnosis.md.
_MOST_TOLERANCES = 3.3
# The same for lags and corners of the sensors, in their assumed spreads: wider, as no tolerance is stated for them.
_MOST_OF_CHAIN = 5.0
# Gain in chi2 below which a step counts as none. Too small: fits creep on. Too large: fits stop before they are done.
_WORTH_A_STEP = 0.5
# The same as a share of chi2, except for the baseline, with which every fit is compared: creeping on costs time and changes
# no name.
_WORTH_OF_CHI2 = 0.01
# Shares of the Newton step that are tried, until one gains. Without the small share a curved valley stops the fit; each further
# share costs a prediction where nothing gains. Counted: docs/method/diagnosis.md.
_SHARES = (1.0, 0.3, 0.1)
# `going_further` refits at most so often, and while a refit leaves this share of chi2 or less. A larger share, or more refits,
# gains little for more time; a smaller one stops fits that still move. Counted: docs/method/diagnosis.md, `going_further`.
_MORE_REFITS, _GAINED = 5, 0.9


class FitStage(NamedTuple):
    """One stage of a fit: how many steps, and under which compression."""

    steps: int  # at most
    renewals: int  # renewals of the nuisances' derivatives that may gain nothing before the fit ends
    knee: float  # of the compression, in noise floors
    # whether to compute the derivatives where the fit ends; otherwise the derivatives of the last step stay
    columns: bool = True
    worth: float = _WORTH_OF_CHI2  # gain below which a step counts as none, as a share of chi2


# Knee of the compression for a start far from the runs, in noise floors. Too small: far differences are cut flat and give no
# direction. Too large: single differences from slips that come or go outweigh all others.
FAR_KNEE = 60.0
_FAR = FitStage(4, 1, FAR_KNEE)
_NEAR = FitStage(6, 1, KNEE)
# Of the baseline: more steps and renewals than other fits, as every fit is compared with it. On seven cases of the bench six
# steps and one renewal leave up to 11 % more chi2; a third renewal changes nothing.
_RETUNE = FitStage(9, 2, KNEE, worth=0.0)
_QUICK = FitStage(2, 0, FAR_KNEE, columns=False)
# Largest difference, in noise floors, from which a refit begins with the far stage. Too small: fits that are near lose time
# there. Too large: fits start where the compression is nearly flat.
_FAR_OFF = 3.0 * KNEE
# Steps for the nuisances' derivatives, in tolerances, for the first, second and third renewal. Too small: the grid of the
# features shows. Too large: curvature does. The second goes the other way and further, across slips that come or go.
_STEPS = (0.5, -1.0, 0.25)


def _coordinate_steps(hypothesis: Hypothesis, w: Floats) -> Floats:
    """How far each coordinate moves for its derivative [coordinates]."""
    steps = np.zeros(len(w))
    for i, coordinate in enumerate(hypothesis.coordinates):
        steps[i] = 0.15 * min(coordinate.prior, 1.0) if coordinate.logarithmic else 0.25 * max(abs(w[i]), 0.4)
        if coordinate.prior < _NARROW:  # the period of a wave that passes many times
            steps[i] = 0.02 * coordinate.prior
    return steps


def _beside(hypothesis: Hypothesis, deviations: Floats, w: Floats) -> list[At]:
    """The points that the derivatives of all coordinates need."""
    return [(deviations, hypothesis.tables(ahead)) for ahead in w + np.diag(_coordinate_steps(hypothesis, w))]


class _Place(NamedTuple):
    """A point that a fit has reached, and the prediction there."""

    at: Floats  # nuisances, then coordinates [nuisances + coordinates]
    predicted: Floats  # [features]
    residual: Floats  # whitened [compared]
    slope: Floats  # derivative of the compression [compared]
    chi2: float  # squares of the residual, and the priors' terms


class Fitter:
    """Fits hypotheses to the measured features of one problem, under one noise floor."""

    def __init__(self, problem: Problem, floor: Floor, nuisances: Nuisances) -> None:
        self.problem = problem
        self.floor = floor
        self.nuisances = nuisances
        rig_numbers = len(nuisances.rig_names)
        # bounds of the nuisances, the same in both directions [nuisances]
        self.most = np.where(np.arange(len(nuisances)) < rig_numbers, _MOST_TOLERANCES, _MOST_OF_CHAIN)
        # places where the derivatives of all nuisances are known, in tolerances, and these derivatives
        self._known = [(np.zeros(len(nuisances)), np.zeros((int(floor.compared.sum()), len(nuisances))))]

    def predicted(self, deviations: Floats, effects: Effects) -> Floats:
        """Features of the model without noise [features], for nuisances in tolerances [nuisances] and tables of effects."""
        return self.predicted_many([(deviations, effects)])[0]

    def predicted_many(self, at: Sequence[At], perhaps: Sequence[At] = ()) -> list[Floats]:
        """As `predicted`, for many points side by side; `perhaps` are points that the caller may ask for next."""
        points, soon = ([self.nuisances.point(*pair) for pair in pairs] for pairs in (at, perhaps))
        return self.problem.predicted_many(points, perhaps=soon)

    def whitened(self, predicted: Floats, knee: float = KNEE) -> tuple[Floats, Floats]:
        """Whitened compressed differences [compared], and the derivative of the compression there."""
        return whitened(self.floor, self.problem, predicted, knee)

    def column(self, base: Floats, moved: Floats, slope: Floats) -> Floats:
        """The change from one prediction [features] to another, in whitened compressed differences [compared]."""
        z = (self.floor.expected(moved) - self.floor.expected(base))[self.floor.compared]
        z *= slope / self.floor.scatter[self.floor.compared]
        return self.floor.whitening @ np.where(np.isfinite(z), z, 0.0)

    def retuning(self, deviations: Floats) -> Work[Fit]:
        """Fit the baseline; later fits start with the derivatives of the nuisances there, or where the rig is described."""
        fit = yield from self.fitting(NOTHING, deviations, np.zeros(0), _RETUNE)
        known: list[tuple[Floats, Floats]] = []
        for at in (fit.deviations, np.zeros(len(deviations))):
            aside = self._aside(at, _STEPS[0])
            base, *moved = yield Question([(at, {}), *((deviations, {}) for deviations in aside)])
            known.append((at, self._nuisance_rates(at, base, aside, moved)))
        self._known = known
        return fit

    def rates_near(self, deviations: Floats) -> Floats:
        """Derivatives of the nuisances [compared, nuisances] at the nearest place where they are known."""
        return min(self._known, key=lambda place: float(np.sum((place[0] - deviations) ** 2)))[1]

    def bare(self, deviations: Floats, predicted: Floats, knee: float) -> Fit:
        """The rig without effects at some deviations, unfitted, from its prediction [features]."""
        residual, slope = self.whitened(predicted, knee)
        columns = self.floor.whitening @ (self.rates_near(deviations) * slope[:, None])
        chi2 = self._chi2(prior_of(NOTHING, deviations), residual, deviations)
        return Fit(NOTHING, deviations, np.zeros(0), chi2, residual, columns)

    def refit(self, hypothesis: Hypothesis, deviations: Floats, w: Floats) -> Fit:
        """Fit a hypothesis to the end, from a start that may be far from the runs.

        Args:
            hypothesis: the effects to add to the rig.
            deviations: start of the nuisances, in tolerances [nuisances].
            w: start of the hypothesis' coordinates [coordinates].

        """
        return together(self.predicted_many, [self.refitting(hypothesis, deviations, w)])[0]

    def quick(self, hypothesis: Hypothesis, starts: Sequence[tuple[Floats, Floats]]) -> Work[Fit]:
        """Fit a hypothesis in two steps, from the better of some starts; chi2 is under the compression of the gap."""
        predicted = yield Question([(deviations, hypothesis.tables(w)) for deviations, w in starts])
        left = [
            self._placed(hypothesis, np.concatenate(start), features, FAR_KNEE).chi2
            for start, features in zip(starts, predicted, strict=True)
        ]
        fit = yield from self.fitting(hypothesis, *starts[left.index(min(left))], _QUICK)
        return (yield from self._judging(fit))

    def _judging(self, fit: Fit) -> Work[Fit]:
        (predicted,) = yield Question([(fit.deviations, fit.effects)])
        residual, _ = self.whitened(predicted)
        chi2 = self._chi2(prior_of(fit.hypothesis, fit.deviations), residual, np.concatenate([fit.deviations, fit.w]))
        return fit._replace(chi2=chi2, residual=residual)

    def refitting(self, hypothesis: Hypothesis, deviations: Floats, w: Floats) -> Work[Fit]:
        """As `refit`, as a work that proceeds with others."""
        (predicted,) = yield Question([(deviations, hypothesis.tables(w))])
        if np.abs(differences(self.floor, self.problem, predicted)).max() > _FAR_OFF:
            fit = yield from self.fitting(hypothesis, deviations, w, _FAR)
            deviations, w = fit.deviations, fit.w
        return (yield from self.fitting(hypothesis, deviations, w, _NEAR))

    def going_further(self, fit: Fit) -> Work[Fit]:
        """Refit a fit again as long as chi2 falls; a finished fit is returned unchanged."""
        for _ in range(_MORE_REFITS):
            if fit.finished:
                break
            again = yield from self.refitting(fit.hypothesis, fit.deviations, fit.w)
            gains = again.chi2 < _GAINED * fit.chi2
            fit = min(fit, again, key=lambda other: other.chi2)
            if not gains:
                break
        return fit._replace(finished=True)

    def fitting(self, hypothesis: Hypothesis, deviations: Floats, w: Floats, stage: FitStage) -> Work[Fit]:
        """Fit a hypothesis from a start, by the rules of one stage."""
        nuisances = len(deviations)
        prior = prior_of(hypothesis, deviations)
        most = np.concatenate([self.most, np.full(len(w), np.inf)])
        (predicted,) = yield Question([(deviations, hypothesis.tables(w))], _beside(hypothesis, deviations, w))
        place = self._placed(hypothesis, np.concatenate([deviations, w]), predicted, stage.knee)
        nuisance_rates = self.rates_near(deviations)
        renewed = without_gain = 0
        finished = False
        columns = np.zeros((len(place.residual), len(place.at)))
        for step in range(stage.steps + 1):
            if step == stage.steps and not stage.columns:
                break
            effect_rates = yield from self._effect_rates(
                hypothesis, place.at[:nuisances], place.at[nuisances:], place.predicted
            )
            rates = np.column_stack(
                [self._with_levels(nuisance_rates, effect_rates, hypothesis, place.at), effect_rates]
            )
            columns = self.floor.whitening @ (rates * place.slope[:, None])
            if step == stage.steps:
                break
            normal = columns.T @ columns + np.diag(prior**2)
            change, _ = step_within(normal, columns.T @ place.residual - prior**2 * place.at, place.at, self.most)
            tried = [np.clip(place.at + share * change, -most, most) for share in _SHARES]
            points = [(ahead[:nuisances], hypothesis.tables(ahead[nuisances:])) for ahead in tried]
            gain = 0.0
            for number, ahead in enumerate(tried):
                (predicted,) = yield Question(
                    [points[number]],
                    [*_beside(hypothesis, ahead[:nuisances], ahead[nuisances:]), *points[number + 1 :]],
                )
                candidate = self._placed(hypothesis, ahead, predicted, stage.knee)
                if candidate.chi2 < place.chi2:
                    gain = place.chi2 - candidate.chi2
                    place = candidate
                    break
            worth = max(_WORTH_A_STEP, stage.worth * place.chi2)
            if gain < worth:
                if without_gain == stage.renewals:
                    finished = without_gain > 0  # no step gains, not even with renewed derivatives
                    break
                size = _STEPS[renewed % len(_STEPS)]
                nuisance_rates, candidate = yield from self._renewed(hypothesis, place, stage.knee, size)
                renewed += 1
                if candidate.chi2 < place.chi2 - worth:
                    place = candidate
                else:
                    without_gain += 1
        return Fit(
            hypothesis, place.at[:nuisances], place.at[nuisances:], place.chi2, place.residual, columns, finished
        )

    def _placed(self, hypothesis: Hypothesis, at: Floats, predicted: Floats, knee: float) -> _Place:
        """A point, nuisances then coordinates, with the prediction there [features]."""
        residual, slope = self.whitened(predicted, knee)
        prior = prior_of(hypothesis, at[: len(self.nuisances)])
        return _Place(at, predicted, residual, slope, self._chi2(prior, residual, at))

    def _renewed(self, hypothesis: Hypothesis, place: _Place, knee: float, size: float) -> Work[tuple[Floats, _Place]]:
        """Renew the nuisances' derivatives, and go where single moves of nuisances gain; otherwise stay at `place`.

        Where slips come and go, a step of all numbers by their derivatives leads astray, and moving a single number does not.
        The place returned is the best of all single moves and of all gaining moves at once (docs/method/diagnosis.md).
        """
        nuisances = len(self.nuisances)
        aside = self._aside(place.at[:nuisances], size)
        predicted = yield Question([(moved, hypothesis.tables(place.at[nuisances:])) for moved in aside])
        rates = self._nuisance_rates(place.at[:nuisances], place.predicted, aside, predicted)
        alone = [
            self._placed(hypothesis, np.concatenate([moved, place.at[nuisances:]]), features, knee)
            for moved, features in zip(aside, predicted, strict=True)
            if (np.abs(moved) <= self.most).all()
        ]
        better = [candidate for candidate in alone if candidate.chi2 < place.chi2 - _WORTH_A_STEP]
        if not better:
            return rates, place
        all_at_once = place.at + sum(candidate.at - place.at for candidate in better)
        (features_at_once,) = yield Question([(all_at_once[:nuisances], hypothesis.tables(all_at_once[nuisances:]))])
        return rates, min(
            *better, self._placed(hypothesis, all_at_once, features_at_once, knee), key=lambda candidate: candidate.chi2
        )

    def _with_levels(self, nuisance_rates: Floats, effect_rates: Floats, hypothesis: Hypothesis, now: Floats) -> Floats:
        """The nuisances' derivatives; a rig number that an effect changes takes the derivative of that effect."""
        rates = nuisance_rates.copy()
        for column, coordinate, w in zip(
            effect_rates.T, hypothesis.coordinates, now[len(self.nuisances) :].tolist(), strict=True
        ):
            name = LEVELS.get(coordinate.effect)
            if name in self.nuisances.rig_names:
                i = self.nuisances.rig_names.index(name)
                growth = self.nuisances.growth(name, float(now[i]))
                rates[:, i] = column * growth * (1.0 + coordinate.value(w)) / coordinate.scale
        return rates

    @staticmethod
    def _chi2(prior: Floats, residual: Floats, at: Floats) -> float:
        held = prior * at
        return float(residual @ residual + held @ held)

    def _aside(self, deviations: Floats, size: float) -> Floats:
        """For every nuisance a point that differs by `size` tolerances towards the description [nuisances, nuisances]."""
        return deviations + np.diag(np.where(deviations > 0.0, -size, size))

    def _nuisance_rates(self, deviations: Floats, base: Floats, aside: Floats, moved: Sequence[Floats]) -> Floats:
        steps = np.diag(aside - deviations)
        return np.column_stack([self._rate(base, *pair) for pair in zip(moved, steps.tolist(), strict=True)])

    def _effect_rates(self, hypothesis: Hypothesis, deviations: Floats, w: Floats, base: Floats) -> Work[Floats]:
        steps = _coordinate_steps(hypothesis, w)
        columns = np.zeros((int(self.floor.compared.sum()), len(w)))
        moved = yield Question(_beside(hypothesis, deviations, w))
        for i, features in enumerate(moved):
            columns[:, i] = self._rate(base, features, float(steps[i]))
        return columns

    def _rate(self, base: Floats, moved: Floats, step: float) -> Floats:
        change = (self.floor.expected(moved) - self.floor.expected(base))[self.floor.compared]
        z = change / (self.floor.scatter[self.floor.compared] * step)
        return np.where(np.isfinite(z), z, 0.0)
