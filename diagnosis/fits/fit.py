"""A fit: values of nuisances and effect, how well the model matches the runs there, and the Newton step from there."""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.model.rig import Effects

# chi2 that a right explanation leaves of one compared feature: floors hold more than noise.
NOISE: Final = 0.25
# Weight of a feature's square, over the square that the fit leaves, in the covariance: features share errors, and chi2 has many
# valleys. Numbers of 59 simulated rigs within their 90 % interval: 0.2 holds 63 %, 0.02 83 %, 0.01 86 %.
_CERTAINTY = 0.02


class Fit(NamedTuple):
    """A model fitted to the measured features of a problem."""

    hypothesis: Hypothesis
    deviations: Floats  # of the nuisances from the described rig, in tolerances [nuisances]
    w: Floats  # values of the hypothesis' coordinates [coordinates]
    chi2: float  # squares of the residual, and the priors' terms
    residual: Floats  # whitened differences, measured less predicted [compared]
    columns: Floats  # whitened derivatives, nuisances then coordinates [compared, nuisances + coordinates]
    finished: bool = False  # whether another refit from here would gain next to nothing

    @property
    def effects(self) -> Effects:
        """The effects of the model, as tables of a rig file."""
        return self.hypothesis.tables(self.w)

    def covariance(self) -> Floats:
        """Covariance from columns and priors, nuisances then coordinates [nuisances + coordinates, same].

        Raises numpy.linalg.LinAlgError when the columns hold values that are not finite.
        """
        prior = np.diag(prior_of(self.hypothesis, self.deviations) ** 2)
        left = max(self.chi2 / max(len(self.residual), 1), NOISE)
        result: Floats = np.linalg.inv(self.columns.T @ self.columns * _CERTAINTY / left + prior)
        return result


def prior_of(hypothesis: Hypothesis, deviations: Floats) -> Floats:
    """Inverse prior standard deviations [nuisances + coordinates]: 1 for a nuisance, as deviations count in tolerances."""
    return np.concatenate([np.ones(len(deviations)), [1.0 / coordinate.prior for coordinate in hypothesis.coordinates]])


def step_within(normal: Floats, gradient: Floats, at: Floats, most: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """The Newton step from `at` [parameters], and which parameters it moves [parameters].

    A nuisance at its bound stays there if the step would take it beyond.

    Args:
        normal: matrix of the normal equations [parameters, parameters].
        gradient: right side of the normal equations [parameters].
        at: where the step begins [parameters]: nuisances, then coordinates.
        most: bounds of the nuisances, the same in both directions [nuisances].

    Raises numpy.linalg.LinAlgError where the normal equations are singular.

    """
    nuisances = len(most)
    edge = np.zeros(len(at), np.bool_)
    edge[:nuisances] = np.abs(at[:nuisances]) >= most
    free = np.ones(len(at), np.bool_)
    while True:
        step = np.zeros(len(at))
        step[free] = np.linalg.solve(normal[free][:, free], gradient[free])
        beyond = edge & (step * at > 0.0)
        if not beyond.any():
            return step, free
        free &= ~beyond
