"""A sheet of a workbook (xlsx, xls, ods) as a table."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.table import Table
from bridge.tables.text.dialect import Dialect, TextLayout, form_of
from bridge.tables.text.head import read_head

_BETWEEN = "\x1f"  # joins the cells of a line: an ASCII control character that no cell contains
_HEAD_ROWS = 400  # rows within which the numbers must begin
# Largest workbook after decompression, which 8 million cells reach; reading it takes 1.3 GB. Larger: a file of 1 MB may fill the
# memory. Smaller: long measurements are refused.
_MOST_BYTES = 256_000_000


def read_sheet(path: Path, given: Dialect) -> Table:
    """The sheet that `given` names, or the sheet with most rows. Raises Fault BAD_TABLE."""
    from python_calamine import load_workbook

    _refuse_large(path)
    book: Any = load_workbook(str(path))
    names: list[str] = list(book.sheet_names)
    if given.sheet is not None and given.sheet not in names:
        raise Fault("BAD_TABLE", f"source.sheet = {given.sheet!r}: not in {path.name}; known here: {', '.join(names)}")
    read = {name: book.get_sheet_by_name(name).to_python() for name in ([given.sheet] if given.sheet else names)}
    name = max(read, key=lambda sheet: len(read[sheet]))
    rows: list[list[Any]] = read[name]
    if not rows:
        raise Fault("BAD_TABLE", f"{path.name}: is empty; give a file with rows")
    sample = rows[len(rows) // 3 :: max(len(rows) // 200, 1)]
    texts = [_BETWEEN.join(cell if isinstance(cell, str) else "" for cell in row) for row in sample]
    # the form of numbers that are stored as text
    form = form_of(texts, given._replace(delimiter=_BETWEEN), quoted=False)
    lines, body = ([_line(row, form) for row in part] for part in (rows[:_HEAD_ROWS], sample))
    head = read_head(lines, body, form, given, path.name)
    width = len(head.names)
    columns: dict[str, Any] = {}
    for i, column in enumerate(head.names):
        cells = [row[i] if i < len(row) else "" for row in rows[head.lines :]]
        columns[column] = _column(cells, form)
    findings = [Finding("assumed", path.name, f"sheet {name!r} of {', '.join(names)}")] if len(names) > 1 else []
    findings += head.unit_findings(path.name)
    rate_Hz = 1.0 / head.step_s if head.step_s else None
    return Table(
        path,
        columns,
        head.unit_of,
        {},
        sample_rate_Hz=rate_Hz,
        decimal=form.decimal,
        thousands=form.thousands,
        findings=findings,
        written={"sheet": name, "columns": width},
    )


def _refuse_large(path: Path) -> None:
    """Raise Fault BAD_TABLE for a workbook that is too large after decompression, by the directory of its archive (xlsx, ods)."""
    if not zipfile.is_zipfile(path):  # xls is not compressed
        return
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
    except (zipfile.BadZipFile, OSError, ValueError):
        return  # the reader reports a damaged file
    if size > _MOST_BYTES:
        line = f"{path.name}: has {size * 1e-6:.0f} MB after decompression: must be at most {_MOST_BYTES * 1e-6:.0f} MB"
        raise Fault("BAD_TABLE", f"{line}; save the sheet with the measurement as .csv")


def _column(cells: list[Any], form: TextLayout) -> Any:
    """Numbers as float64, an empty cell NaN; a column with other cells as texts, its numbers in the same form."""
    if all(cell == "" or isinstance(cell, int | float) for cell in cells):
        return np.array([np.nan if cell == "" else float(cell) for cell in cells])
    return np.array([None if cell == "" else _text(cell, form) for cell in cells], object)


def _line(row: list[Any], form: TextLayout) -> str:
    return _BETWEEN.join(_text(cell, form) for cell in row)


def _text(cell: Any, form: TextLayout) -> str:
    if isinstance(cell, float):
        return str(cell).replace(".", form.decimal)
    return cell.isoformat() if hasattr(cell, "isoformat") else str(cell)
