"""Modes and limits of the controller and the rig's guard, as time intervals with a word each."""

from typing import Any, NamedTuple

import numpy as np

from bridge.log.logfile import RunData
from bridge.wire.words import ColumnWord, words
from cockpit.figures.grid import Grid


class BandRow(NamedTuple):
    """One row of bands: start [s], end [s] and word of each interval."""

    title: str
    column: str  # of `bridge.wire.words`
    stretches: list[tuple[float, float, str]]


_ROWS = (
    ("mode", "mode", "trace", "mode"),
    ("contact", "state", "trace", "state"),
    ("reason", "reason", "trace", "reason"),
    ("limit", "limit", "trace", "limit"),
    ("guard", "guard_state", "applied", "guard_state"),
)  # title, column of words, topic, field


def bands_of(run: RunData, grid: Grid) -> list[BandRow]:
    """Rows for the topics in a log; an interval shorter than a grid step may be missing."""
    rows: list[BandRow] = []
    for title, column, topic, field in _ROWS:
        table = getattr(run, topic)
        numbers = table[field] if len(table) else np.zeros(0)
        if len(numbers) and (title in {"mode", "contact", "reason"} or numbers.any()):
            rows.append(BandRow(title, column, _stretches(table["t_ns"] * 1e-9, numbers, grid, _by_number(column))))
    return rows


def title_of(column: str) -> str:
    """Title of the row for a column of words."""
    return next(title for title, known, _, _ in _ROWS if known == column)


def used_words(rows: list[BandRow]) -> list[ColumnWord]:
    """The words used in the rows, each once, in the order of the rows."""
    used = {(row.column, word) for row in rows for _, _, word in row.stretches}
    order = [column for _, column, _, _ in _ROWS]
    return sorted((row for row in words() if (row.column, row.word) in used), key=lambda row: order.index(row.column))


def _by_number(column: str) -> dict[int, str]:
    return {word.number: word.word for word in words() if word.column == column}


def _stretches(t_s: Any, numbers: Any, grid: Grid, names: dict[int, str]) -> list[tuple[float, float, str]]:
    """Intervals of a constant number. Each starts one step early: numbers are reported at the end of a block."""
    at = np.rint((t_s - grid.start_s) / grid.step_s)
    last_of_bin = np.flatnonzero(np.diff(at, append=np.inf) != 0)
    at, numbers = at[last_of_bin], numbers[last_of_bin]
    starts = np.flatnonzero(np.diff(numbers.astype(np.int64), prepend=-1))
    ends = np.append(starts[1:] - 1, len(numbers) - 1)
    return [
        (
            round(grid.start_s + (float(at[start]) - 1.0) * grid.step_s, 6),
            round(grid.start_s + float(at[end]) * grid.step_s, 6),
            names.get(int(numbers[start]), str(int(numbers[start]))),
        )
        for start, end in zip(starts, ends, strict=True)
    ]
