"""More starts for the leading fits, so that no effect wins only because another effect's fit stopped too early.

Case histories: docs/method/fits.md.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.fits.expected import much_left
from diagnosis.fits.fit import Fit
from diagnosis.fits.refits import Start
from diagnosis.hypotheses.hypothesis import Hypothesis

Floats = npt.NDArray[np.floating[Any]]
# Fits that are restarted: so many at most, and only those that close this share of what the best one closes. Fewer, or a larger
# share: a right effect whose first fit stopped early is lost. More, or a smaller share: time.
_CONTENDERS, _CONTENDS = 3, 0.3
# The same share where two effects explain the gap and no single effect does: only close rivals are worth a refit there.
_RIVALS = 0.9
# Pairs that are restarted take this share of the best pair's gain over the best single effect. Larger: a right pair whose fit
# stopped early is lost. Smaller: time.
_RIVAL_PAIRS = 0.7


def alone(pairs: list[Fit]) -> list[Start]:
    """Starts for each effect of the best pair alone, at its values in the pair."""
    if not pairs:
        return []
    best = min(pairs, key=lambda fit: fit.chi2)
    starts: list[Start] = []
    for name, form in best.hypothesis.forms.items():
        own = [i for i, coordinate in enumerate(best.hypothesis.coordinates) if coordinate.effect == name]
        starts.append(
            (Hypothesis({name: form}, tuple(best.hypothesis.coordinates[i] for i in own)), best.deviations, best.w[own])
        )
    return starts


def contenders(baseline: Fit, singles: list[Fit], pairs: list[Fit], expected_chi2: float) -> list[Fit]:
    """The single effects to restart: the first few.

    Where only a pair explains the gap: the best single effect, if the pair contains it or rivals are close, and those rivals.
    """
    if not pairs or much_left(pairs[0], expected_chi2) or not much_left(singles[0], expected_chi2):
        return singles[:_CONTENDERS]
    rivals = [fit for fit in close(baseline, singles, _RIVALS)[:_CONTENDERS] if fit is not singles[0]]
    return [fit for fit in singles[:1] if rivals or fit.hypothesis.effects[0] in pairs[0].hypothesis.effects] + rivals


def rival_pairs(singles: list[Fit], pairs: list[Fit]) -> list[Fit]:
    """The first few pairs whose gain over the best single effect is nearly as large as that of the best pair."""
    return [
        pair
        for pair in pairs[:_CONTENDERS]
        if singles[0].chi2 - pair.chi2 > _RIVAL_PAIRS * (singles[0].chi2 - pairs[0].chi2)
    ]


def starts_of(contenders: list[Fit], baseline: Fit, sizes: tuple[float, ...]) -> list[Start]:
    """Starts for those contenders that are close to the best one.

    Each starts with the nuisances of the described rig and of the baseline, there also with `sizes` times its first coordinate.
    The best one starts also with the nuisances of each other contender, and each other contender with those of the best one.
    """
    if not contenders:
        return []
    best, *rest = close(baseline, contenders)
    nuisances = (np.zeros_like(baseline.deviations), baseline.deviations)
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


def close(baseline: Fit, fits: list[Fit], share: float = _CONTENDS) -> list[Fit]:
    """The fits that close more than this share of what the best one, the first, closes of the baseline's chi2."""
    return [fit for fit in fits if baseline.chi2 - fit.chi2 > share * (baseline.chi2 - fits[0].chi2)]
