"""Properties of the channels above the rows: a line for each, its key in the first cell, a value for each column or pair."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from bridge.tables.text.dialect import TextLayout
from bridge.tables.unit_words import known_unit

# keys of the lines of names and units, without their unit and case: TwinCAT Scope, DIAdem, imc, NI, Yokogawa, Hioki, HBM
_NAMES = {
    "name",
    "names",
    "channel",
    "channel name",
    "channelname",
    "signal",
    "signal name",
    "trace_name",
    "trace name",
}
_NAMES |= {"variable", "kanal", "kanalname", "signalname", "title", "source"}
_UNITS = {"unit", "units", "einheit", "channel unit", "vertical units", "y_unit_label", "unit symbol", "unité", "vunit"}
_STEP = re.compile(
    r"(?:sample|sampling|abtast)[ _]?(?:time|interval|period|zeit|intervall)\s*[\[(]?(?P<unit>\w*)[\])]?", re.I
)
_FEWEST = 2  # fewest lines of a block


class Properties(NamedTuple):
    """Names and units of the columns; `lines` are the first and last line of the block."""

    names_line: int
    units_line: int  # -1: missing
    names: list[str]
    units: list[str]


def properties_above(lines: Sequence[str], form: TextLayout, width: int) -> Properties | None:
    """The properties of the columns from the lines above the rows; None without such a block.

    In pairs, as TwinCAT writes them, each channel has a column of times before it, and each key is written before each value.
    """
    for at in range(len(lines) - 1, -1, -1):
        names = _filled(form.cells(lines[at]), width)
        if len(names) < width or _key(names[0]) not in _NAMES:
            continue
        block: list[tuple[int, list[str]]] = []
        for below in range(at, len(lines)):
            cells = form.cells(lines[below])
            if not lines[below].strip() or form.is_number(cells[0]):
                break
            block.append((below, _filled(cells, width)))
        if len(block) < _FEWEST:
            continue
        of_units = next(((line, cells) for line, cells in block if _key(cells[0]) in _UNITS), (-1, [""] * width))
        units = [_unit(cell) for cell in of_units[1]]
        steps = (_STEP.fullmatch(cells[0].strip()) for _, cells in block)
        of_time = next((step["unit"] for step in steps if step is not None), "")
        pairs = width > 2 and width % 2 == 0 and len({_key(key) for key in names[::2]}) == 1
        for key in range(0, width, 2 if pairs else width):
            names[key] = f"time {names[key + 1].strip()}" if pairs else "time"
            units[key] = of_time if known_unit(of_time) else ""
        return Properties(at, of_units[0], names, units)
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
            result[at], result[at + 1] = (form.delimiter.join(form.cells(line)[:cut]) for line in lines[at : at + 2])
            return result, float(below[place].replace(form.decimal, "."))
    return result, None


def _key(cell: str) -> str:
    return re.sub(r"[\[(].*|:", "", cell).strip().lower()


def _filled(cells: list[str], width: int) -> list[str]:
    """The cells of a line, with empty cells to the width where it ends sooner by one."""
    return [*cells, *[""] * (width - len(cells))][:width] if len(cells) >= width - 1 else cells


def _unit(cell: str) -> str:
    """The unit of a cell without the description behind it: `N (Force)`."""
    word = re.sub(r"\s*\([^)]*\)$", "", cell.strip()).strip()
    return word if word or not known_unit(cell) else cell.strip()
