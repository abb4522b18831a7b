"""The chi2 that a right model leaves, and whether noise hides the slips. Case histories: docs/method/diagnosis.md."""

from diagnosis.fits.fit import Fit

# Both limits below are multiples of the chi2 that a perfect model leaves on this evidence.
# Beyond this limit all of the baseline's chi2 counts against "no gap", however badly every model fits.
# Too small: rigs without a gap get one. Too large: a gap that no model explains becomes uncertain.
# Counted: docs/method/diagnosis.md.
NEVER_WITHOUT_GAP = 1.8
# A fit beyond this limit leaves more than a right model would. Too small: right effects are called unexplained.
# Too large: an effect outside the library passes for one inside. Counted: docs/method/diagnosis.md.
MUCH = 1.6
# Chi2 of a perfect model, per compared feature, from which noise counts as hiding the slips; the floor is doubtful there.
# Too small: ordinary evidence is called hidden. Too large: scatter is searched for effects. Counted: docs/method/diagnosis.md.
_HIDDEN_BY_NOISE = 0.4


def much_left(fit: Fit, expected_chi2: float) -> bool:
    """Whether a fit leaves more than a right model would; a right model leaves `expected_chi2` on average."""
    return fit.chi2 > MUCH * expected_chi2


def hidden_by_noise(fit: Fit, expected_chi2: float) -> bool:
    """Whether even a right model leaves so much per compared feature that noise must hide the slips."""
    return expected_chi2 > _HIDDEN_BY_NOISE * len(fit.residual)
