"""What a right model leaves of chi2, and what noise can hide."""

from diagnosis.fits.fit import Fit

# What follows is in chi2 of a perfect model on this evidence. 35 rigs without a gap left 0.6 to 1.7.
# What is beyond this counts against `none` in full: however wrong every model is, that there is a gap stays certain.
NEVER_WITHOUT_GAP = 1.8
# More than a model that is right leaves: of 84 single effects rightly named, of 1 to 14 detection limits and in other formulas,
# 78 left less. The others left up to 3.8 where the rig was 60 times the expected off; of 19 effects outside the library all but
# a tilted track left 1.9 to 35.
MUCH = 1.6
# chi2 a feature that a perfect model leaves: 0.2 to 0.28 are usual, 0.52 on a log whose noise hides the slips. What its floor is
# worth nobody knows: there a right model must leave the expected, and nothing is looked for in what scatters.
_HIDDEN_BY_NOISE = 0.4


def much_left(fit: Fit, expected_chi2: float) -> bool:
    """Whether a fit leaves more than a model that is right would; that leaves `expected_chi2` on average."""
    return fit.chi2 > MUCH * expected_chi2


def hidden_by_noise(fit: Fit, expected_chi2: float) -> bool:
    """Whether even a model that is right leaves so much that noise must hide the slips."""
    return expected_chi2 > _HIDDEN_BY_NOISE * len(fit.residual)
