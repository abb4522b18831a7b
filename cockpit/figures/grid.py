"""Least, mean and largest value per bin of an even time axis, so that a slip of a few ms is visible at every zoom."""

from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.log.viewers.stretches import Envelope, envelope_of


class Grid(NamedTuple):
    """Bins centred at `start_s`, `start_s + step_s`, ..."""

    start_s: float
    step_s: float
    bins: int

    @property
    def t_s(self) -> Floats:
        """Centres of the bins, [bins]."""
        return np.arange(self.bins, dtype=np.float64) * self.step_s + self.start_s


def on_grid(t_s: Floats, values: Floats, grid: Grid) -> Envelope:
    """Sort values, [samples] in any order, into bins; omits values that are not finite or outside the grid."""
    bins = np.rint((t_s - grid.start_s) / grid.step_s)
    kept = np.isfinite(values) & (bins >= 0) & (bins < grid.bins)
    at, values = bins[kept].astype(np.int64), values[kept]
    if (np.diff(at) < 0).any():  # a clock that jumped back
        order = np.argsort(at, kind="stable")
        at, values = at[order], values[order]
    starts = np.flatnonzero(np.diff(at, prepend=-1))
    made = Envelope(*(np.full(grid.bins, np.nan) for _ in range(3)))
    if len(starts):
        for column, filled in zip(made, envelope_of(values, starts), strict=True):
            column[at[starts]] = filled
    return made
