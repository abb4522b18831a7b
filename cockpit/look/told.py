"""What is left out of a record because it has no value, or its times do not go on, with a finding for each kind."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.one_clock import with_own_rows
from bridge.tables.table import Table
from bridge.units import counted

Floats = npt.NDArray[np.float64]
_GAP_STEPS = 10.0  # usual steps, as where the record is cut
_MOST_BACK = 0.1  # share of rows that are not later than those before, from which the column is no time of the rows


def of_values(table: Table, columns: Mapping[str, Floats], findings: Sequence[Finding]) -> list[Finding]:
    """Rows that are left out because a column has no value there, where `findings` do not tell of as many.

    A cell of a workbook in which a formula ended in an error, such as #DIV/0!, comes as an empty one.

    Args:
        table: the file.
        columns: as they were read, [rows] each, by the names that find them in the table.
        findings: what is told already.

    """
    file = table.path.name
    found: list[Finding] = []
    for name, values in columns.items():
        where = {f"{file}: column {column}" for column in (name, table.find(name))}
        known = sum(one.times for one in findings if one.kind in ("not-finite", "outlier") and one.where in where)
        empty = np.flatnonzero(~np.isfinite(values))
        # rows of its own are told as a clock of its own
        if len(empty) > known and not with_own_rows(np.arange(float(len(values))), {name: values}):
            text = (
                f"{counted(len(empty), 'row')} of {len(values)} without a number (an empty cell, or one with an error)"
            )
            text += f", first row {empty[0] + 1}; left out"
            found.append(Finding("not-finite", f"{file}: column {name}", text, len(empty)))
    return found


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
