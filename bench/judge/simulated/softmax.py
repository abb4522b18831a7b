"""Probabilities of names from tables of witnesses: a softmax whose weights all effects share.

score(effect) = shared . columns of the effect; score(none), score(outside) = whole . columns of the rig + bias. Further weights
for each effect changed nothing with 100 rigs: of 69 other singles 49 came first, without them 48.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from bridge.arrays import Floats

_HELD = (
    1e-2  # penalty on squares of the weights. Larger: witnesses are not used. Smaller: chance is learned from few rigs
)
_LEAST_SPREAD = 1e-3  # of a column over the rigs: less is the same for all of them


class Softmax(NamedTuple):
    """Weights over standardised columns."""

    mean: Floats  # of the columns of effects [columns]
    scale: Floats
    whole_mean: Floats  # of the columns of the rig as a whole [whole columns]
    whole_scale: Floats
    shared: Floats  # [columns]
    whole: Floats  # of none and of outside [2, whole columns]
    whole_bias: Floats  # [2]

    def probabilities(self, tables: Floats, wholes: Floats) -> Floats:
        """[rigs, effects + 2], none and outside last; from `tables` [rigs, effects, columns], `wholes` [rigs, whole columns]."""
        scores = _scores(self, (tables - self.mean) / self.scale, (wholes - self.whole_mean) / self.whole_scale)
        return np.exp(scores - logsumexp(scores, axis=1, keepdims=True))

    @classmethod
    def read(cls, table: dict[str, Any]) -> "Softmax":
        """The weights of a model file."""
        return cls(**{name: np.array(table[name]) for name in cls._fields})


def _scores(weights: Softmax, tables: Floats, wholes: Floats) -> Floats:
    return np.concatenate([tables @ weights.shared, wholes @ weights.whole.T + weights.whole_bias], axis=1)


def trained(tables: Floats, wholes: Floats, targets: Floats, counts: Floats) -> Softmax:
    """The weights of the least mean log loss; `targets` [rigs, effects + 2] add up to 1, `counts` [rigs] weigh the rigs."""
    shares = (counts / counts.sum())[:, None]
    means = tables.mean(axis=(0, 1)), wholes.mean(axis=0)
    scales = _scale(tables.std(axis=(0, 1))), _scale(wholes.std(axis=0))
    tables, wholes = (tables - means[0]) / scales[0], (wholes - means[1]) / scales[1]
    shapes = tables.shape[2:], (2, wholes.shape[1]), (2,)
    edges = np.cumsum([int(np.prod(shape)) for shape in shapes])
    held = np.repeat((_HELD, _HELD, 0.0), np.diff([0, *edges]))

    def weights_of(flat: Floats) -> Softmax:
        parts = [part.reshape(shape) for part, shape in zip(np.split(flat, edges[:-1]), shapes, strict=True)]
        return Softmax(means[0], scales[0], means[1], scales[1], *parts)

    def loss(flat: Floats) -> tuple[float, Floats]:
        scores = _scores(weights_of(flat), tables, wholes)
        logarithms = scores - np.asarray(logsumexp(scores, axis=1, keepdims=True))
        wrong = (np.exp(logarithms) - targets) * shares
        shared = np.einsum("ne,nek->k", wrong[:, :-2], tables)
        slope = np.concatenate([shared, (wrong[:, -2:].T @ wholes).ravel(), wrong[:, -2:].sum(axis=0)])
        value = -float((shares * targets * logarithms).sum()) + 0.5 * float(held @ flat**2)
        return value, slope + held * flat

    result = minimize(loss, np.zeros(edges[-1]), jac=True, method="L-BFGS-B", options={"maxiter": 500})
    return weights_of(result.x)


def _scale(spread: Floats) -> Floats:
    """A column that is the same for all rigs has the scale 1, as it separates nothing."""
    return np.where(spread > _LEAST_SPREAD, spread, 1.0)
