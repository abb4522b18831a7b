"""Modes and limits of the controller and the rig's guard, as time intervals with a word each."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from bridge.log.logfile import RunData
from bridge.wire.words import ColumnWord, word_of, words
from cockpit.figures.grid import Grid
from cockpit.figures.signals import BANDS


class BandRow(NamedTuple):
    """One row of bands: start [s], end [s] and word of each interval."""

    title: str
    stretches: list[tuple[float, float, str]]


def bands_of(run: RunData, grid: Grid) -> list[BandRow]:
    """Rows for the topics in a log; an interval shorter than a grid step may be missing."""
    rows: list[BandRow] = []
    for band in BANDS:
        table = getattr(run, band.topic)
        numbers = table[band.field] if len(table) else np.zeros(0)
        if len(numbers) and (band.title in {"mode", "contact", "reason"} or numbers.any()):
            rows.append(BandRow(band.title, _stretches(table["t_ns"] * 1e-9, numbers, grid, band.column)))
    return rows


def used_words(rows: Sequence[BandRow]) -> list[tuple[str, ColumnWord]]:
    """Title of the row and each of its words once, in the order of the rows."""
    used = {(row.title, word) for row in rows for _, _, word in row.stretches}
    known = [(band.title, word) for band in BANDS for word in words() if word.column == band.column]
    return [(title, word) for title, word in known if (title, word.word) in used]


def _stretches(t_s: Any, numbers: Any, grid: Grid, column: str) -> list[tuple[float, float, str]]:
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
            word_of(column, int(numbers[start])),
        )
        for start, end in zip(starts, ends, strict=True)
    ]
