"""The next run to measure: the shortest that separates the two leading explanations decisively, or the best separation.

Both explanations predict every run that could be measured. Their difference is measured in noise floors, without the part that
either explanation can imitate by changing uncertain numbers of rig, sensors and effect.
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from bridge.units import signal_name
from diagnosis.experiments.candidate_runs import Plan, as_run, plans
from diagnosis.features.feature import Feature
from diagnosis.fits.fit import Fit
from diagnosis.fits.surface import ROUGHNESS
from diagnosis.gap.measure import LACKING, Floor, compress, floor_of, replicates, slope_of_compress
from diagnosis.gap.problem import PIEZO_EFFECTS, Point, Problem
from diagnosis.hypotheses.catalogue import CATALOGUE, FRAME, SPEEDS, SWEEP, TAP, TRACK, WEIGHT
from diagnosis.hypotheses.hypothesis import MASS
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.result import Experiment
from plant.effects.library import EFFECTS

# Replicates for a first look, and for a judgement. Fewer: the floor of the imagined run is uncertain. More: time.
_FEW, _SOME = 2, 6
# Sufficient separation, in standard deviations. Smaller: an unsure run is proposed. Larger: longer runs without more certainty.
_DECISIVE = 10.0
# A first look must exceed the decisive separation by this factor, as it subtracts nothing that could be imitated.
# Smaller: more runs are judged in vain. Larger: a decisive short run is skipped.
_PROMISING = 1.5
_JUDGED = 3  # number of judged runs if no run is decisive, those with the best first look
# Separation, in standard deviations, below which no run is proposed. Smaller: an hour at the rig for little. Larger: a check by
# hand where a run would help.
_SEPARATES = 2.0
# Standard deviation, in tolerances or scales, below which a coordinate counts as known and imitates nothing. Larger: separations
# look too large. Smaller: more derivatives for the same answer.
_CERTAIN = 0.05
# Steps for derivatives: of nuisances in tolerances, of an effect's coordinates in their units. Small against curvature.
_STEP, _STEP_OF_EFFECT = 0.5, 0.15
UNCOUPLE = "Uncouple the drive from the mass and vibrate: any vibration left in the force signal is not force."
WEIGH = "Weigh the slide with everything that moves with it."
SINE = "Halve the piezo's voltage, then tighten its mount: harmonics of a drive too hard or loose fall faster than the vibration."
_FORCES = "Move the axis to and fro at 0.2, 1 and 5 times the present speeds, from other positions, with rests of 1, 10 and 60 s."
_BY_PLACE: Final = {"sensor": WEIGHT, "drive": TAP, "structure": FRAME, "piezo": SWEEP, "friction": SPEEDS}


class _Look(NamedTuple):
    """The separation of two explanations by a run."""

    plan: Plan
    separation: float  # standard deviations
    feature: Feature | None  # the feature that differs most; None in a first look


def next_experiment(problem: Problem, nuisances: Nuisances, leaders: list[Fit]) -> Experiment:
    """The best next run for the first two leaders; a check by hand where no run separates them.

    Args:
        problem, nuisances: the fitted runs, and the numbers of the rig and its sensors.
        leaders: the leading fits, the named fit or the baseline first.

    """
    if len(leaders) < 2 or leaders[0].hypothesis.effects == leaders[1].hypothesis.effects:
        text = "Only one explanation is left: a run under conditions that were not measured yet would test it hardest."
        return Experiment("Repeat a run at another drive speed, from another start.", text, None)
    first, second = leaders[0], leaders[1]
    names = tuple(dict.fromkeys((*first.hypothesis.effects, *second.hypothesis.effects)))
    both = f"{_name(first)} and {_name(second)}"
    if problem.rig.drive == "force":
        return Experiment(advice(names, "force"), f"Of all tried explanations, {both} fit these runs best.", None)
    # distance of the two fits in the present runs
    present = float(np.linalg.norm(first.residual - second.residual))
    best = _best(problem, nuisances, first, second)
    if best is None or best.separation < _SEPARATES or best.feature is None:
        most = (
            "no run within reach of this rig separates them"
            if best is None
            else f"no run separates them by more than {best.separation:.1f} standard deviations"
        )
        return Experiment(advice(names, "spring"), f"{both} look alike: {most}: this is a check by hand.", None)
    separation = f"{best.separation:.1f} standard deviations, most in {_in_words(best.feature)}"
    if present > _DECISIVE:
        why = (
            f"{both} differ by {present:.1f} standard deviations in the present runs already; "
            f"a run like this would confirm it, with {separation}."
        )
    elif present > best.separation:
        why = f"{both} differ by {present:.1f} standard deviations in the present runs; there it would again be {separation}."
    else:
        why = f"There {both} differ by {separation}; in the present runs by {present:.1f}."
    return Experiment(best.plan.what, why, best.separation)


def _best(problem: Problem, nuisances: Nuisances, first: Fit, second: Fit) -> _Look | None:
    """The shortest decisive plan; where no plan is decisive, the plan that separates most."""
    left: list[_Look] = []
    judged: list[_Look] = []
    possible = sorted(plans(problem), key=lambda plan: plan.effort_s)
    if any(name in PIEZO_EFFECTS for fit in (first, second) for name in fit.hypothesis.effects):
        # without vibration an effect of the piezo acts only through other numbers that the fit has changed
        possible = [plan for plan in possible if any(step.frequency_Hz > 0.0 for step in plan.steps)]
    for plan in possible:
        look = _first_look(problem, nuisances, plan, first, second)
        if look is None:
            continue
        if look.separation < _PROMISING * _DECISIVE:
            left.append(look)
            continue
        judged.append(_judged(problem, nuisances, plan, first, second))
        if judged[-1].separation > _DECISIVE:
            return judged[-1]
    left.sort(key=lambda look: -look.separation)
    judged += [_judged(problem, nuisances, look.plan, first, second) for look in left[: max(_JUDGED - len(judged), 0)]]
    return max(judged, key=lambda look: look.separation, default=None)


def _name(fit: Fit) -> str:
    return " + ".join(fit.hypothesis.effects) or "the rig as described"


class _Imagined:
    """A plan as a run that is measured under the first explanation, with its noise floor."""

    def __init__(self, problem: Problem, nuisances: Nuisances, plan: Plan, first: Fit, second: Fit, count: int) -> None:
        self._nuisances = nuisances
        first_point, second_point = (nuisances.point(fit.deviations, fit.effects) for fit in (first, second))
        self.problem = Problem(problem.rig, [as_run(problem, plan, first_point)], problem.jobs)
        drawn = replicates(self.problem, first_point, ROUGHNESS, count, 3, perhaps=(first_point, second_point))
        self.floor: Floor = floor_of(self.problem, first_point, drawn)
        first_expected, second_expected = self._expected([first_point, second_point])
        apart = second_expected - first_expected
        self.apart = np.where(np.isfinite(apart), apart, LACKING)
        """Second explanation minus first, in floors [compared]."""

    def _expected(self, points: list[Point]) -> list[Floats]:
        """The expected features at every point, in floors [compared]."""
        predictions = self.problem.predicted_many(points)
        return [
            (self.floor.expected(prediction) / self.floor.scatter)[self.floor.compared] for prediction in predictions
        ]

    def columns(self, fit: Fit, which: npt.NDArray[np.int64]) -> Floats:
        """Derivatives of the expected features with respect to some parameters of a fit, in floors [compared, which].

        Args:
            fit: the point of the derivatives.
            which: indices into nuisances, then the hypothesis' coordinates.

        """
        nuisances = len(fit.deviations)
        at = np.concatenate([fit.deviations, fit.w])
        steps = [(_STEP if i < nuisances else _STEP_OF_EFFECT) * (-1.0 if at[i] > 0.0 else 1.0) for i in which.tolist()]
        ahead = [at, *(at + step * (np.arange(len(at)) == i) for i, step in zip(which.tolist(), steps, strict=True))]
        base, *moved = self._expected(
            [self._nuisances.point(vector[:nuisances], fit.hypothesis.tables(vector[nuisances:])) for vector in ahead]
        )
        columns = [(features - base) / step for features, step in zip(moved, steps, strict=True)]
        columns = [np.where(np.isfinite(column), column, 0.0) for column in columns]
        return np.column_stack(columns) if columns else np.zeros((len(base), 0))


def _first_look(problem: Problem, nuisances: Nuisances, plan: Plan, first: Fit, second: Fit) -> _Look | None:
    """An upper bound of the separation, without subtracting the part that can be imitated; None without a compared feature."""
    imagined = _Imagined(problem, nuisances, plan, first, second, _FEW)
    if not imagined.floor.compared.any():
        return None
    return _Look(plan, float(np.linalg.norm(compress(imagined.apart))), None)


def _judged(problem: Problem, nuisances: Nuisances, plan: Plan, first: Fit, second: Fit) -> _Look:
    imagined = _Imagined(problem, nuisances, plan, first, second, _SOME)
    z = imagined.apart
    whitening = imagined.floor.whitening
    slope = slope_of_compress(z)
    apart = whitening @ compress(z)
    free: list[Floats] = []
    for fit in (first, second):
        covariance = fit.covariance()
        uncertain = np.flatnonzero(np.sqrt(np.diag(covariance)) > _CERTAIN)
        root = np.linalg.cholesky(covariance[uncertain[:, None], uncertain])
        free.append(whitening @ (imagined.columns(fit, uncertain) * slope[:, None]) @ root)
    imitated = np.column_stack(free)
    inner = np.eye(imitated.shape[1]) + imitated.T @ imitated
    left = apart - imitated @ np.linalg.solve(inner, imitated.T @ apart)
    share = compress(z) * (whitening.T @ left)
    labels = [label for (_, label), used in zip(imagined.problem.labels, imagined.floor.compared, strict=True) if used]
    return _Look(plan, math.sqrt(max(float(apart @ left), 0.0)), labels[int(np.argmax(share))])


def _in_words(feature: Feature) -> str:
    name, signal = feature.name, signal_name(feature.signal)
    if feature.regime == "breakaway" and name == "mean":
        return "the force at which it breaks away"
    if feature.regime == "restick" and name == "mean":
        return "the force at which it sticks again"
    if name.startswith("wave") and feature.signal == "drive_position_m":
        return "how evenly the drive moves"
    if name.startswith("wave"):
        return f"how the {feature.regime} force changes along the run"
    words = {
        "period": "the time from slip to slip",
        "scatter": f"the scatter of the {feature.regime} force",
        "shape": f"the shape of a slip in the {signal}",
        "ring": f"how the {signal} rings after a slip",
        "rate": "how fast the force climbs at rest",
        "spring": "the force over the extension of the spring",
        "vibration": f"the vibration in the {signal}",
        "ripple": f"the ripple of the {signal}",
    }
    return words.get(name.split()[0], f"the level of the {signal}")


def advice(effects: tuple[str, ...], drive: str) -> str:
    """A physical check that separates these effects; with `drive` "force" other motions separate effects of friction."""
    if MASS in effects:
        return WEIGH
    for a in effects:
        for b in effects:
            check = CATALOGUE[a].check_against.get(b) or CATALOGUE[b].check_against.get(a)
            if check is not None and not (drive == "force" and check in {TRACK, SPEEDS}):
                return check
    # checks at a single part come before checks that need runs
    for places in (("sensor",), ("piezo", "structure", "drive"), ("friction",)):
        for name in effects:
            place = EFFECTS[name].acts_on
            if place in places:
                if drive == "force" and place == "friction":
                    return _FORCES
                return CATALOGUE[name].check or _BY_PLACE[place]
    return _FORCES if drive == "force" else SPEEDS
