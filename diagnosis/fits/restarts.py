"""Where leading fits are refitted from, so that none wins because another one's valley was never entered."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.fits.expected import much_left
from diagnosis.fits.fit import Fit
from diagnosis.fits.refits import Start
from diagnosis.hypotheses.hypothesis import Hypothesis

Floats = npt.NDArray[np.floating[Any]]
_CONTENDERS, _CONTENDS = 3, 0.3  # single effects, if they close this share of what the best one closes,
_RIVALS = 0.9  # this one where two effects explain what none does alone
_RIVAL_PAIRS = 0.7  # of what the best pair takes beyond the best single effect


def alone(pairs: list[Fit]) -> list[Start]:
    """Each effect of the best pair alone, from where the pair left it."""
    if not pairs:
        return []
    best = min(pairs, key=lambda fit: fit.chi2)
    starts: list[Start] = []
    for name, form in best.hypothesis.forms.items():
        own = [i for i, axis in enumerate(best.hypothesis.coordinates) if axis.effect == name]
        starts.append(
            (Hypothesis({name: form}, tuple(best.hypothesis.coordinates[i] for i in own)), best.deviations, best.w[own])
        )
    return starts


def contenders(retuned: Fit, singles: list[Fit], pairs: list[Fit], expected_chi2: float) -> list[Fit]:
    """The leading single effects; where only two explain the gap, the best one if it is of the two, and its rivals."""
    if not pairs or much_left(pairs[0], expected_chi2) or not much_left(singles[0], expected_chi2):
        return singles[:_CONTENDERS]
    rivals = [fit for fit in close(retuned, singles, _RIVALS)[:_CONTENDERS] if fit is not singles[0]]
    return [fit for fit in singles[:1] if rivals or fit.hypothesis.effects[0] in pairs[0].hypothesis.effects] + rivals


def rival_pairs(singles: list[Fit], pairs: list[Fit]) -> list[Fit]:
    """The best pairs, if they take nearly as much more than the best single effect does.

    Beside a base of 11 detection limits a Stribeck velocity had ended at chi2 331, friction that lags at 255 and was named; from
    the described rig, from the retuned one and from the lag's nuisances it came to 179 to 188, the lag to no less.
    """
    return [
        pair
        for pair in pairs[:_CONTENDERS]
        if singles[0].chi2 - pair.chi2 > _RIVAL_PAIRS * (singles[0].chi2 - pairs[0].chi2)
    ]


def starts_of(contenders: list[Fit], retuned: Fit, sizes: tuple[float, ...]) -> list[Start]:
    """The contenders from the described rig, from the retuned one and from the best one's nuisances, and that one from theirs.

    From the first two also with `sizes` times their first number.

    A lag was named at chi2 155, as the static friction that it was had ended at 235: from the described rig and from the lag's
    nuisances it came to 143. A roll-off at 481 got a second effect; from the retuned rig it came to 245, refitted further to 117.
    """
    if not contenders:
        return []
    best, *rest = close(retuned, contenders)
    nuisances = (np.zeros_like(retuned.deviations), retuned.deviations)
    starts = [
        (fit.hypothesis, deviations, w)
        for fit in (best, *rest)
        for deviations in nuisances
        for w in (fit.w, *(_resized(fit, size) for size in sizes))
    ]
    return starts + [
        (one.hypothesis, other.deviations, one.w) for fit in rest for one, other in ((fit, best), (best, fit))
    ]


def _resized(fit: Fit, size: float) -> Floats:
    w = fit.w.copy()
    w[0] = w[0] + math.log(size) if fit.hypothesis.coordinates[0].logarithmic else w[0] * size
    return w


def close(retuned: Fit, fits: list[Fit], share: float = _CONTENDS) -> list[Fit]:
    """The fits, best first, that close more than this share of what the best one closes."""
    return [fit for fit in fits if retuned.chi2 - fit.chi2 > share * (retuned.chi2 - fits[0].chi2)]
