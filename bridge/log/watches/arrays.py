"""Array functions that are missing or slow in numpy."""

from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.arrays import Indices


def steps(values: npt.NDArray[np.integer[Any]], before: int) -> Indices:
    """Differences of values, the first from `before`; `numpy.diff` with `prepend` takes far longer for a short piece."""
    differences = np.empty(len(values), np.int64)
    differences[:1] = values[:1] - before
    np.subtract(values[1:], values[:-1], out=differences[1:])
    return differences


def median(values: npt.NDArray[Any]) -> float:
    """Like `numpy.median` for at least one finite number; numpy's first call imports the masked arrays, which takes 30 ms."""
    return float(_medians(values))


def _medians(values: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Medians along the last axis."""
    low, high = (values.shape[-1] - 1) // 2, values.shape[-1] // 2
    middle = np.partition(values, (low, high))
    return np.asarray((middle[..., low].astype(np.float64) + middle[..., high]) / 2.0)


def noise_of(values: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.float64]:
    """Standard deviation of the white noise on a mostly smooth signal, along the last axis, from second differences."""
    if values.shape[-1] < 3:
        return np.zeros(values.shape[:-1])
    return 1.4826 * _medians(np.abs(np.diff(values, 2))) / 6.0**0.5


class Longest:
    """The longest run of true values in pieces of an array."""

    def __init__(self) -> None:
        self.longest = self._open = 0

    def add(self, true: npt.NDArray[np.bool_]) -> None:
        """Take the next piece, [rows]."""
        edges = np.flatnonzero(np.diff(true.view(np.int8), prepend=np.int8(0), append=np.int8(0))).reshape(-1, 2)
        runs = edges[:, 1] - edges[:, 0]
        if len(runs) and true[0]:
            runs[0] += self._open
        self.longest = max(self.longest, int(runs.max(initial=0)))
        if len(true):
            self._open = int(runs[-1]) if true[-1] else 0
