"""The slips of a look as a table for a spreadsheet."""

import math
import re
import zipfile
import zlib
from pathlib import Path

from bridge.faults import Fault
from bridge.files import not_ours, refuse_to_replace_text, replacing
from bridge.provenance import provenance
from diagnosis.look.look import LookResult
from diagnosis.look.sticks import Cycle

# documented in docs/guides/look.md; the compliances of each stick alone are too uncertain to be shown
_COLUMNS = [name for name in Cycle._fields if name not in ("loading_N_per_s", "drive_m_per_N", "contact_m_per_N")]
_FIRST_COLUMN = "breakaway_t_s,"
_AUTHOR = "stickslip look"


def refuse_to_replace_sheet(out: Path, place: str) -> None:
    """Raise Fault CONFIG if `out`, .csv or .xlsx, exists and was not written by `write_cycles`."""
    if out.suffix.lower() == ".csv":
        refuse_to_replace_text(out, _FIRST_COLUMN, place)
    elif out.is_file() and out.stat().st_size and not _is_our_book(out):
        raise Fault("CONFIG", not_ours(out, place))


def _is_our_book(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as book, book.open("docProps/core.xml") as about:
            return f"<dc:creator>{_AUTHOR}</dc:creator>".encode() in about.read(1 << 16)
    # errors of `zipfile` for other files, for damaged or encrypted archives, and for an unknown compression
    except (OSError, zipfile.BadZipFile, KeyError, NotImplementedError, RuntimeError, EOFError, zlib.error):
        return False


def write_cycles(seen: LookResult, out: Path, source: Path) -> None:
    """Write one row per slip, .csv or .xlsx; unknown values are empty."""
    unit = seen.known.force_unit
    names = [name if unit == "N" else re.sub(r"(?<=_)N(?=_|$)", unit.replace(" ", "."), name) for name in _COLUMNS]
    values = [[getattr(cycle, name) for name in _COLUMNS] for cycle in seen.cycles]
    rows = [[value if math.isfinite(value) else None for value in row] for row in values]
    with replacing(out) as file:
        if out.suffix.lower() == ".csv":
            text = [",".join("" if value is None else repr(value) for value in row) + "\n" for row in rows]
            file.write("".join([",".join(names) + "\n", *text]).encode())
            return
        import xlsxwriter

        with xlsxwriter.Workbook(file, {"in_memory": True}) as book:
            book.set_properties({"author": _AUTHOR})
            sheet = book.add_worksheet("slips")
            sheet.write_row(0, 0, names)
            for i, row in enumerate(rows, 1):
                sheet.write_row(i, 0, row)
            numbers = book.add_worksheet("numbers")
            numbers.write_row(0, 0, ["name", "value", "low 90 %", "high 90 %", "unit"])
            for i, (name, number) in enumerate(seen.numbers.items(), 1):
                numbers.write_row(
                    i, 0, [name, *(value if math.isfinite(value) else None for value in number[:3]), number.unit]
                )
            book.add_worksheet("source").write_row(0, 0, [provenance([source]).in_words()])
