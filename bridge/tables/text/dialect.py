"""The dialect of a text table: delimiter, marks of decimals and thousands.

CleverCSV detects the delimiter and the quotes (docs/decisions/29-sniffing.md). It does not support decimal commas, so the form of
the numbers is detected here: the form in which most cells are numbers.
"""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from bridge.tables.cells import APOSTROPHES, BLANKS, is_time
from bridge.tables.text.unit_cells import number_and_unit

BLANK = " "  # the delimiter of columns separated by any number of blanks and tabs
_DELIMITERS = (",", ";", "\t", "|", " ")
_SNIFFED_LINES = 60  # lines given to CleverCSV, which takes 30 ms for them
_NO_NUMBER = frozenset(("", *"- -- --- nan #nv #n/a n/a na null none inf -inf ovl ovr ovrflw #nan 1.#qnan".split(" ")))  # noqa: SIM905
_FIRST_LINES = 2000  # lines in which a time that begins at 0 is still below 1 s, up to 2 kHz
_BELOW_ONE = re.compile(r"[-+]?0([.,])\d+")
# marks of decimals and thousands; of several that fit equally well, the first is chosen
_FORMS = ((".", ""), (",", ""), (".", ","), (",", "."), (".", "'"), (",", "'"), (".", " "), (",", " "))


class Dialect(NamedTuple):
    """Keys of [source] of a map for a text table; None: detect it."""

    delimiter: str | None = None
    decimal: str | None = None
    skip_rows: int | None = None  # lines before the line of the names
    encoding: str | None = None
    thousands: str | None = None
    names: tuple[str, ...] | None = None  # names of the columns, in place of the file's names
    units_row: bool | None = None  # whether a line of units follows the names
    comment: str | None = None  # start of lines to skip
    sheet: str | None = None  # name of a workbook's sheet


class TextLayout(NamedTuple):
    """The detected dialect of a text table."""

    delimiter: str
    quote: str
    decimal: str
    thousands: str

    def cells(self, line: str) -> list[str]:
        """The cells of one line."""
        if self.delimiter == BLANK:
            return line.split()
        if not self.quote:
            return line.split(self.delimiter)
        row: list[str] = next(
            csv.reader([line], delimiter=self.delimiter, quotechar=self.quote, skipinitialspace=True), []
        )
        return row

    def is_number(self, cell: str) -> bool:
        """Whether a cell is a number of this form, with or without a unit."""
        return _pattern(self.decimal, self.thousands).fullmatch(number_and_unit(cell)[0]) is not None

    def is_value(self, cell: str) -> bool:
        """Whether a cell is a number, a time, empty, or a word for a missing number."""
        return cell.strip().lower() in _NO_NUMBER or self.is_number(cell) or is_time(cell)


def form_of(lines: Sequence[str], given: Dialect, quoted: bool, begin: Sequence[str] = ()) -> TextLayout:
    """The form of a table from lines of its body; values in `given` are kept.

    `quoted`: names have quotes. `begin`: the first lines, where a time below 1 s reveals the decimal mark.
    """
    lines = [line for line in lines if line.strip()]
    sniffed = lines[:: max(len(lines) // _SNIFFED_LINES, 1)][:_SNIFFED_LINES]
    delimiter, quote = _delimiter(sniffed, lines, given, '"' if quoted else "")
    decimal, thousands = _numbers(lines, begin[:_FIRST_LINES], delimiter, quote, given)
    return TextLayout(delimiter, quote, decimal, thousands)


def _delimiter(lines: Sequence[str], all_lines: Sequence[str], given: Dialect, quote: str) -> tuple[str, str]:
    if given.delimiter is not None:
        return given.delimiter, quote
    # numbers never contain these marks: if all lines have equally many, they separate columns, and commas are decimal
    for mark in (";", "\t"):
        counts = {line.rstrip("\r\n").count(mark) for line in lines}
        if len(counts) == 1 and counts != {0}:
            return mark, quote
    from clevercsv.detect import Detector

    result = Detector().detect("\n".join(lines), delimiters=_DELIMITERS) if lines else None
    if result is None or not result.delimiter:
        return ",", quote
    if result.delimiter == "," and given.decimal != "." and _one_column_with_commas(all_lines):
        return ";", quote
    return result.delimiter, result.quotechar or quote


def _one_column_with_commas(lines: Sequence[str]) -> bool:
    """Whether the lines are a single column of numbers with a decimal comma, rather than two columns of integers.

    Decimals are several digits in most lines, and some have a leading zero.
    """
    parts = [re.fullmatch(r"\s*[-+]?(\d+),(\d+)(?:[eE][-+]?\d+)?\s*", line) for line in lines]
    digits = Counter(len(part[2]) for part in parts if part is not None)
    if None in parts or not digits:
        return False
    return digits.most_common(1)[0][0] > 1 and any(part is not None and part[2].startswith("0") for part in parts)


def _numbers(lines: Sequence[str], begin: Sequence[str], delimiter: str, quote: str, given: Dialect) -> tuple[str, str]:
    """Marks of decimals and thousands with which most cells are numbers."""
    trial = TextLayout(delimiter, quote, ".", "")
    cells = [number_and_unit(cell)[0] for line in lines for cell in trial.cells(line)]
    decimals = {
        match[1] for line in begin for cell in trial.cells(line) if (match := _BELOW_ONE.fullmatch(cell.strip()))
    }
    best, most = (given.decimal or ".", given.thousands or ""), -1
    for decimal, thousands in _FORMS:
        if given.decimal not in (None, decimal) or given.thousands not in (None, thousands):
            continue
        if (delimiter == BLANK and thousands == " ") or thousands in decimals:
            continue
        pattern = _pattern(decimal, thousands)
        count = sum(pattern.fullmatch(cell) is not None for cell in cells)
        if count > most:
            best, most = (decimal, thousands), count
    return best


@cache
def _pattern(decimal: str, thousands: str) -> re.Pattern[str]:
    """Pattern of a number: digits with a decimal mark, or in groups of three."""
    point = re.escape(decimal)
    grouped = ""
    if thousands:
        marks = BLANKS if thousands == " " else APOSTROPHES if thousands == "'" else (thousands,)
        between = "[" + "".join(re.escape(mark) for mark in marks) + "]"
        # a number with thousands does not begin with 0: `0,001` has a decimal comma
        grouped = rf"|[1-9]\d{{0,2}}(?:{between}\d{{3}})+(?:{point}\d*)?"
    return re.compile(rf"[-+]?(?:\d+(?:{point}\d*)?|{point}\d+{grouped})(?:[eEdD][-+]?\d+)?|[-+]?(?:nan|inf)", re.I)
