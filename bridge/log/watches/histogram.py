"""A distribution in constant memory: counts in bins of equal ratio."""

from typing import Any

import numpy as np
import numpy.typing as npt

# Ratio of two edges. A quantile is off by at most half of it, 0.25 %, below the scatter of repeated runs. Smaller: more memory
# (now 5500 bins of 8 bytes). Larger: visibly stepped percentiles.
_RATIO = 1.005
_LOWEST, _HIGHEST = 1e-3, 1e9  # range of the bins; values outside count in the first or last bin
_BINS_PER_BAR = 23  # bins in a bar of a diagram: 20 bars a decade
_BINS = int(np.ceil(np.log(_HIGHEST / _LOWEST) / np.log(_RATIO)))


class Histogram:
    """Counts of positive values, in any unit."""

    def __init__(self) -> None:
        self.count = 0
        self.most = 0.0  # the largest value, exact
        self._bins = np.zeros(_BINS, np.int64)

    def add(self, values: npt.NDArray[Any]) -> None:
        """Count values, [values]."""
        if not len(values):
            return
        at = np.log(np.maximum(values, _LOWEST) / _LOWEST) / np.log(_RATIO)
        self._bins += np.bincount(np.minimum(at.astype(np.int64), _BINS - 1), minlength=_BINS)
        self.count += len(values)
        self.most = max(self.most, float(values.max()))

    def bars(self, unit: str) -> dict[str, list[float]] | None:
        """Edges as `edges_` with the unit of the values, and `counts` of 20 bars a decade; None without values."""
        bars = np.add.reduceat(self._bins, np.arange(0, _BINS, _BINS_PER_BAR))
        filled = np.flatnonzero(bars)
        if not len(filled):
            return None
        first, end = int(filled[0]), int(filled[-1]) + 1
        edges = _LOWEST * _RATIO ** (_BINS_PER_BAR * np.arange(first, end + 1))
        return {f"edges_{unit}": np.round(edges, 3).tolist(), "counts": bars[first:end].tolist()}

    def quantile(self, share: float) -> float:
        """The value below which this share of the values is, to 0.25 %; 0 without values."""
        if not self.count:
            return 0.0
        at = int(np.searchsorted(np.cumsum(self._bins), share * self.count))
        return min(float(_LOWEST * _RATIO ** (min(at, _BINS - 1) + 0.5)), self.most)
