"""Which effects these runs cannot tell apart: what explains them as well, and what imitates the effect that was named."""

import copy

from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.verdict.judge import JITTER, RankedFit

# Log evidence: what explains the runs, or imitates the named effect, to within this could as well have been named. A delay of the
# force of 9 limits was 1.4 behind a slow sensor that it could not have imitated: neither formula was quite the rig's.
_SAME = 6.0
_TRIED = 4  # candidates behind the named one


def imitators(fitter: Fitter, ranked: list[RankedFit], scale: float) -> tuple[str, ...]:
    """The named effect and those that would have explained its runs as well; empty where it stands alone.

    Args:
        fitter: of the fitted runs.
        ranked: single effects, the named one first.
        scale: the misfit of the verdict.

    """
    named = ranked[0]
    perfect = copy.copy(fitter.problem)
    # what the rig would have shown if the named effect were all of the truth
    perfect.measured = fitter.predicted(named.fit.deviations, named.fit.effects) + fitter.floor.bias
    imitated = fitter.for_problem(perfect)
    alike = [
        one.fit.hypothesis.effects[0]
        for one in ranked[1 : 1 + _TRIED]
        if named.evidence - one.evidence < _SAME
        or (named.evidence - one.evidence < 2.0 * _SAME and _loss(imitated, named.fit, one.fit, scale) < _SAME)
    ]
    return (named.fit.hypothesis.effects[0], *alike) if alike else ()


def _loss(imitated: Fitter, named: Fit, other: Fit, scale: float) -> float:
    """Log evidence that an effect is behind the truth in the truth's own runs."""
    there = imitated.judged(named)
    best = imitated.refit(other.hypothesis, other.deviations, other.w)
    closer = float(best.residual @ best.residual - there.residual @ there.residual)
    return 0.5 * closer / (scale * JITTER) + 0.5 * ((best.chi2 - there.chi2) - closer)
