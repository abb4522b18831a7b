"""Fitting the model to the measured features: nuisances inside their tolerances, and the parameters of an effect.

Gauss-Newton in whitened, compressed differences. The nuisances' columns are computed once where the rig was retuned; an effect's
own columns at every step, since effects are as nonlinear as a gap that opens or a wave that passes.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.fits.batch import At, Question, Work, together
from diagnosis.fits.fit import Fit, prior_of, step_within
from diagnosis.gap.floor import KNEE, Floor
from diagnosis.gap.measure import differences, whitened
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.hypothesis import LEVELS, NOTHING, Hypothesis
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import Effects

Floats = npt.NDArray[np.floating[Any]]
_NARROW = 0.1  # prior of a coordinate that is known so well that a common step would leave its line
# What goes further is a gap: of seven numbers drawn from their tolerances one is beyond this in 1 of 150 rigs. The sensors'
# lags and corners have no stated tolerance to hold them to.
_MOST_TOLERANCES = 3.3
_MOST_OF_CHAIN = 5.0
_WORTH_A_STEP = 0.5  # of chi2
_SHARES = (1.0, 0.3, 0.1)  # of a step; a static friction stayed at chi2 235 without the last, and went to 158 with it
_MORE_REFITS, _GAINED = 5, 0.97  # refits of a fit, while each leaves this share of chi2 or less


class Stage(NamedTuple):
    """How a fit proceeds."""

    steps: int
    renewals: int  # how often the nuisances' derivatives may be computed anew when no step gains any more
    knee: float  # of the compression
    columns: bool = True  # whether the derivatives are wanted where the fit ends; else those of the step before do


# Far off, compressed differences pull at nothing: there a fit is nearly one of plain squares.
FAR_KNEE = 60.0
_FAR = Stage(4, 1, FAR_KNEE)
_NEAR = Stage(6, 1, KNEE)
_RETUNE = Stage(9, 3, KNEE)  # what everything is measured against
_QUICK = Stage(2, 0, FAR_KNEE, columns=False)
_FAR_OFF = 3.0 * KNEE
# Of what the rig without effects leaves: of 120 forms tried on three rigs that no single effect explains, 108 were between these
# after the first steps, and none of those came below 0.9 in the end.
_NO_LESS, _ASTRAY = 0.97, 1.5
# of a tolerance, for derivatives: large against the grid, small against the curvature; the second time the other way and wider,
# over the jumps that slips make where they come and go, the third time closer
_STEPS = (0.5, -1.0, 0.25)


def _axis_steps(hypothesis: Hypothesis, w: Floats) -> Floats:
    """By how much each axis is moved for its derivative."""
    steps = np.zeros(len(w))
    for i, axis in enumerate(hypothesis.coordinates):
        steps[i] = 0.15 * min(axis.prior, 1.0) if axis.logarithmic else 0.25 * max(abs(w[i]), 0.4)
        if axis.prior < _NARROW:  # the period of a wave that passes many times
            steps[i] = 0.02 * axis.prior
    return steps


def _beside(hypothesis: Hypothesis, deviations: Floats, w: Floats) -> list[At]:
    """Where the derivatives of all axes are taken."""
    return [(deviations, hypothesis.tables(ahead)) for ahead in w + np.diag(_axis_steps(hypothesis, w))]


class _Place(NamedTuple):
    """Where a fit is."""

    at: Floats  # nuisances, then axes
    predicted: Floats  # [features]
    residual: Floats  # whitened [compared]
    slope: Floats  # of the compression [compared]
    chi2: float  # with the priors' terms


class Fitter:
    """Fits forms to one problem under one floor."""

    def __init__(self, problem: Problem, floor: Floor, nuisances: Nuisances) -> None:
        self.problem = problem
        self.floor = floor
        self.nuisances = nuisances
        own = len(nuisances.rig_names)
        # how far each nuisance may go, either way
        self.most = np.where(np.arange(len(nuisances)) < own, _MOST_TOLERANCES, _MOST_OF_CHAIN)
        self._rates = np.zeros((int(floor.compared.sum()), len(nuisances)))

    def for_problem(self, problem: Problem) -> "Fitter":
        """The same floor and derivatives for other measured features of the same runs."""
        other = Fitter(problem, self.floor, self.nuisances)
        other._rates = self._rates
        return other

    def of_runs(self, files: set[str]) -> "Fitter":
        """The same for some of the runs, by their files."""
        own = np.array([file in files for file, _ in self.problem.labels])
        problem = Problem(self.problem.rig, [run for run in self.problem.runs if run.file in files])
        other = Fitter(problem, self.floor.of_features(own), self.nuisances)
        other._rates = self._rates[own[self.floor.compared]]
        return other

    def predicted(self, deviations: Floats, effects: Effects) -> Floats:
        """Features of the model, free of noise [features]."""
        return self.predicted_many([(deviations, effects)])[0]

    def predicted_many(self, at: Sequence[At], perhaps: Sequence[At] = ()) -> list[Floats]:
        """As `predicted` of every point, in less time than one after the other; `perhaps` are points that may be next."""
        points, soon = ([self.nuisances.point(*one) for one in some] for some in (at, perhaps))
        return self.problem.predicted_many(points, perhaps=soon)

    def whitened(self, predicted: Floats, knee: float = KNEE) -> tuple[Floats, Floats]:
        """Whitened compressed differences [compared], and the derivative of the compression there."""
        return whitened(self.floor, self.problem, predicted, knee)

    def column(self, here: Floats, there: Floats, slope: Floats) -> Floats:
        """The way from one prediction [features] to another as it shows in whitened compressed differences."""
        z = (self.floor.expected(there) - self.floor.expected(here))[self.floor.compared]
        z *= slope / self.floor.scatter[self.floor.compared]
        return self.floor.whitening @ np.where(np.isfinite(z), z, 0.0)

    def retuning(self, deviations: Floats) -> Work[Fit]:
        """The rig without effects, refitted; other fits start from its nuisances' derivatives."""
        fit = yield from self.refitting(NOTHING, deviations, np.zeros(0))
        fit = yield from self.fitting(NOTHING, fit.deviations, fit.w, _RETUNE)
        (here,) = yield Question([(fit.deviations, {})])
        aside = self._aside(fit.deviations, _STEPS[0])
        there = yield Question([(one, {}) for one in aside])
        self._rates = self._nuisance_rates(fit.deviations, here, aside, there)
        return fit

    def described(self, deviations: Floats) -> Fit:
        """The rig as it stands, with its nuisances' derivatives, under the wide compression of a far start."""
        here = self.predicted(deviations, {})
        residual, slope = self.whitened(here, FAR_KNEE)
        aside = self._aside(deviations, _STEPS[0])
        rates = self._nuisance_rates(deviations, here, aside, self.predicted_many([(one, {}) for one in aside]))
        chi2 = self._chi2(np.ones(len(deviations)), residual, deviations)
        return Fit(NOTHING, deviations, np.zeros(0), chi2, residual, self.floor.whitening @ (rates * slope[:, None]))

    def refit(self, hypothesis: Hypothesis, deviations: Floats, w: Floats) -> Fit:
        """Fit a hypothesis to the end, from a starting point that may be far off."""
        return together(self.predicted_many, [self.refitting(hypothesis, deviations, w)])[0]

    def quick(self, hypothesis: Hypothesis, starts: Sequence[tuple[Floats, Floats]]) -> Work[Fit]:
        """A hypothesis fitted a little, from the best of some starts, with the chi2 of the gap's own compression."""
        there = yield Question([(deviations, hypothesis.tables(w)) for deviations, w in starts])
        far = [self.far_chi2(hypothesis, *one) for one in zip(starts, there, strict=True)]
        fit = yield from self.fitting(hypothesis, *starts[far.index(min(far))], _QUICK)
        return (yield from self._judging(fit))

    def judged(self, fit: Fit) -> Fit:
        """A fit of any stage with the chi2 and the residual of the gap's own compression."""
        return together(self.predicted_many, [self._judging(fit)])[0]

    def _judging(self, fit: Fit) -> Work[Fit]:
        (predicted,) = yield Question([(fit.deviations, fit.effects)])
        residual, _ = self.whitened(predicted)
        chi2 = self._chi2(prior_of(fit.hypothesis, fit.deviations), residual, np.concatenate([fit.deviations, fit.w]))
        return fit._replace(chi2=chi2, residual=residual)

    def far_chi2(self, hypothesis: Hypothesis, at: tuple[Floats, Floats], predicted: Floats) -> float:
        """chi2 of a prediction [features] for nuisances and axes, under the wide compression of a far start."""
        residual, _ = self.whitened(predicted, FAR_KNEE)
        return self._chi2(prior_of(hypothesis, at[0]), residual, np.concatenate(at))

    def refitting(self, hypothesis: Hypothesis, deviations: Floats, w: Floats) -> Work[Fit]:
        """As `refit`, beside others."""
        (predicted,) = yield Question([(deviations, hypothesis.tables(w))])
        if np.abs(differences(self.floor, self.problem, predicted)).max() > _FAR_OFF:
            fit = yield from self.fitting(hypothesis, deviations, w, _FAR)
            deviations, w = fit.deviations, fit.w
        return (yield from self.fitting(hypothesis, deviations, w, _NEAR))

    def trying(self, hypothesis: Hypothesis, deviations: Floats, w: Floats, base_chi2: float) -> Work[Fit]:
        """As `refitting`, but not to the end where the first steps lead to what the rig without effects leaves, `base_chi2`."""
        fit = yield from self.fitting(hypothesis, deviations, w, _FAR)
        fit = yield from self._judging(fit)
        if _NO_LESS * base_chi2 < fit.chi2 < _ASTRAY * base_chi2:
            return fit
        return (yield from self.fitting(hypothesis, fit.deviations, fit.w, _NEAR))

    def further(self, fit: Fit) -> Fit:
        """A fit refitted again as long as that gains."""
        return together(self.predicted_many, [self.going_further(fit)])[0]

    def going_further(self, fit: Fit) -> Work[Fit]:
        """As `further`, beside others: a lag in distance went from chi2 298 to 230, 212 and 85.

        Where no step gained any more, a refit from there took 4 % of chi2 at most, nothing in 18 of 24 (seven rigs).
        """
        for _ in range(_MORE_REFITS):
            if fit.finished:
                break
            again = yield from self.refitting(fit.hypothesis, fit.deviations, fit.w)
            gains = again.chi2 < _GAINED * fit.chi2
            fit = min(fit, again, key=lambda one: one.chi2)
            if not gains:
                break
        return fit._replace(finished=True)

    def fitting(self, hypothesis: Hypothesis, deviations: Floats, w: Floats, stage: Stage) -> Work[Fit]:
        """Fit a hypothesis from a starting point, in the way of one stage."""
        own = len(deviations)
        prior = prior_of(hypothesis, deviations)
        most = np.concatenate([self.most, np.full(len(w), np.inf)])
        (predicted,) = yield Question([(deviations, hypothesis.tables(w))], _beside(hypothesis, deviations, w))
        here = self._placed(hypothesis, np.concatenate([deviations, w]), predicted, stage.knee)
        nuisance_rates = self._rates
        renewed = without_gain = 0
        finished = False
        columns = np.zeros((len(here.residual), len(here.at)))
        for step in range(stage.steps + 1):
            if step == stage.steps and not stage.columns:
                break
            axis_rates = yield from self._axis_rates(hypothesis, here.at[:own], here.at[own:], here.predicted)
            rates = np.column_stack([self._with_levels(nuisance_rates, axis_rates, hypothesis, here.at), axis_rates])
            columns = self.floor.whitening @ (rates * here.slope[:, None])
            if step == stage.steps:
                break
            normal = columns.T @ columns + np.diag(prior**2)
            change, _ = step_within(normal, columns.T @ here.residual - prior**2 * here.at, here.at, self.most)
            tried = [np.clip(here.at + share * change, -most, most) for share in _SHARES]
            points = [(ahead[:own], hypothesis.tables(ahead[own:])) for ahead in tried]
            gain = 0.0
            for number, ahead in enumerate(tried):
                (predicted,) = yield Question(
                    [points[number]], [*_beside(hypothesis, ahead[:own], ahead[own:]), *points[number + 1 :]]
                )
                there = self._placed(hypothesis, ahead, predicted, stage.knee)
                if there.chi2 < here.chi2:
                    gain = here.chi2 - there.chi2
                    here = there
                    break
            if gain < _WORTH_A_STEP:
                if without_gain == stage.renewals:
                    finished = without_gain > 0  # no step gains any more, with renewed derivatives
                    break
                size = _STEPS[renewed % len(_STEPS)]
                nuisance_rates, there = yield from self._renewed(hypothesis, here, stage.knee, size)
                renewed += 1
                if there.chi2 < here.chi2 - _WORTH_A_STEP:
                    here = there
                else:
                    without_gain += 1
        return Fit(hypothesis, here.at[:own], here.at[own:], here.chi2, here.residual, columns, finished)

    def _placed(self, hypothesis: Hypothesis, at: Floats, predicted: Floats, knee: float) -> _Place:
        """A point, nuisances and axes, with what the model predicts there [features]."""
        residual, slope = self.whitened(predicted, knee)
        prior = prior_of(hypothesis, at[: len(self.nuisances)])
        return _Place(at, predicted, residual, slope, self._chi2(prior, residual, at))

    def _renewed(self, hypothesis: Hypothesis, here: _Place, knee: float, size: float) -> Work[tuple[Floats, _Place]]:
        """The nuisances' derivatives anew, and the best place that single nuisances moved by as much lead to, or `here`.

        Where slips come and go derivatives lead astray, all numbers at once, and a single number does not. From the true numbers
        of a rig whose friction is 7.8 ms late a refit stayed at chi2 467; so it came to 180.
        """
        own = len(self.nuisances)
        aside = self._aside(here.at[:own], size)
        predicted = yield Question([(one, hypothesis.tables(here.at[own:])) for one in aside])
        rates = self._nuisance_rates(here.at[:own], here.predicted, aside, predicted)
        alone = [
            self._placed(hypothesis, np.concatenate([one, here.at[own:]]), there, knee)
            for one, there in zip(aside, predicted, strict=True)
            if (np.abs(one) <= self.most).all()
        ]
        better = [one for one in alone if one.chi2 < here.chi2 - _WORTH_A_STEP]
        if not better:
            return rates, here
        all_at_once = here.at + sum(one.at - here.at for one in better)
        (there,) = yield Question([(all_at_once[:own], hypothesis.tables(all_at_once[own:]))])
        return rates, min(*better, self._placed(hypothesis, all_at_once, there, knee), key=lambda one: one.chi2)

    def _with_levels(self, nuisance_rates: Floats, axis_rates: Floats, hypothesis: Hypothesis, now: Floats) -> Floats:
        """The nuisances' derivatives, of a number that an effect changes that of the effect."""
        rates = nuisance_rates.copy()
        for column, axis, w in zip(
            axis_rates.T, hypothesis.coordinates, now[len(self.nuisances) :].tolist(), strict=True
        ):
            name = LEVELS.get(axis.effect)
            if name in self.nuisances.rig_names:
                i = self.nuisances.rig_names.index(name)
                growth = self.nuisances.growth(name, float(now[i]))
                rates[:, i] = column * growth * (1.0 + axis.value(w)) / axis.scale
        return rates

    @staticmethod
    def _chi2(prior: Floats, residual: Floats, at: Floats) -> float:
        held = prior * at
        return float(residual @ residual + held @ held)

    def _aside(self, deviations: Floats, size: float) -> Floats:
        """A point beside these deviations for every nuisance, `size` towards what is described [nuisances, nuisances]."""
        return deviations + np.diag(np.where(deviations > 0.0, -size, size))

    def _nuisance_rates(self, deviations: Floats, here: Floats, aside: Floats, there: Sequence[Floats]) -> Floats:
        steps = np.diag(aside - deviations)
        return np.column_stack([self._rate(here, *one) for one in zip(there, steps.tolist(), strict=True)])

    def _axis_rates(self, hypothesis: Hypothesis, deviations: Floats, w: Floats, here: Floats) -> Work[Floats]:
        steps = _axis_steps(hypothesis, w)
        columns = np.zeros((int(self.floor.compared.sum()), len(w)))
        there = yield Question(_beside(hypothesis, deviations, w))
        for i, one in enumerate(there):
            columns[:, i] = self._rate(here, one, float(steps[i]))
        return columns

    def _rate(self, here: Floats, there: Floats, step: float) -> Floats:
        change = (self.floor.expected(there) - self.floor.expected(here))[self.floor.compared]
        z = change / (self.floor.scatter[self.floor.compared] * step)
        return np.where(np.isfinite(z), z, 0.0)
