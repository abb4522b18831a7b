"""What is left out of a record, with a finding for each kind: values that are no measurement, and times that do not go on."""

import re

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.units import counted

Floats = npt.NDArray[np.float64]
_FAR, _FAR_OF_NINES = 1000.0, 20.0  # spreads from the median from which a value is no measurement; -9999 and its like
_LARGEST = 1e100  # whose square is finite
_NINES = re.compile(r"0*9{3,}0*")
_GAP_STEPS = 10.0  # usual steps, as where the record is cut
_MOST_BACK = 0.1  # share of rows that are not later than those before, from which the column is no time of the rows


def without_outliers(values: Floats, where: str) -> tuple[Floats, list[Finding]]:
    """A channel with NaN for what is no measurement, [samples]."""
    small = np.where(np.abs(values) < _LARGEST, values, np.nan)
    if not np.isfinite(small).any():
        return small, []
    low, middle, high = np.nanquantile(small, (0.05, 0.5, 0.95))
    spread = float(high - low)
    away = np.abs(small - middle)
    bad = np.isfinite(values) & ~np.isfinite(small)
    if spread > 0.0:
        bad |= away > _FAR * spread
        for value in np.unique(values[~bad & (away > _FAR_OF_NINES * spread)]).tolist():
            if _NINES.fullmatch(f"{abs(value):.6f}".replace(".", "")):
                bad |= values == value
    rows = np.flatnonzero(bad)
    if not len(rows):
        return values, []
    text = f"{counted(len(rows), 'outlier')}, first row {rows[0] + 1} = {values[rows[0]]:.6g}: no measurement; left out"
    return np.where(bad, np.nan, values), [Finding("outlier", where, text, len(rows))]


def of_time(t_s: Floats, where: str) -> list[Finding]:
    """Rows that are left out because their time is not later, and gaps. Raises Fault BAD_TABLE where it is many rows."""
    known = t_s[np.isfinite(t_s)]
    if len(known) < 2:
        return []
    found: list[Finding] = []
    highest = np.maximum.accumulate(known)
    late = np.flatnonzero(known[1:] <= highest[:-1]) + 1
    if len(late):
        equal = int((known[late] == highest[late - 1]).sum())
        text = f"{counted(len(late), 'row')} not later than the rows before ({equal} of the same time), first row {late[0] + 1}"
        if len(late) > _MOST_BACK * len(known):
            raise Fault(
                "BAD_TABLE",
                f"{where}: {text}: must be few; give --time of another column, or --rate, or one table a file",
            )
        found.append(Finding("time", where, f"{text}; left out", len(late)))
    steps = np.diff(np.unique(known))
    gaps = np.flatnonzero(steps > _GAP_STEPS * float(np.median(steps))) if len(steps) else np.zeros(0, np.int64)
    if len(gaps):
        first = float(np.unique(known)[gaps[0]])
        text = f"{counted(len(gaps), 'gap')} in time, first at {first:.6g} s, the longest {steps.max():.3g} s"
        found.append(Finding("time-gap", where, f"{text}: cut there", len(gaps)))
    return found
