"""Tables with one value a row, as databases and historians write them: a time, the name of a channel, its value."""

import re
from dataclasses import replace

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.cells import numbers, texts_of
from bridge.tables.table import ChannelClock, Table

_NAME = re.compile(r"name|channel|kanal|signal|tag|variable|topic|sensor|measurement|field|item|id", re.IGNORECASE)
_VALUE = re.compile(r"value|wert|reading|messwert|val|_value", re.IGNORECASE)
_TIME = re.compile(r"time|zeit|stamp|date|datum|^t$|^ts$", re.IGNORECASE)
_MOST_CHANNELS = 64  # most channels; a column of more words holds no names
_FEWEST_ROWS = 16  # fewest rows of a channel on average


def pivoted(table: Table) -> Table:
    """The table with a column for each channel, on its own clock; unchanged unless it has a time, a name and a value a row."""
    named = [key for key in table.columns if _NAME.search(key) and not _TIME.search(key)]
    values = [key for key in table.columns if _VALUE.fullmatch(key.strip()) or len(table.columns) == 3]
    times = [key for key in table.columns if _TIME.search(key)]
    name = next((key for key in named if _is_names(table, key)), "")
    value = next((key for key in values if key != name and key not in times[:1]), "")
    if not (name and value and times):
        return table
    words = np.array(texts_of(np.asarray(table.columns[name])), object)
    try:
        times_s = table.seconds(times[0])[0]
        cells = _numbers(table, value)
    except Fault:
        return table
    columns: dict[str, Floats] = {}
    clocks: dict[str, ChannelClock] = {}
    began_s = float(np.nanmin(times_s))
    for word in dict.fromkeys(words):
        rows = (words == word) & np.isfinite(times_s) & np.isfinite(cells)
        if word and rows.any():
            columns[word], clocks[word] = cells[rows], ChannelClock(0.0, 0.0, times_s[rows] - began_s)
    text = f"has one value a row: {value!r} at {times[0]!r} of the channel in {name!r}; channels: {', '.join(columns)}"
    finding = Finding("assumed", table.path.name, text)
    return replace(table, columns=columns, units={}, clocks=clocks, findings=[*table.findings, finding])


def _numbers(table: Table, key: str) -> Floats:
    """The values, NaN for a word, such as a state."""
    texts = texts_of(np.asarray(table.columns[key]))
    plain = [text if re.match(r"\s*[-+.,\d]", text) else "" for text in texts]
    return numbers(np.array(plain, object), f"{table.path.name}: column {key}", table.decimal, table.thousands)[0]


def _is_names(table: Table, key: str) -> bool:
    """Whether a column holds a few words, each in many rows."""
    array = np.asarray(table.columns[key])
    if array.dtype.kind not in "OUS" or not len(array):
        return False
    words = set(texts_of(array))
    return len(words) <= min(_MOST_CHANNELS, len(array) // _FEWEST_ROWS) and all(
        re.match(r"[^\W\d]", word) for word in words if word
    )
