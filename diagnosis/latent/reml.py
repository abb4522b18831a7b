"""Variances and lengths of the processes by restricted maximum likelihood (REML), with the mean as the fixed effect.

Patterson and Thompson 1971. The covariances are dense, so no package of mixed models fits: those want groups or sparse factors.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from bridge.arrays import Indices
from diagnosis.latent.components import ComponentModel
from diagnosis.latent.rows import Floats

_LEAST, _MOST = 1e-5, 30.0  # of a variance, in those of the rows
_STEP = 0.05  # of the logarithm of a length, for its derivative
_ROUNDS = 60  # of the search; it ends after 15 to 40


class Fitted(NamedTuple):
    """The model at its most likely numbers. Variances are in squares of the rows' standard deviation."""

    model: ComponentModel
    scale_N: float  # standard deviation of the fitted rows
    variances: Floats  # [components]
    lengths: dict[str, float]  # logarithms
    likelihood: float  # natural logarithm, restricted


def covariances(model: ComponentModel, lengths: dict[str, float]) -> list[Floats]:
    """The covariance of every component, [rows, rows] each."""
    return [component.covariance(lengths) for component in model.components]


def factored(kernels: list[Floats], variances: Floats) -> tuple[Floats, bool]:
    """Cholesky factor of the covariance of the rows, for `cho_solve`."""
    whole = np.tensordot(variances, np.array(kernels), axes=1)
    whole[np.diag_indices_from(whole)] += 1e-9 * max(float(variances.sum()), 1e-12)
    return cho_factor(whole, lower=True, check_finite=False)


def solved(kernels: list[Floats], variances: Floats, y: Floats) -> tuple[tuple[Floats, bool], Floats]:
    """The factor, and the inverse of the covariance on `y` and on ones, [rows, 2]."""
    factor = factored(kernels, variances)
    return factor, cho_solve(factor, np.stack([y, np.ones(len(y))], axis=1), check_finite=False)


def restricted(kernels: list[Floats], variances: Floats, y: Floats) -> tuple[float, Floats]:
    """The restricted log likelihood of `y` [rows], and its derivatives by the logarithms of the variances."""
    factor = factored(kernels, variances)
    inverse = cho_solve(factor, np.eye(len(y)), check_finite=False)
    ones = inverse.sum(axis=0)
    total = float(ones.sum())
    projected = inverse - np.outer(ones, ones) / total
    left = projected @ y
    likelihood = -float(np.log(np.diag(factor[0])).sum()) - 0.5 * math.log(total) - 0.5 * float(y @ left)
    slopes = [
        -0.5 * size * (float(np.vdot(projected, kernel)) - float(left @ kernel @ left))
        for size, kernel in zip(variances, kernels, strict=True)
    ]
    return likelihood, np.array(slopes)


def fitted(
    model: ComponentModel, excess_N: Floats, rows: Indices, without: str = "", start: "Fitted | None" = None
) -> Fitted:
    """The most likely variances and lengths.

    Args:
        model: the processes over all rows.
        excess_N: what is split, [rows].
        rows: the rows to fit, indices.
        without: a process whose variance is nothing.
        start: numbers to begin from.

    """
    scale_N = max(float(excess_N[rows].std()), 1e-12)
    y = (excess_N[rows] - excess_N[rows].mean()) / scale_N
    free = [i for i, component in enumerate(model.components) if component.what != without]
    names = [length.name for length in model.lengths]
    used = {name for i in free for name in model.components[i].lengths}
    count = len(free)

    def kernels_at(lengths: dict[str, float]) -> list[Floats]:
        return [model.components[i].covariance(lengths)[rows[:, None], rows] for i in free]

    def unlikely(x: Floats) -> tuple[float, Floats]:
        lengths = dict(zip(names, x[count:].tolist(), strict=True))
        kernels = kernels_at(lengths)
        variances = np.exp(x[:count])
        value, slopes = restricted(kernels, variances, y)
        of_lengths = []
        for name in names:
            if name not in used:
                of_lengths.append(0.0)
                continue
            longer = lengths | {name: lengths[name] + _STEP}
            of_lengths.append((restricted_value(kernels_at(longer), variances, y) - value) / _STEP)
        return -value, -np.concatenate([slopes, of_lengths])

    if start is None:
        first = np.concatenate([np.full(count, math.log(1.0 / count)), [length.start for length in model.lengths]])
    else:
        first = np.concatenate([np.log(start.variances[free]), [start.lengths[name] for name in names]])
    bounds = [(math.log(_LEAST), math.log(_MOST))] * count + [(length.low, length.high) for length in model.lengths]
    first = np.clip(first, [low for low, _ in bounds], [high for _, high in bounds])
    optimum = minimize(unlikely, first, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _ROUNDS})
    variances = np.full(len(model.components), _LEAST)
    variances[free] = np.exp(optimum.x[:count])
    if without:
        variances[[i for i in range(len(variances)) if i not in free]] = 0.0
    return Fitted(
        model, scale_N, variances, dict(zip(names, optimum.x[count:].tolist(), strict=True)), -float(optimum.fun)
    )


def restricted_value(kernels: list[Floats], variances: Floats, y: Floats) -> float:
    """The restricted log likelihood alone."""
    factor, both = solved(kernels, variances, y)
    total = float(both[:, 1].sum())
    square = float(y @ both[:, 0]) - float(both[:, 0].sum()) ** 2 / total
    return -float(np.log(np.diag(factor[0])).sum()) - 0.5 * math.log(total) - 0.5 * square
