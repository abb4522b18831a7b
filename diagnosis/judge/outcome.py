"""From the answer of the judge to the verdict of the format, and to the described numbers that were wrong."""

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from diagnosis.fits.fit import Fit
from diagnosis.fits.held_out import MORE_THAN_RIGHT, HeldOut
from diagnosis.hypotheses.hypothesis import LEVELS, MASS, Hypothesis
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.judge.judge import Judged
from diagnosis.result import Gap, Kind, WrongNumber

# Distance from the described number, in tolerances, from which a number counts as wrong. Smaller: right numbers are listed, at
# 1.6 one in half of the rigs with eight. Larger: a static force 2.96 off, which closed 12.6 of 12.6 floors, was not listed.
BEYOND: Final = 2.0
# Share of the gap that a wrong number must close for the verdict. Smaller: idle numbers are named. Larger: of two wrong numbers
# that imitate each other neither is named.
_MOST = 0.5
# Distance, in tolerances, from which a number is wrong although the refitted rig leaves no gap. Smaller: right numbers are
# named, at 2.6 in 7 % of the rigs with seven, at 2.9 in 3 %. Larger: a static force 2.96 off is not.
_FAR = 2.9
_HALF = 0.5
_TWO_SIDED_90 = 1.645


class Model(NamedTuple):
    """The model of the leading explanation."""

    fitted: bool  # otherwise its size and the gap that it closes are unknown
    numbers: tuple[WrongNumber, ...]  # described numbers that moved beyond their tolerance
    gap: Gap  # on the held-out runs
    outside: bool  # whether a relation, or a vibration, shows something that no effect of the library causes


def verdict_of(judged: Judged, model: Model, latent: tuple[str, ...]) -> tuple[Kind, tuple[str, ...]]:
    """The verdict and the effects of the format.

    Args:
        judged: answer of the judge.
        model: the model of its leading explanation.
        latent: effects that the latent friction shows, for runs that no formula explains.

    """
    names = tuple(sorted(judged.names - {MASS}, key=lambda name: -judged.effects[name]))
    kind = _kind(judged, model)
    if kind == "effect" and LEVELS.keys() >= judged.names:
        return "described", names
    least = {"unexplained": BEYOND, "no-gap": _FAR}.get(kind, math.inf)
    closing = {number.name for number in model.numbers if (number.share or 0.0) > _MOST and (number.off or 0.0) > least}
    if closing and model.gap.retuned <= MORE_THAN_RIGHT and not model.outside:
        return "described", tuple(effect for effect, number in LEVELS.items() if number in closing and effect != MASS)
    if kind == "unexplained" and latent and not model.outside:
        return "partly", latent[:1]
    if kind == "partly" and not names:  # another mass alone
        return "unexplained", ()
    return kind, names if kind in ("effect", "partly") else ()


def _kind(judged: Judged, model: Model) -> Kind:
    complete = judged.complete >= _HALF
    if not judged.names:
        return "no-gap" if complete and not model.gap.retuned > MORE_THAN_RIGHT else "unexplained"
    if complete and model.fitted and not model.gap.with_effect > MORE_THAN_RIGHT:
        return "effect"
    # an explanation that predicts the held-out runs no better than the rig without effects explains nothing
    return "unexplained" if model.gap.shrinkage is not None and model.gap.shrinkage <= 0.0 else "partly"


def wrong_numbers(nuisances: Nuisances, fit: Fit, held_out: HeldOut | None) -> Iterator[WrongNumber]:
    """The described numbers that moved beyond their tolerance in a fit, and those whose level it has as an effect.

    A level and the refitted number are one direction of the fit, so both together are the number that was found. Raises
    OutOfTimeError.
    """
    covariance, count = fit.covariance(), len(nuisances)
    coordinates = fit.hypothesis.coordinates
    for name, described in nuisances.described.items():
        levels = [j for j, axis in enumerate(coordinates) if LEVELS.get(axis.effect) == name]
        moved = [i for i, known in enumerate(nuisances.rig_names) if known == name]
        if not levels and not any(abs(fit.deviations[i]) > BEYOND for i in moved):
            continue
        value, rates = described, np.zeros(len(covariance))
        for i in moved:
            deviation = float(fit.deviations[i])
            value, rates[i] = nuisances.value(name, deviation), nuisances.growth(name, deviation)
        for j in levels:
            growth = 1.0 + coordinates[j].value(float(fit.w[j]))
            value *= growth
            rates[count + j] = coordinates[j].scale / growth
        half = _TWO_SIDED_90 * abs(value) * float(np.sqrt(rates @ covariance @ rates))
        share = None if held_out is None else held_out.share_closed(_without(fit, moved, levels), fit)
        off = abs(value / described - 1.0) / nuisances.tolerance[name] if moved else None
        yield WrongNumber(name, described, value, (value - half, value + half), off, share)


def _without(fit: Fit, moved: list[int], levels: list[int]) -> Fit:
    """A fit with a number as described: the nuisances `moved` at 0, and without the effects of the coordinates `levels`."""
    kept = [j for j in range(len(fit.w)) if j not in levels]
    gone = {fit.hypothesis.coordinates[j].effect for j in levels}
    hypothesis = Hypothesis(
        {name: form for name, form in fit.hypothesis.forms.items() if name not in gone},
        tuple(fit.hypothesis.coordinates[j] for j in kept),
    )
    deviations = fit.deviations.copy()
    deviations[moved] = 0.0
    return fit._replace(hypothesis=hypothesis, deviations=deviations, w=fit.w[kept])
