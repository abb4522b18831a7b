"""Shares of what differs between the held-out rows, by process, with intervals and with what chance would show.

The share of a process is the part of the sum of squares that its most likely course takes: u (y - mean) over (y - mean)^2, so the
shares of all processes add up to 1. Intervals are of draws of the numbers of the model (importance sampling around the REML
estimate, flat in the standard deviations) and of the courses (Matheron's rule).
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from bridge.arrays import Indices
from diagnosis.latent.components import NOISE, SCATTER
from diagnosis.latent.reml import Fitted, covariances, factored, fitted, restricted_value, solved
from diagnosis.latent.rows import ExcessRows, Floats

_PROPOSED, _DRAWS = 120, 80  # variances and lengths proposed for the interval, and courses drawn
_WIDEST = 1.5  # standard deviation of a proposal, in the logarithm of a variance or a length
_NULL_DRAWS = 300  # records without the process
_LEVELS = (0.05, 0.95)  # ends of a 90 % interval
_LEAST_SHARE = 0.03  # of the shares that get a null, which costs a fit


class LatentShare(NamedTuple):
    """The share of one process."""

    what: str
    share: float
    interval_90: tuple[float, float]
    null_90: float | None  # what the other processes alone would make of it in 9 of 10; None for scatter and noise
    gain: float  # log likelihood by which the rows are less likely without it; 0 where it was not asked

    @property
    def beyond_chance(self) -> bool:
        """Whether the whole interval lies above what chance shows."""
        return self.null_90 is not None and self.interval_90[0] > self.null_90


def shares_of(fitted_model: Fitted, rows: ExcessRows, fit: Indices, held: Indices) -> tuple[LatentShare, ...]:
    """The shares on the rows `held` of a model fitted to the rows `fit` (indices); the largest first, noise last."""
    y = (rows.excess_N - rows.excess_N[fit].mean()) / fitted_model.scale_N
    kernels = covariances(fitted_model.model, fitted_model.lengths)
    at_best = _split(kernels, fitted_model.variances, y, held)
    random = np.random.default_rng(1)
    draws = np.array([_drawn(*number, y, held, random) for number in _numbers(fitted_model, y, fit, random)])
    low, high = np.quantile(np.clip(draws, 0.0, 1.0), _LEVELS, axis=0)
    names = [component.what for component in fitted_model.model.components]
    noise = min((rows.noise_N / fitted_model.scale_N) ** 2 / max(float(y[held].var()), 1e-12), 1.0)
    result: list[LatentShare] = []
    for number, what in enumerate(names):
        share, between = float(at_best[number]), (float(low[number]), float(high[number]))
        if what == SCATTER:
            noise = min(noise, max(share, 0.0))
            result.append(LatentShare(NOISE, noise, (noise, noise), None, 0.0))
            between = (max(between[0] - noise, 0.0), max(between[1] - noise, 0.0))
            result.append(LatentShare(SCATTER, share - noise, between, None, 0.0))
        elif share > _LEAST_SHARE:
            null, gain = _null(fitted_model, kernels, rows, fit, held, number)
            result.append(LatentShare(what, share, between, null, gain))
        else:
            result.append(LatentShare(what, share, between, None, 0.0))
    return tuple(sorted(result, key=lambda share: (share.what == NOISE, share.what == SCATTER, -share.share)))


def _split(kernels: list[Floats], variances: Floats, y: Floats, held: Indices) -> Floats:
    """Share of every component of the sum of squares of the rows `held` about their mean, [components]."""
    weights = _weights(kernels, variances, y)
    about = y[held] - y[held].mean()
    courses = [size * (kernel @ weights)[held] for size, kernel in zip(variances, kernels, strict=True)]
    return np.array([float(about @ (cours - cours.mean())) for cours in courses]) / max(float(about @ about), 1e-30)


def _weights(kernels: list[Floats], variances: Floats, y: Floats) -> Floats:
    """The inverse of the covariance on what the mean leaves of `y`."""
    _, both = solved(kernels, variances, y)
    return both[:, 0] - both[:, 1] * float(both[:, 0].sum()) / float(both[:, 1].sum())


def _numbers(
    fitted_model: Fitted, y: Floats, fit: Indices, random: np.random.Generator
) -> list[tuple[Floats, list[Floats]]]:
    """Draws of the variances, and the covariances at the drawn lengths."""
    bounds = {length.name: length for length in fitted_model.model.lengths}
    every = covariances(fitted_model.model, fitted_model.lengths)
    kernels = [kernel[fit[:, None], fit] for kernel in every]
    root = np.linalg.cholesky(_spread(kernels, fitted_model.variances))
    count = len(fitted_model.variances)
    drawn: list[tuple[Floats, list[Floats]]] = []
    chances: list[float] = []
    for _ in range(_PROPOSED):
        normal = random.standard_normal(count)
        variances = fitted_model.variances * np.exp(root @ normal)
        lengths = {
            name: min(max(at + 0.4 * random.standard_normal(), bounds[name].low), bounds[name].high)
            for name, at in fitted_model.lengths.items()
        }
        all_rows = [
            component.covariance(lengths) if component.lengths else known
            for component, known in zip(fitted_model.model.components, every, strict=True)
        ]
        value = restricted_value([kernel[fit[:, None], fit] for kernel in all_rows], variances, y[fit])
        # flat in the standard deviations, against the density that the draw came from
        chances.append(value + 0.5 * float(np.log(variances).sum()) + 0.5 * float(normal @ normal))
        drawn.append((variances, all_rows))
    weight = np.exp(np.array(chances) - max(chances))
    chosen = random.choice(len(drawn), _DRAWS, p=weight / weight.sum())
    return [drawn[int(i)] for i in chosen]


def _spread(kernels: list[Floats], variances: Floats) -> Floats:
    """Covariance of the logarithms of the variances, from the expected information, no wider than `_WIDEST`."""
    inverse = cho_solve(factored(kernels, variances), np.eye(len(kernels[0])), check_finite=False)
    moved = [size * (inverse @ kernel) for size, kernel in zip(variances, kernels, strict=True)]
    information = 0.5 * np.array([[float(np.vdot(a.T, b)) for b in moved] for a in moved])
    return np.linalg.inv(information + np.eye(len(variances)) / _WIDEST**2)


def _drawn(variances: Floats, kernels: list[Floats], y: Floats, held: Indices, random: np.random.Generator) -> Floats:
    """Shares of one draw of the courses."""
    prior = [math.sqrt(size) * _sample(kernel, random) for size, kernel in zip(variances, kernels, strict=True)]
    weights = _weights(kernels, variances, y - np.sum(prior, axis=0))
    about = y[held] - y[held].mean()
    shares = []
    for size, kernel, mean in zip(variances, kernels, prior, strict=True):
        course = (mean + size * (kernel @ weights))[held]
        shares.append(float(about @ (course - course.mean())))
    return np.array(shares) / max(float(about @ about), 1e-30)


def _sample(kernel: Floats, random: np.random.Generator) -> Floats:
    """A draw of a process with this covariance."""
    size = kernel + 1e-8 * np.eye(len(kernel))
    return np.linalg.cholesky(size) @ random.standard_normal(len(kernel))


def _null(
    fitted_model: Fitted, kernels: list[Floats], rows: ExcessRows, fit: Indices, held: Indices, number: int
) -> tuple[float, float]:
    """The share of a process in 9 of 10 records that lack it, and the log likelihood that the rows lose without it."""
    without = fitted(
        fitted_model.model, rows.excess_N, fit, without=fitted_model.model.components[number].what, start=fitted_model
    )
    others = covariances(fitted_model.model, without.lengths)
    whole = np.tensordot(without.variances, np.array(others), axes=1) + 1e-9 * np.eye(len(rows.excess_N))
    random = np.random.default_rng(2)
    records = np.linalg.cholesky(whole) @ random.standard_normal((len(whole), _NULL_DRAWS))
    both = np.tensordot(fitted_model.variances, np.array(kernels), axes=1) + 1e-9 * np.eye(len(whole))
    factor = cho_factor(both, lower=True, check_finite=False)
    ones = cho_solve(factor, np.ones(len(whole)), check_finite=False)
    weights = cho_solve(factor, records, check_finite=False)
    weights -= np.outer(ones, weights.sum(axis=0)) / float(ones.sum())
    course = (fitted_model.variances[number] * (kernels[number] @ weights))[held]
    about = records[held] - records[held].mean(axis=0)
    share = (about * (course - course.mean(axis=0))).sum(axis=0) / (about * about).sum(axis=0)
    return float(np.quantile(share, 0.9)), fitted_model.likelihood - without.likelihood
