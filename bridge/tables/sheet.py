"""A sheet of a workbook (xlsx, xls, ods) as a table."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.table import Table
from bridge.tables.text.dialect import Dialect, Form
from bridge.tables.text.head import read_head
from bridge.tables.unit_words import unknown_units

_HEAD_ROWS = 400  # in which the rows of numbers must begin


def read_sheet(path: Path, given: Dialect) -> Table:
    """The sheet that `given` names, or the one with most rows. Raises Fault BAD_TABLE."""
    from python_calamine import load_workbook

    book: Any = load_workbook(str(path))
    names: list[str] = list(book.sheet_names)
    if given.sheet is not None and given.sheet not in names:
        raise Fault("BAD_TABLE", f"source.sheet = {given.sheet!r}: not in {path.name}; known here: {', '.join(names)}")
    read = {name: book.get_sheet_by_name(name).to_python() for name in ([given.sheet] if given.sheet else names)}
    name = max(read, key=lambda one: len(read[one]))
    rows: list[list[Any]] = read[name]
    if not rows:
        raise Fault("BAD_TABLE", f"{path.name}: is empty; give a file with rows")
    form = Form("\x1f", "", ".", "")  # no cell has a unit separator in it
    lines = [form.delimiter.join(_text(cell) for cell in row) for row in rows[:_HEAD_ROWS]]
    body = [
        form.delimiter.join(_text(cell) for cell in row) for row in rows[len(rows) // 3 :: max(len(rows) // 200, 1)]
    ]
    head = read_head(lines, body, form, given, path.name)
    width = len(head.names)
    columns: dict[str, Any] = {}
    for i, column in enumerate(head.names):
        cells = [row[i] if i < len(row) else "" for row in rows[head.lines :]]
        columns[column] = _column(cells)
    findings = [Finding("assumed", path.name, f"sheet {name!r} of {', '.join(names)}")] if len(names) > 1 else []
    if head.units:
        findings.append(
            Finding("assumed", path.name, f"line {head.lines} is of units: {', '.join(filter(None, head.units))}")
        )
        if unknown := unknown_units(head.unit_of):
            findings.append(Finding("units", path.name, f"no known unit: {unknown}; taken as it is"))
    rate_Hz = 1.0 / head.step_s if head.step_s else None
    return Table(path, columns, head.unit_of, {}, rate_Hz, findings=findings, written={"sheet": name, "columns": width})


def _column(cells: list[Any]) -> Any:
    """Numbers as float64, an empty cell NaN; anything else as it is."""
    kinds = Counter(type(cell) for cell in cells if cell != "")
    if kinds.keys() <= {float, int, bool}:
        return np.array([np.nan if cell == "" else float(cell) for cell in cells])
    return np.array([None if cell == "" else cell for cell in cells], object)


def _text(cell: Any) -> str:
    return cell.isoformat() if hasattr(cell, "isoformat") else str(cell)
