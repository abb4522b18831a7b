"""The log evidence of a fit: its remainders in the fitted and the kept runs, and the cost of its free numbers."""

import math

import numpy as np

from bridge.arrays import Floats
from diagnosis.fits.fit import NOISE, Fit, prior_of

# Independent differences for each compared feature, as features share their errors. Half: small effects get no name. Twice: rigs
# without a gap get names.
_INDEPENDENT = 0.2
# How fast a remainder ceases to count, as a large one is error of formulas, which all explanations share: at ten times the noise
# half of a difference counts. 0.03: rigs without a gap that have another friction law get a name. 0.3: true effects on another
# friction law lose theirs.
_SHARED = 0.1


def of_remainder(chi2: float, features: int) -> float:
    """Log likelihood of a remainder whose noise is unknown: every explanation has the noise that it leaves.

    A formula that differs a little from the rig leaves more than the noise, in all explanations alike. So the ratio of two
    remainders counts, and it counts less where both are large: d value / d log(chi2) = - independent differences / 2, which are
    few where errors of formulas, each smooth over many features, make most of the remainder. Below the noise a remainder is
    chance.
    """
    times = max(chi2 / (NOISE * max(features, 1)), 1.0)
    return -0.5 * _INDEPENDENT * features * (math.log(times) - math.log1p(_SHARED * times))


def cost_of_freedom(fit: Fit, noise: float) -> float:
    """Logarithm of the volume that the data leave of the prior of nuisances and coordinates (Laplace), at most 0.

    Args:
        fit: a fit, with its columns.
        noise: chi2 that the best explanation leaves of one feature; a large one flattens the likelihood of `of_remainder`.

    """
    scaled: Floats = fit.columns / prior_of(fit.hypothesis, fit.deviations)
    information = scaled.T @ scaled * _INDEPENDENT / (noise * (1.0 + _SHARED * noise / NOISE))
    return -0.5 * float(np.linalg.slogdet(np.eye(scaled.shape[1]) + information)[1])
