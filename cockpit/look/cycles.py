"""The slips of a look as a table for a spreadsheet."""

import math
from pathlib import Path

from bridge.files import replacing
from bridge.provenance import provenance
from diagnosis.look.look import Look
from diagnosis.look.sticks import Cycle

SHEETS = (".csv", ".xlsx")


def write_cycles(seen: Look, out: Path, source: Path) -> None:
    """Write one row a slip, .csv or .xlsx. A value that the record does not show is empty."""
    names = list(Cycle._fields)
    rows = [[None if not math.isfinite(value) else value for value in cycle] for cycle in seen.cycles]
    with replacing(out) as file:
        if out.suffix.lower() == ".csv":
            text = [",".join(names), *(",".join("" if value is None else repr(value) for value in row) for row in rows)]
            file.write(("\n".join(text) + "\n").encode())
            return
        import xlsxwriter

        with xlsxwriter.Workbook(file, {"in_memory": True}) as book:
            sheet = book.add_worksheet("slips")
            sheet.write_row(0, 0, names)
            for i, row in enumerate(rows, 1):
                sheet.write_row(i, 0, row)
            numbers = book.add_worksheet("numbers")
            numbers.write_row(0, 0, ["name", "value", "low 90 %", "high 90 %", "unit"])
            for i, (name, number) in enumerate(seen.numbers.items(), 1):
                numbers.write_row(
                    i, 0, [name, *(one if math.isfinite(one) else None for one in number[:3]), number.unit]
                )
            book.add_worksheet("source").write_row(0, 0, [provenance([source]).in_words()])
