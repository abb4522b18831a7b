"""Numbers with an interval that holds the true value with 90 % probability."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import stdtrit

from bridge.arrays import Floats
from bridge.results import in_json

_GROUPS = 10  # groups of slips for the jackknife
_RANKS = 1.645 / 2.0  # ranks from the median to the ends of its interval, over the root of the number of values


class Number(NamedTuple):
    """A number, its interval and its unit; the interval is NaN where it comes from a single value."""

    value: float
    low: float
    high: float
    unit: str
    JSON_HIDDEN = "low", "high"

    @in_json
    def interval_90(self) -> tuple[float, float]:
        """Both ends of the interval."""
        return self.low, self.high

    def times(self, factor: float, unit: str) -> "Number":
        """The number times an exactly known factor, in the unit of the product."""
        ends = sorted((self.low * factor, self.high * factor)) if math.isfinite(self.low) else [self.low, self.high]
        return Number(self.value * factor, ends[0], ends[1], unit)

    def wider(self, more: float) -> "Number":
        """The number with an independent error of `more` added to both sides of its interval."""
        low, high = (math.hypot(end - self.value, more) for end in (self.low, self.high))
        return self._replace(low=self.value - low, high=self.value + high)


def quantile_t(free: int) -> float:
    """Student's t for a two-sided interval of 90 %, for `free` degrees of freedom."""
    return float(stdtrit(free, 0.95)) if free > 0 else math.inf


def mean_of(values: Floats | Sequence[float], unit: str, resolution: float = 0.0) -> Number | None:
    """The mean of independent values [n]; `resolution` is the standard deviation of their common error."""
    finite = np.asarray(values, np.float64)
    finite = finite[np.isfinite(finite)]
    if not len(finite):
        return None
    mean = float(finite.mean())
    if len(finite) < 2:
        return Number(mean, math.nan, math.nan, unit)
    error = math.hypot(
        quantile_t(len(finite) - 1) * float(finite.std(ddof=1)) / math.sqrt(len(finite)), 1.645 * resolution
    )
    return Number(mean, mean - error, mean + error, unit)


def median_of(values: Floats, unit: str) -> Number | None:
    """The median of values [n], between the order statistics that hold it with 90 %; for values of which a few are others."""
    if not len(values):
        return None
    n, ordered = len(values), np.sort(values)
    low, high = math.floor(0.5 * n - _RANKS * n**0.5), math.ceil(0.5 * n + _RANKS * n**0.5)
    ends = (math.nan, math.nan) if low < 0 else (float(ordered[low]), float(ordered[high - 1]))
    return Number(float(np.median(ordered)), *ends, unit)


def jackknifed(value: float, without: Sequence[float], unit: str) -> Number:
    """A number from all slips; its interval comes from the numbers `without` one group of slips each (jackknife)."""
    finite = np.asarray([partial for partial in without if math.isfinite(partial)])
    if len(finite) < 3:
        return Number(value, math.nan, math.nan, unit)
    n = len(finite)
    error = quantile_t(n - 1) * math.sqrt((n - 1) / n * float(((finite - finite.mean()) ** 2).sum()))
    return Number(value, value - error, value + error, unit)


def groups_of(count: int) -> list[npt.NDArray[np.int64]]:
    """Indices 0 to `count` - 1 in at most ten groups; with ten groups every tenth index is in the same group."""
    groups = min(_GROUPS, count)
    return [np.arange(first, count, groups) for first in range(groups)]


def slope_of(x: Floats, y: Floats, unit: str) -> Number | None:
    """The slope of y over x, [n] each; None with fewer than four points."""
    if len(x) < 4:
        return None
    centred = x - x.mean()
    power = float(centred @ centred)
    if power <= 0.0:
        return None
    slope = float(centred @ y) / power
    rest = y - y.mean() - slope * centred
    error = quantile_t(len(x) - 2) * math.sqrt(float(rest @ rest) / (len(x) - 2) / power)
    return Number(slope, slope - error, slope + error, unit)
