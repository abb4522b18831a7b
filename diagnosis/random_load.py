"""A random normal load: no prediction can follow its path, so it is judged by how it would scatter the features.

Replicates of the fitted model under loads of their own, and of nothing else, give the mean and the covariance of what such a
load does to the whitened differences. With that covariance beside the noise and the priors of the nuisances, the differences
have a likelihood; its mean over a grid of sizes and frequencies, against the likelihood without the load, is the log evidence.
What the load's freedom costs is in the determinant: a random effect, as in Rasmussen & Williams, Gaussian Processes, 2006, ch. 5.
"""

import copy
import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve

from diagnosis.gap import compress, differences
from diagnosis.refit import Axis, Fit, Fitter, Form
from diagnosis.waves import friction_series

Floats = npt.NDArray[np.floating[Any]]
EFFECT: Final = "normal-load-fluctuation"
_FORM: Final = "random"
_FREQUENCIES_Hz = (1.0, 2.5, 6.0)
_SIZES = (0.3, 0.5, 0.7, 1.0, 1.4, 2.0)  # of the scatter that breakaways and levels show
_LEAST_RATIO = 0.005
_DRAWS = 16
_INDEPENDENT = 0.3  # share of the covariance that is taken as independent, as so few draws know few correlations
_SPREAD = {"ratio": 0.35, "frequency_Hz": 0.45}  # of the estimates, relative: the grid's


class Scattered(NamedTuple):
    """A model with a random load on top."""

    fit: Fit
    gained: float  # log evidence against the model without


class _Loads(NamedTuple):
    """What random loads of one frequency do to the whitened differences."""

    frequency_Hz: float
    mean: Floats  # [compared]
    covariance: Floats  # [compared, compared]


class RandomLoad:
    """Random loads on the rig of a fit, by which any fit of the same problem can be judged."""

    def __init__(self, fitter: Fitter, base: Fit) -> None:
        problem = fitter.problem
        series = friction_series(problem.runs, problem.scales, "time")
        seen = float(np.std(np.concatenate([one.value for one in series]))) if series else 0.0
        self._ratio = max(seen, _LEAST_RATIO)
        self._loads = [self._drawn(fitter, base, frequency_Hz) for frequency_Hz in _FREQUENCIES_Hz]

    def _drawn(self, fitter: Fitter, base: Fit, frequency_Hz: float) -> _Loads:
        here = fitter.predicted(base.deviations, base.effects)
        shown: list[Floats] = []
        for seed in range(1, _DRAWS + 1):
            table = {"form": _FORM, "ratio": self._ratio, "frequency_Hz": frequency_Hz, "seed": seed}
            loaded = copy.copy(fitter.problem)
            loaded.measured = fitter.predicted(base.deviations, base.effects | {EFFECT: table}) + fitter.floor.bias
            shown.append(fitter.floor.whitening @ compress(differences(fitter.floor, loaded, here)))
        drawn = np.array(shown)
        covariance = (1.0 - _INDEPENDENT) * np.cov(drawn, rowvar=False)
        covariance[np.diag_indices(len(covariance))] /= 1.0 - _INDEPENDENT
        return _Loads(frequency_Hz, drawn.mean(axis=0), covariance)

    def on(self, fit: Fit, noise: float) -> Scattered:
        """A fit with a random load on top.

        Args:
            fit: of the problem that the loads were drawn for, without a load.
            noise: variance of whitened differences under a model that is right.

        """
        own = len(fit.deviations)
        spread = np.concatenate([np.ones(own), [axis.prior for axis in fit.form.axes]])
        # the nuisances are free about their described values, the effects about where they were fitted
        residual = fit.residual + fit.columns[:, :own] @ fit.deviations
        scaled = fit.columns * spread
        fixed = scaled @ scaled.T + noise * np.eye(len(residual))
        nothing, _ = _likelihood(fixed, residual)
        tried = [
            (
                *_likelihood(fixed + size**2 * load.covariance, residual - _mean(size) * load.mean),
                size,
                load.frequency_Hz,
            )
            for load in self._loads
            for size in _SIZES
        ]
        _, left, size, frequency_Hz = max(tried)
        gained = float(np.logaddexp.reduce([likelihood - nothing for likelihood, *_ in tried])) - math.log(len(tried))
        scales = {"ratio": size * self._ratio, "frequency_Hz": frequency_Hz}
        axes = tuple(Axis(EFFECT, name, scale, True, _SPREAD[name], 0.0, math.inf) for name, scale in scales.items())
        return Scattered(
            fit._replace(
                form=Form(fit.form.forms | {EFFECT: _FORM}, (*fit.form.axes, *axes)),
                w=np.concatenate([fit.w, np.zeros(len(axes))]),
                chi2=noise**2 * left,
                columns=np.column_stack([fit.columns, np.zeros((len(residual), len(axes)))]),
            ),
            gained,
        )


def has_random_load(form: Form) -> bool:
    """Whether a form has a load whose path no prediction knows."""
    return form.forms.get(EFFECT) == _FORM


def _mean(size: float) -> float:
    """What a load of this size shifts features by, on that of the size 1: powers add to it, and count as logarithms."""
    return size * min(size, 1.0)


def _likelihood(covariance: Floats, residual: Floats) -> tuple[float, float]:
    """Log likelihood but for a constant, and the square of the residual after its covariance was divided out."""
    factor = cho_factor(covariance, lower=True)
    explained: Floats = cho_solve(factor, residual)
    likelihood = -0.5 * float(residual @ explained) - float(np.log(np.diag(factor[0])).sum())
    return likelihood, float(explained @ explained)
