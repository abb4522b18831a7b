"""Scores with the interval that holds the true value with 95 % probability."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

T = TypeVar("T")
_Z_95 = 1.96  # sigmas that hold 95 % of a normal distribution
_RESAMPLES = 1000
_SEED = 1


class Score(NamedTuple):
    """A score of `n` cases, with its 95 % interval from `low` to `high`."""

    value: float
    low: float
    high: float
    n: int


def rate(hits: Sequence[bool]) -> Score | None:
    """The share of hits, with Wilson's interval; None without cases."""
    n = len(hits)
    if n == 0:
        return None
    p = sum(hits) / n
    middle = p + _Z_95**2 / (2 * n)
    half = _Z_95 * math.sqrt(p * (1 - p) / n + (_Z_95 / (2 * n)) ** 2)
    low, high = ((middle + sign * half) / (1 + _Z_95**2 / n) for sign in (-1, 1))
    return Score(p, max(low, 0.0), min(high, 1.0), n)


def bootstrapped(cases: Sequence[T], statistic: Callable[[Sequence[T]], float]) -> Score | None:
    """A statistic of the cases, with the interval of its bootstrap; None without cases."""
    n = len(cases)
    if n == 0:
        return None
    random = np.random.default_rng(_SEED)
    drawn = [statistic([cases[i] for i in random.integers(n, size=n)]) for _ in range(_RESAMPLES)]
    low, high = np.quantile([value for value in drawn if math.isfinite(value)] or [math.nan], (0.025, 0.975))
    return Score(statistic(cases), float(low), float(high), n)


def mean(values: Sequence[float]) -> Score | None:
    """The mean, with the interval of its bootstrap; None without values."""
    return bootstrapped(values, lambda sample: sum(sample) / len(sample))


def ratio(pairs: Sequence[tuple[float, float]]) -> Score | None:
    """The sum of the first numbers over the sum of the second; NaN where the second sum is 0, None without pairs."""

    def of(sample: Sequence[tuple[float, float]]) -> float:
        below = sum(second for _, second in sample)
        return sum(first for first, _ in sample) / below if below else math.nan

    return bootstrapped(pairs, of)
