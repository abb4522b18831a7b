"""Least, mean and largest value of each bin of an even time axis: a slip of some milliseconds shows at every zoom."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


class Grid(NamedTuple):
    """Bins whose middles are at `start_s`, `start_s + step_s`, ..."""

    start_s: float
    step_s: float
    bins: int

    @property
    def t_s(self) -> Floats:
        """The middles, [bins]."""
        return np.arange(self.bins, dtype=np.float64) * self.step_s + self.start_s


class Envelope(NamedTuple):
    """Values in bins, each [bins]; nan in a bin without a value."""

    least: Floats
    mean: Floats
    most: Floats


def on_grid(t_s: Floats, values: Floats, grid: Grid) -> Envelope:
    """The values at their times, both [samples] in any order, put into bins; what is no number or beyond them is left out."""
    bins = np.rint((t_s - grid.start_s) / grid.step_s)
    kept = np.isfinite(values) & (bins >= 0) & (bins < grid.bins)
    at, values = bins[kept].astype(np.int64), values[kept]
    if (np.diff(at) < 0).any():  # a clock that jumped back
        order = np.argsort(at, kind="stable")
        at, values = at[order], values[order]
    starts = np.flatnonzero(np.diff(at, prepend=-1))
    made = Envelope(*(np.full(grid.bins, np.nan) for _ in range(3)))
    if len(starts):
        filled = at[starts]
        made.least[filled] = np.minimum.reduceat(values, starts)
        made.most[filled] = np.maximum.reduceat(values, starts)
        made.mean[filled] = np.add.reduceat(values, starts) / np.diff(starts, append=len(values))
    return made
