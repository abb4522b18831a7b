"""Findings about omitted rows: rows without a value, and rows whose time does not increase."""

from collections.abc import Mapping, Sequence

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.one_clock import gaps_of, with_own_rows
from bridge.tables.table import Table
from bridge.units import counted

_MOST_BACK = 0.1  # share of rows with a time not after the row before, above which the column is not a time


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
