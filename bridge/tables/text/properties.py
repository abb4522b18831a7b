"""Properties of the channels above the rows: a line for each, its key in the first cell, a value for each column or pair."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from bridge.tables.text.dialect import TextLayout
from bridge.tables.unit_words import known_unit

# keys of the lines of names and units, without their unit and case: TwinCAT Scope, DIAdem, imc, NI, Yokogawa, Hioki, HBM
_NAMES = re.compile(
    "name|names|channel|channel name|channelname|signal|signal name|tracename|trace_name|trace name"
    "|variable|kanal|kanalname|signalname"
)
_UNITS = re.compile("unit|units|einheit|channel unit|vertical units|y_unit_label|unit symbol|vunit|unit_string|unité")
_STEP = re.compile(
    r"(?:sample|sampling|abtast)[ _]?(?:time|interval|period|zeit|intervall)\s*[\[(]?(?P<unit>\w*)[\])]?", re.I
)
_IN_EACH = re.compile(r"\s*([A-Za-z][\w .-]*):")  # `name: Time, name: Force`
# keys of the time between samples
_INTERVALS = re.compile("hresolution|sample interval|sampleinterval|interval|delta|dt|tdelta|increment|xincrement")
_FEWEST = 2  # fewest lines of a block


class _Property(NamedTuple):
    """One line: its key, and its cells, of which the first is the key or not."""

    key: str
    cells: list[str]
    has_key: bool


class Properties(NamedTuple):
    """Names and units of the columns; `lines` are the first and last line of the block."""

    names_line: int
    units_line: int  # -1: missing
    names: list[str]
    units: list[str]
    step_s: float | None  # time between rows, where a line states it for all channels


def properties_above(lines: Sequence[str], form: TextLayout, width: int) -> Properties | None:
    """The properties of the columns from the lines above the rows; None without such a block.

    In pairs, as TwinCAT writes them, each channel has a column of times before it, and each key is written before each value.
    """
    rows = [_property(line, form, width) for line in lines]
    for at in range(len(lines) - 1, -1, -1):
        row = rows[at]
        if row is None or not _NAMES.fullmatch(row.key) or not "".join(row.cells[1:]).strip():
            continue
        end = next((below for below in range(at, len(lines)) if rows[below] is None), len(lines))
        block = [(line, below) for line in range(at, end) if (below := rows[line]) is not None]
        if len(block) < _FEWEST:
            continue
        of_units = next(((line, below) for line, below in block if _UNITS.fullmatch(below.key)), None)
        names, units = row.cells, [_unit(cell) for cell in of_units[1].cells] if of_units else [""] * width
        if row.has_key:
            steps = (_STEP.fullmatch(below.cells[0].strip()) for _, below in block)
            of_time = next((step["unit"] for step in steps if step is not None), "")
            pairs = width > 2 and width % 2 == 0 and len({_key(key) for key in names[::2]}) == 1
            for key in range(0, width, 2 if pairs else width):
                names[key] = f"time {names[key + 1].strip()}" if pairs else "time"
                units[key] = of_time if known_unit(of_time) else ""
        steps = [below.cells[1].replace(form.decimal, ".") for _, below in block if _INTERVALS.fullmatch(below.key)]
        step_s = float(steps[0]) if steps and re.fullmatch(r"\s*[\d.]+(?:[eE][-+]?\d+)?\s*", steps[0]) else None
        return Properties(at, of_units[0] if of_units else -1, names, units, step_s)
    return None


def with_increment(lines: Sequence[str], form: TextLayout) -> tuple[list[str], float | None]:
    """The lines without the cells `Start` and `Increment`, whose values are in the line below, and the increment."""
    result = list(lines)
    for at in range(len(lines) - 1):
        cells = [cell.strip().lower() for cell in form.cells(lines[at])]
        below = form.cells(lines[at + 1])
        place = next((i for i, cell in enumerate(cells) if cell in ("increment", "tinc", "delta")), 0)
        if place and place < len(below) and form.is_number(below[place]):
            cut = place - (cells[place - 1] in ("start", "t0"))
            result[at] = form.delimiter.join(form.cells(lines[at])[:cut])
            # the first column numbers the rows: `Sequence` names no unit
            result[at + 1] = form.delimiter.join(["", *below[1:cut]] if below[0].strip() == "Sequence" else below[:cut])
            return result, float(below[place].replace(form.decimal, "."))
    return result, None


def _key(cell: str) -> str:
    return re.sub(r"[\[(].*|:", "", cell).strip().lower()


def _property(line: str, form: TextLayout, width: int) -> _Property | None:
    """A line of properties: its key in the first cell, or in each cell before a colon; None for another line."""
    text = line.strip("\r\n").lstrip("#%! ")
    cells = form.cells(text)
    if not width - 1 <= len(cells) or not text.strip() or form.is_number(cells[0]):
        return None
    cells = [*cells, ""][:width]
    keys = [_IN_EACH.match(cell) for cell in cells]
    if width > 1 and all(keys) and len({key[1].strip().lower() for key in keys if key}) == 1:
        return _Property(_key(cells[0].partition(":")[0]), [cell.partition(":")[2].strip() for cell in cells], False)
    return _Property(_key(cells[0]), cells, True)


def _unit(cell: str) -> str:
    """The unit of a cell without the description behind it: `N (Force)`."""
    word = re.sub(r"\s*\([^)]*\)$", "", cell.strip()).strip()
    return word if word or not known_unit(cell) else cell.strip()
