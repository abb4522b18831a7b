"""Probabilities from columns: one weight for each column, shared by all explanations, trained on rigs of known truth.

Names: a softmax of the weighted columns over all explanations. Outside: a logistic of the columns of the whole evidence.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, softmax

from bench.judge.weighed.columns import Table
from bridge.arrays import Floats

# Penalty on squares of the weights of scaled columns. Larger: evidences are not used. Smaller: chance of few rigs is learned.
_HELD = 1e-2
_LEAST_SPREAD = 1e-3  # of a column over all evidences: less is the same for all of them


class Weights(NamedTuple):
    """Weights of columns, which are scaled but not shifted for names, as a shift is the same for all explanations."""

    scale: Floats  # [columns]
    names: Floats
    whole_mean: Floats  # [whole columns]
    whole_scale: Floats
    outside: Floats
    outside_bias: Floats  # [1]

    def probabilities(self, table: Table) -> Floats:
        """Of the explanations [explanations]; together 1."""
        return softmax((table.columns / self.scale) @ self.names)

    def beyond(self, table: Table) -> float:
        """Probability that the library does not explain the evidence."""
        score = ((table.whole - self.whole_mean) / self.whole_scale) @ self.outside + self.outside_bias[0]
        return float(expit(score))

    @classmethod
    def read(cls, table: dict[str, Any]) -> "Weights":
        """The weights of a file."""
        return cls(**{name: np.array(table[name]) for name in cls._fields})


def trained(
    tables: Sequence[Table], targets: Sequence[Floats], wholes: Floats, outside: Floats, counts: Floats
) -> Weights:
    """The weights of the highest likelihood.

    Args:
        tables: evidences whose truth the library has.
        targets: for each of them the right share of every explanation [explanations].
        wholes: [evidences, whole columns], of these and of others whose truth the library lacks.
        outside: 1 for the others, else 0 [evidences].
        counts: how often each of them counts [evidences].

    """
    stacked, right = np.concatenate([table.columns for table in tables]), np.concatenate(targets)
    scale = _scale(np.sqrt(np.mean(stacked**2, axis=0)))
    stacked = stacked / scale
    firsts = np.cumsum([0, *(len(table.names) for table in tables)])[:-1]
    lengths = np.diff([*firsts, len(stacked)])

    def loss(weights: Floats) -> tuple[float, Floats]:
        scores = stacked @ weights
        scores -= np.repeat(np.maximum.reduceat(scores, firsts), lengths)
        logarithms = scores - np.repeat(np.log(np.add.reduceat(np.exp(scores), firsts)), lengths)
        slope = (np.exp(logarithms) - right) @ stacked / len(tables) + _HELD * weights
        return -float(right @ logarithms) / len(tables) + 0.5 * _HELD * float(weights @ weights), slope

    names = _least(loss, stacked.shape[1])
    mean, spread = wholes.mean(axis=0), _scale(wholes.std(axis=0))
    rows = np.concatenate([(wholes - mean) / spread, np.ones((len(wholes), 1))], axis=1)
    shares = counts / counts.sum()

    def loss_outside(weights: Floats) -> tuple[float, Floats]:
        scores = rows @ weights
        held = _HELD * np.append(weights[:-1], 0.0)
        value = float(shares @ (np.logaddexp(0.0, scores) - outside * scores)) + 0.5 * float(held @ weights)
        return value, (shares * (expit(scores) - outside)) @ rows + held

    beyond = _least(loss_outside, rows.shape[1])
    return Weights(scale, names, mean, spread, beyond[:-1], beyond[-1:])


def _least(loss: Any, count: int) -> Floats:
    return minimize(loss, np.zeros(count), jac=True, method="L-BFGS-B", options={"maxiter": 1000}).x


def _scale(spread: Floats) -> Floats:
    return np.where(spread > _LEAST_SPREAD, spread, 1.0)
