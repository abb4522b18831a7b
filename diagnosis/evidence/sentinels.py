"""Sentinels in a column: values that a program writes in place of a missing measurement."""

import re

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from bridge.log.finding import Finding
from bridge.units import counted

# Distance from the median, in spreads (5th to 95th percentile), from which a value is a sentinel: any value; a number of nines
# such as -9999, or a repeated value such as full scale. A slip moves a force or a position by a few spreads.
_FAR, _FAR_ALIKE = 1000.0, 20.0
_LARGEST = 1e20  # 1e30 and the largest float32 mean "no value"
_NINES = re.compile(r"0*9{3,}0*")


def without_sentinels(values: Floats, where: str, smooth: bool) -> tuple[Floats, list[Finding]]:
    """A column with NaN in place of sentinels, [rows].

    Args:
        values: the column of the file, [rows].
        where: file and column, for the finding.
        smooth: whether the measured quantity has no spikes.

    """
    small = np.where(np.abs(values) < _LARGEST, values, np.nan)
    if not np.isfinite(small).any():
        return small, []
    low, middle, high = np.nanquantile(small, (0.05, 0.5, 0.95))
    spread = float(high - low)
    away = np.abs(small - middle)
    bad = np.isfinite(values) & ~np.isfinite(small)
    if spread > 0.0 and float(np.nanmax(away)) > _FAR_ALIKE * spread:
        far = _leaps(small, away > _FAR_ALIKE * spread, 0.5 * _FAR_ALIKE * spread)
        if smooth:
            bad |= far & (away > _FAR * spread)
        numbers, times = np.unique(values[~bad & far], return_counts=True)
        for value, again in zip(numbers.tolist(), (times > 1).tolist(), strict=True):
            if (smooth and again) or _NINES.fullmatch(f"{abs(value):.6f}".replace(".", "")):
                bad |= far & (values == value)
    rows = np.flatnonzero(bad)
    if not len(rows):
        return values, []
    text = f"{counted(len(rows), 'outlier')}, first row {rows[0] + 1} = {values[rows[0]]:.6g}: no measurement; left out"
    return np.where(bad, np.nan, values), [Finding("outlier", where, text, len(rows))]


def _leaps(values: Floats, far: npt.NDArray[np.bool_], least: float) -> npt.NDArray[np.bool_]:
    """Marks stretches of one constant far value that begin and end with a jump, [rows], which no motion does.

    A far value alone is not enough: a slide that rests for long and then moves goes far, too.
    """
    edges = np.diff(np.concatenate(([0], far.astype(np.int8), [0])))
    leaps = np.concatenate(([True], ~(np.abs(np.diff(values)) <= least), [True]))
    kept = np.zeros(len(values), np.bool_)
    for begin, end in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        kept[begin:end] = leaps[begin] and leaps[end] and (values[begin:end] == values[begin]).all()
    return kept
