"""Two functions on arrays that numpy has in a form that is slow for what a log needs."""

from typing import Any

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int64]


def steps(values: Integers, before: int) -> Integers:
    """Differences of values, the first from `before`; `numpy.diff` with `prepend` takes far longer for a short piece."""
    found = np.empty(len(values), np.int64)
    found[:1] = values[:1] - before
    np.subtract(values[1:], values[:-1], out=found[1:])
    return found


def median(values: npt.NDArray[Any]) -> float:
    """As `numpy.median` of at least one finite number; the first call of that imports the masked arrays, which takes 30 ms."""
    low, high = (len(values) - 1) // 2, len(values) // 2
    middle = np.partition(values, (low, high))
    return (float(middle[low]) + float(middle[high])) / 2.0
