"""Functions of arrays that numpy lacks, or that are slow in numpy."""

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
    return float(_medians(values))


def _medians(values: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Along the last axis."""
    low, high = (values.shape[-1] - 1) // 2, values.shape[-1] // 2
    middle = np.partition(values, (low, high))
    return np.asarray((middle[..., low].astype(np.float64) + middle[..., high]) / 2.0)


def noise_of(values: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.float64]:
    """Standard deviation of the white noise on a signal that is mostly smooth, along the last axis; by second differences."""
    if values.shape[-1] < 3:
        return np.zeros(values.shape[:-1])
    return 1.4826 * _medians(np.abs(np.diff(values, 2))) / 6.0**0.5


class Longest:
    """The longest run of true values in pieces of an array."""

    def __init__(self) -> None:
        self.longest = self._now = 0

    def add(self, true: npt.NDArray[np.bool_]) -> None:
        """Take the next piece, [rows]."""
        edges = np.flatnonzero(np.diff(true.view(np.int8), prepend=np.int8(0), append=np.int8(0))).reshape(-1, 2)
        runs = edges[:, 1] - edges[:, 0]
        if len(runs) and true[0]:
            runs[0] += self._now
        self.longest = max(self.longest, int(runs.max(initial=0)))
        if len(true):
            self._now = int(runs[-1]) if true[-1] else 0
