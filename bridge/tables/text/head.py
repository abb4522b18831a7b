"""The lines above the rows of a text table: titles, names of the columns, their units, a rate."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.text.dialect import BLANK, Dialect, TextLayout
from bridge.tables.text.properties import properties_above, with_increment
from bridge.tables.unit_words import in_brackets, is_unit_row, known_unit, unit_in_name, unknown_units

COMMENTS = ("#", "%", "//", "!", "*", ";;", "'")
_CONFIRMED = 5  # number of lines after the first row of which at least half must be rows too
_SYMBOL = 2  # longest symbol of a quantity that may be a unit too, as in `t, m`
_FIRST_ROWS = 20  # first rows that show the full number of columns
_LABEL = "Y_Unit_Label"  # start of LabVIEW's line of units, each above its column
_MOST_ABOVE = 6  # lines above the first row in which names are searched
_RATE = re.compile(
    r"(?:sampl|abtast|scan|acqui|messrate|datenrate|data\s*rate)[\w .\-/]*?(?:rate|freq\w*|messrate)?"
    r"[^\w+-]*(?:\[(?P<u1>\w+)\]\W*)?"
    r"(?P<value>\d[\d.,]*(?:[eE][-+]?\d+)?)\s*(?P<unit>k?Hz|k?S/s|1/s|sps)?",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"(?:delta_?[xt]|dt|(?:sampl|abtast)\w*[ _\-]?(?:interval|intervall|period|time|zeit|schritt))[^\w+-]*(?:is\s+)?"
    r"(?:\[(?P<u1>\w+)\]\W*)?"
    r"(?P<value>\d[\d.,]*(?:[eE][-+]?\d+)?)\s*(?P<unit>ms|µs|us|ns|s)?\b",
    re.IGNORECASE,
)


class Head(NamedTuple):
    """The lines above the rows. `lines` counts all of them."""

    lines: int
    names_line: int  # from 0; -1: missing
    names: list[str]  # as many as there are columns
    units: list[str]  # as many as there are columns, or none
    units_line: int  # from 0; -1: missing
    step_s: float | None  # time between rows, if a line above them states it
    numeric: list[bool]  # whether each column has values in most rows
    comment: str | None

    def is_row(self, line: str, form: TextLayout) -> bool:
        """Whether a line may be a row of numbers."""
        return _is_row(line, form, len(self.names), self.numeric, self.comment)

    @property
    def unit_of(self) -> dict[str, str]:
        """The units by column, as the line of units writes them."""
        return {name: unit for name, unit in zip(self.names, self.units, strict=False) if unit}

    def unit_findings(self, file: str) -> list[Finding]:
        """Findings on the line of units."""
        if not self.units:
            return []
        text = f"line {self.units_line + 1} holds units: {', '.join(filter(None, self.units))}"
        unknown = unknown_units(self.unit_of)
        more = [Finding("units", file, f"unknown unit: {unknown}; kept as written")] if unknown else []
        return [Finding("assumed", file, text), *more]


def read_head(lines: Sequence[str], body: Sequence[str], form: TextLayout, given: Dialect, file: str) -> Head:
    """The head of a table.

    Args:
        lines: the first lines of the file.
        body: lines from further down, only rows.
        form: dialect of the cells.
        given: settings of a map.
        file: name for messages.

    Raises Fault BAD_TABLE without a row of numbers.

    """
    width, numeric = _columns(_first_values(lines, form), form)
    usual, of_body = _columns(body, form)
    if width <= usual or given.skip_rows is not None:
        width, numeric = usual, of_body
    first = _first_row(lines, form, width, numeric, given)
    if first is None:
        line = f"{file}: no row of numbers with {width} cells, separated by {form.delimiter!r}, in the first {len(lines)} lines"
        raise Fault("BAD_TABLE", f"{line}; state source.delimiter and source.skip_rows")
    above, step_s = with_increment(lines[:first], form)
    block = None if given.names or given.skip_rows is not None else properties_above(above, form, width)
    if block is not None:
        names_line, units_line, names, units, of_block = block
        step_s = step_s or of_block
    else:
        names_line, units_line = _names_above([*above, *lines[first : first + 2]], first, form, width, given)
        names = list(given.names or [])
        if not names and names_line >= 0:
            names = _named(above[names_line], form, width)[:width]
        if units_line < 0 and given.units_row is not False:
            units_line = next((at for at in range(first - 1, -1, -1) if lines[at].startswith(_LABEL)), -1)
        units = (
            [unit.strip().strip("[]()") for unit in _named(above[units_line], form, width)] if units_line >= 0 else []
        )
        units = ["" if unit == _LABEL else unit for unit in (units + [""] * width)[:width]] if units else []
    if not units and len(names) == width and all(map(known_unit, names)) and any(len(name) > _SYMBOL for name in names):
        units = names  # `Second,Volt` is a line of units in the place of names
    names = _each_once([name.strip() for name in names], width)
    step_s = step_s or (_step_s(above) if block is None else None)
    return Head(first, names_line, names, units, units_line, step_s, numeric, given.comment)


def _first_values(lines: Sequence[str], form: TextLayout) -> list[str]:
    """The first lines of values alone: where channels end sooner than others, later rows are shorter."""
    values: list[str] = []
    for line in lines:
        cells = form.cells(line)
        if len(cells) > 1 and form.is_number(cells[0]) and all(map(form.is_value, cells)):
            values.append(line)
            if len(values) == _FIRST_ROWS:
                break
    return values


def _columns(body: Sequence[str], form: TextLayout) -> tuple[int, list[bool]]:
    """The most frequent number of cells in a row, and whether each column has values in most rows."""
    rows = [form.cells(line) for line in body if line.strip()]
    if not rows:
        return 1, [True]
    width = Counter(len(row) for row in rows).most_common(1)[0][0]
    full = [row for row in rows if len(row) == width]
    return width, [sum(form.is_value(row[i]) for row in full) > 0.9 * len(full) for i in range(width)]


def _first_row(lines: Sequence[str], form: TextLayout, width: int, numeric: list[bool], given: Dialect) -> int | None:
    """The number of the line that holds the first row, from 0; None without a row."""

    def is_row(line: str) -> bool:
        return _is_row(line, form, width, numeric, given.comment)

    begin = 0 if given.skip_rows is None else given.skip_rows + (0 if given.names else 1)
    for at in range(begin, len(lines)):
        if not is_row(lines[at]):
            continue
        following = [line for line in lines[at + 1 : at + 1 + _CONFIRMED] if line.strip()]
        if 2 * sum(map(is_row, following)) >= len(following):
            return at
    return None


def _is_row(line: str, form: TextLayout, width: int, numeric: list[bool], comment: str | None) -> bool:
    if line.lstrip().startswith(comment or COMMENTS):
        return False
    cells = form.cells(line)
    if abs(len(cells) - width) > 1 or not any(form.is_number(cell) for cell in cells):
        return False
    return all(form.is_value(cell) for cell, value in zip(cells, numeric, strict=False) if value)


def _names_above(lines: Sequence[str], first: int, form: TextLayout, width: int, given: Dialect) -> tuple[int, int]:
    """The lines of names and of units above the first row; -1 if missing."""
    if given.skip_rows is not None and not given.names:
        units = range(given.skip_rows + 1, first)
        unit_rows = [at for at in units if is_unit_row(_named(lines[at], form, width)) and given.units_row is not False]
        return given.skip_rows, unit_rows[0] if unit_rows else -1
    fitting: list[int] = []
    spaced = not "".join(lines[first + 1 : first + 2]).strip()  # a blank line after each, as where lines end in \r\r\n
    for at in range(first - 1, max(first - 1 - _MOST_ABOVE, -1), -1):
        if not lines[at].strip():
            if fitting and not spaced:
                break
            continue
        cells = _named(lines[at], form, width)
        if len(cells) == width + 1 and width > 1 and re.fullmatch(r"\W*|.*:\s*", cells[-1]):
            cells = cells[:-1]  # a label behind the last name
        fits = len(cells) == width and any(cell.strip() and not form.is_number(cell) for cell in cells)
        # a channel may be called 1, but not 0.1
        fits = fits and all(cell.strip().isdigit() for cell in cells if form.is_number(cell))
        if fits:
            fitting.append(at)
        elif fitting:
            break
    units_line = -1
    for at in fitting:
        units = _named(lines[at], form, width)
        above = any(line < at for line in fitting)
        if is_unit_row(units) and (given.units_row is True or (above and given.units_row is None)):
            units_line = at
            break
    left = [at for at in fitting if at != units_line]
    if units_line >= 0:
        left = [at for at in left if at < units_line] or left
    if width == 1:
        return (left[0] if left else -1), units_line
    # the line with most different names, or the nearest of several
    many = {at: len({cell.strip() for cell in _named(lines[at], form, width) if cell.strip()}) for at in left}
    return max(left, key=lambda at: (many[at], at), default=-1), units_line


def _named(line: str, form: TextLayout, width: int) -> list[str]:
    """The cells of a line of names, without a comment mark and without empty cells after the last column."""
    text = line.strip("\r\n\ufeff")
    for mark in COMMENTS:
        if text.lstrip().startswith(mark) and (mark != "%" or text.lstrip()[1:2].isspace()):  # `%time` of ROS is a name
            text = text.lstrip().removeprefix(mark).lstrip(mark).strip()
            break
    if form.delimiter == BLANK:
        wide = [part for part in re.split(r"\t+|\s{2,}", text.strip()) if part]
        cells = (
            wide if len(wide) == width else re.findall(r"(?:\[[^\]]*\]|\([^)]*\)|\S)+(?:\s+[\[(][^\])]*[\])])?", text)
        )
    else:
        cells = form.cells(text)
    while len(cells) > width and (not cells[-1].strip() or cells[-1].strip().lower() == "comment"):
        cells = cells[:-1]
    # rows may end in a delimiter; above rows of two cells a single one is a title, unless it has a unit
    if len(cells) == width - 1 and (len(cells) > 1 or unit_in_name(text) or in_brackets(text)):
        cells = [*cells, ""]
    return cells


def _each_once(names: list[str], width: int) -> list[str]:
    """A unique name for each column: its number if it has no name, and `NAME.1` for a repeated name."""
    seen: Counter[str] = Counter()
    result: list[str] = []
    for number in range(width):
        name = names[number] if number < len(names) and names[number] else str(number + 1)
        result.append(f"{name}.{seen[name]}" if seen[name] else name)
        seen[name] += 1
    return result


def _step_s(lines: Sequence[str]) -> float | None:
    """Time between rows [s], if a line above the rows states it."""
    for line in lines:
        for pattern, is_rate in ((_STEP, False), (_RATE, True)):
            match = pattern.search(line)
            if match is None:
                continue
            text = match["value"]
            try:
                value = float(text.replace(",", ".") if "," in text and "." not in text else text.replace(",", ""))
            except ValueError:
                continue
            unit = (match["unit"] or match["u1"] or "").replace("S/s", "Hz").replace("sps", "Hz")
            known = known_unit(unit) if unit else None
            if value <= 0.0 or (is_rate and known is None and "hz" not in line.lower()):
                continue
            value *= known[1] if known is not None else 1.0
            return 1.0 / value if is_rate else value
    return None
