"""Which effects these runs cannot tell apart: effects that explain them equally well, or that imitate the named effect."""

import copy

from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.verdict.judge import JITTER, RankedFit

# Log evidence within which two effects count as alike. Too small: a name stands alone although another fits as well.
# Too large: effects that the runs separate are called alike. Counted: docs/method/diagnosis.md.
_SAME = 6.0
_TRIED = 4  # candidates behind the named effect that are compared with it; each may cost a refit


def imitators(fitter: Fitter, ranked: list[RankedFit], scale: float) -> tuple[str, ...]:
    """The named effect, then the effects that explain its runs equally well; empty where no other effect does.

    Args:
        fitter: of the fitted runs.
        ranked: single effects, the named effect first.
        scale: the misfit that the verdict's evidence is divided by.

    """
    named = ranked[0]
    perfect = copy.copy(fitter.problem)
    # the features that the rig would show if the named effect were its only effect
    perfect.measured = fitter.predicted(named.fit.deviations, named.fit.effects) + fitter.floor.bias
    imitated = fitter.for_problem(perfect)
    alike = [
        candidate.fit.hypothesis.effects[0]
        for candidate in ranked[1 : 1 + _TRIED]
        if named.evidence - candidate.evidence < _SAME
        or (
            named.evidence - candidate.evidence < 2.0 * _SAME
            and _loss(imitated, named.fit, candidate.fit, scale) < _SAME
        )
    ]
    return (named.fit.hypothesis.effects[0], *alike) if alike else ()


def _loss(imitated: Fitter, named: Fit, other: Fit, scale: float) -> float:
    """The log evidence by which `other` is behind `named` on runs that `named` alone has made."""
    judged = imitated.judged(named)
    best = imitated.refit(other.hypothesis, other.deviations, other.w)
    closer = float(best.residual @ best.residual - judged.residual @ judged.residual)
    return 0.5 * closer / (scale * JITTER) + 0.5 * ((best.chi2 - judged.chi2) - closer)
