"""Findings about omitted rows; zero of the force sensor, from a stretch at the beginning without motion."""

from collections.abc import Mapping, Sequence

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.log.watches.arrays import noise_of
from bridge.tables.one_clock import gaps_of, with_own_rows
from bridge.tables.table import Table
from bridge.units import counted

_MOST_BACK = 0.1  # share of rows with a time not after the row before, above which the column is not a time
_FIRST = 20  # first samples of a record: their median is the force at rest, from which a rise is searched
_FEWEST_STILL = 50  # fewest samples of the stretch of rest at the beginning that gives the sensor's zero
# Length of this stretch, as a share of the record: a shorter stretch belongs to a rise, a longer stretch is a record at rest.
_LEAST_SHARE, _MOST_SHARE = 0.005, 0.5
_STILL = 0.01  # share of the range of force or position; a smaller change counts as rest
_OF_NOISE = 6.0  # a change of the force by fewer standard deviations of its noise counts as rest
_LARGEST = 0.25  # largest zero as a share of the force afterwards; a larger force at rest is a load, not a zero


def of_values(table: Table, columns: Mapping[str, Floats], findings: Sequence[Finding]) -> list[Finding]:
    """Rows omitted because a column has no value, unless `findings` already count as many.

    A workbook cell with a formula error such as #DIV/0! is read as empty.

    Args:
        table: the file.
        columns: columns that were read, [rows] each, by their names in the table.
        findings: findings that are already reported.

    """
    file = table.path.name
    omitted: list[Finding] = []
    for name, values in columns.items():
        where = {f"{file}: column {column}" for column in (name, table.find(name))}
        known = sum(
            finding.times
            for finding in findings
            if finding.kind in ("not-finite", "outlier") and finding.where in where
        )
        empty = np.flatnonzero(~np.isfinite(values))
        # a column with a separate clock is reported elsewhere
        if len(empty) > known and not with_own_rows(np.arange(float(len(values))), {name: values}):
            text = (
                f"{counted(len(empty), 'row')} of {len(values)} without a number (an empty cell, or one with an error)"
            )
            text += f", first row {empty[0] + 1}; left out"
            omitted.append(Finding("not-finite", f"{file}: column {name}", text, len(empty)))
    return omitted


def of_time(t_s: Floats, where: str) -> list[Finding]:
    """Rows omitted because their time does not increase, and gaps. Raises Fault BAD_TABLE for too many rows."""
    known = t_s[np.isfinite(t_s)]
    if len(known) < 2:
        return []
    omitted: list[Finding] = []
    highest = np.maximum.accumulate(known)
    late = np.flatnonzero(known[1:] <= highest[:-1]) + 1
    if len(late):
        equal = int((known[late] == highest[late - 1]).sum())
        text = f"{counted(len(late), 'row')} not later than the rows before ({equal} of the same time), first row {late[0] + 1}"
        if len(late) > _MOST_BACK * len(known):
            raise Fault(
                "BAD_TABLE",
                f"{where}: {text}: must be few; give --time with another column, or --rate, or one table per file",
            )
        omitted.append(Finding("time", where, f"{text}; left out", len(late)))
    gaps, text = gaps_of(np.unique(known))
    if len(gaps):
        omitted.append(Finding("time-gap", where, f"{text}: cut there", len(gaps)))
    return omitted


def tare_of(force_N: Floats, position_m: Floats | None, where: str) -> tuple[float, list[Finding]]:
    """The zero of a force sensor, and a finding; 0 without a stretch of rest at the beginning.

    Args:
        force_N: [samples]; NaN: missing.
        position_m: position of the drive, [samples], if known.
        where: file and channel, for the finding.

    """
    known = np.flatnonzero(np.isfinite(force_N))
    values = force_N[known]
    if len(values) < 4 * _FEWEST_STILL:
        return 0.0, []
    reach = float(np.subtract(*np.quantile(values, (0.99, 0.01))))
    level = float(np.median(values[:_FIRST]))
    allowed = max(_STILL * reach, _OF_NOISE * noise_of(values[:_FEWEST_STILL]))
    leaves = np.flatnonzero(np.abs(values - level) > allowed)
    if not len(leaves) or not max(_FEWEST_STILL, _LEAST_SHARE * len(values)) < leaves[0] < _MOST_SHARE * len(values):
        return 0.0, []
    # the last tenth may belong to the rise
    still = slice(0, int(0.9 * leaves[0]))
    halves = values[still][: len(values[still]) // 2 * 2].reshape(2, -1).mean(axis=1)
    allowed = _OF_NOISE * noise_of(values[still]) / np.sqrt(leaves[0] / 2.0) + 1e-3 * reach
    if abs(float(halves[1] - halves[0])) > allowed:  # the force rises slowly
        return 0.0, []
    if position_m is not None and not _is_still(position_m[known], still):
        return 0.0, []
    zero_N = float(values[still].mean())
    text = f"{zero_N:.4g} in the first {still.stop} rows, in which the force is constant"
    if abs(zero_N) > _LARGEST * float(np.median(np.abs(values[leaves[0] :]))):
        return 0.0, [Finding("tare", where, f"{text}: too large for a sensor's zero, so it is not subtracted")]
    if zero_N == 0.0:
        return 0.0, []
    return zero_N, [
        Finding("tare", where, f"{text}, is taken as the sensor's zero and subtracted; with a map it is kept")
    ]


def _is_still(position_m: Floats, still: slice) -> bool:
    range_m = float(np.nanmax(position_m) - np.nanmin(position_m))
    part_m = position_m[still]
    return bool(np.nanmax(part_m) - np.nanmin(part_m) < _STILL * range_m)
