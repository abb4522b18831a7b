"""Values of a column that are no measurement: what a program writes where it has none."""

import re

import numpy as np
import numpy.typing as npt

from bridge.log.finding import Finding
from bridge.units import counted

Floats = npt.NDArray[np.float64]
# Spreads (from the 5th to the 95th percentile) from the median, from which a value is none; -9999 and its like, and one that
# comes again and again, as full scale does. A slip moves a force or a position by a few.
_FAR, _FAR_ALIKE = 1000.0, 20.0
_LARGEST = 1e20  # 1e30 and the largest of float32 stand for none
_NINES = re.compile(r"0*9{3,}0*")
# that show no spikes. An acceleration has them, and at rest its spread is that of its noise
SMOOTH = ("drive_force_N", "mass_position_m", "drive_position_m", "normal_load_N", "other_force_N")


def without_sentinels(values: Floats, where: str, smooth: bool) -> tuple[Floats, list[Finding]]:
    """A column with NaN for what is no measurement, [rows].

    Args:
        values: as they are in the file.
        where: file and column, for the finding.
        smooth: the column shows no spikes.

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
        found, times = np.unique(values[~bad & far], return_counts=True)
        for value, again in zip(found.tolist(), (times > 1).tolist(), strict=True):
            if (smooth and again) or _NINES.fullmatch(f"{abs(value):.6f}".replace(".", "")):
                bad |= far & (values == value)
    rows = np.flatnonzero(bad)
    if not len(rows):
        return values, []
    text = f"{counted(len(rows), 'outlier')}, first row {rows[0] + 1} = {values[rows[0]]:.6g}: no measurement; left out"
    return np.where(bad, np.nan, values), [Finding("outlier", where, text, len(rows))]


def _leaps(values: Floats, far: npt.NDArray[np.bool_], least: float) -> npt.NDArray[np.bool_]:
    """Of the stretches that are far away those of one number that is leapt to and from, as no motion is.

    A slide that rests for long and then moves goes far, too.
    """
    edges = np.diff(np.concatenate(([0], far.astype(np.int8), [0])))
    leaps = np.concatenate(([True], ~(np.abs(np.diff(values)) <= least), [True]))
    kept = np.zeros(len(values), np.bool_)
    for begin, end in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        kept[begin:end] = leaps[begin] and leaps[end] and (values[begin:end] == values[begin]).all()
    return kept
