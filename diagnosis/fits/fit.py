"""A fit: a point in nuisances and parameters, what the runs say of it, and the step from it."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.model.rig import Effects

Floats = npt.NDArray[np.floating[Any]]


class Fit(NamedTuple):
    """A model fitted to the measured features of a problem."""

    hypothesis: Hypothesis
    deviations: Floats  # of the nuisances, in tolerances [nuisances]
    w: Floats  # [axes]
    chi2: float  # with the priors' terms
    residual: Floats  # whitened [compared]
    columns: Floats  # whitened derivatives, nuisances then axes [compared, nuisances + axes]
    finished: bool = False  # a refit from here gains nothing worth having

    @property
    def effects(self) -> Effects:
        """The effects of the model as tables of a rig file."""
        return self.hypothesis.tables(self.w)

    def covariance(self) -> Floats:
        """Of nuisances and axes together, from the columns and the priors."""
        prior = np.concatenate(
            [np.ones(len(self.deviations)), [axis.prior**-2 for axis in self.hypothesis.coordinates]]
        )
        result: Floats = np.linalg.inv(self.columns.T @ self.columns + np.diag(prior))
        return result


def prior_of(hypothesis: Hypothesis, deviations: Floats) -> Floats:
    """Inverse standard deviations of nuisances and axes."""
    return np.concatenate([np.ones(len(deviations)), [1.0 / axis.prior for axis in hypothesis.coordinates]])


def step_within(normal: Floats, gradient: Floats, at: Floats, most: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """The Newton step from `at`, and what is free on it: what stands at its bound stays there if it would go beyond.

    Args:
        normal: matrix of the normal equations [parameters, parameters].
        gradient: their right side [parameters].
        at: where the step begins [parameters]: nuisances, then axes.
        most: bounds of the nuisances, either way [nuisances].

    """
    own = len(most)
    edge = np.zeros(len(at), np.bool_)
    edge[:own] = np.abs(at[:own]) >= most
    free = np.ones(len(at), np.bool_)
    while True:
        step = np.zeros(len(at))
        step[free] = np.linalg.solve(normal[free][:, free], gradient[free])
        beyond = edge & (step * at > 0.0)
        if not beyond.any():
            return step, free
        free &= ~beyond
