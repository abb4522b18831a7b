"""Columns with separate times, as spreadsheets merge two loggers: `t1, F, t2, x`."""

import re
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.table import ChannelClock, Table
from bridge.tables.unit_words import bare_name, known_unit

_NAME = re.compile(r"(?:t|ts|time|zeit)(?:\d+|[ _.-].*)?", re.IGNORECASE)
_FEWEST_ROWS = 8  # fewest numbers in a column of times
_SAME_STEPS = 1e-3  # largest difference of two equal times, as a share of a step
_SHARED = 0.5  # smallest overlap of two loggers of one measurement, as a share of the longer record


class _Time(NamedTuple):
    column: str
    times_s: Floats  # [rows], NaN after the last time


def with_own_times(table: Table) -> Table:
    """The table with a clock for each column, from the nearest time to its left; unchanged without two different times."""
    names = list(table.columns)
    times = [(at, time) for at, name in enumerate(names) if (time := _time(table, name)) is not None]
    if len(times) < 2 or times[0][0] != 0:
        return table
    ends = [*(at for at, _ in times[1:]), len(names)]
    alone = any(end - at < 2 for (at, _), end in zip(times, ends, strict=True))
    if alone or not all(_differ(times[0][1], time) for _, time in times[1:]):
        return table
    clocks: dict[str, ChannelClock] = {}
    time_of: dict[str, str] = {}
    for (at, time), end in zip(times, ends, strict=True):
        for name in names[at + 1 : end]:
            clocks[name], time_of[name] = ChannelClock(0.0, 0.0, time.times_s), time.column
    text = "; ".join(
        f"{time.column!r} is the time of {', '.join(map(repr, (name for name in time_of if time_of[name] == time.column)))}"
        for _, time in times
    )
    finding = Finding("assumed", table.path.name, f"each channel has its own time: {text}")
    return replace(table, clocks=clocks, own_times=time_of, findings=[*table.findings, finding])


def _time(table: Table, name: str) -> _Time | None:
    """A column of times: by its name or unit, and rising from the first row to its last number; else None."""
    known = known_unit(table.unit(name))
    if (known is not None and known[0] != "time") or not (known or _NAME.fullmatch(bare_name(name))):
        return None
    try:
        times_s = table.column(name) * (known[1] if known else 1.0)
    except Fault:
        return None
    count = int(np.count_nonzero(np.isfinite(times_s)))
    if count < _FEWEST_ROWS or not (np.diff(times_s[:count]) > 0.0).all():
        return None
    return _Time(name, times_s)


def _differ(first: _Time, second: _Time) -> bool:
    """Whether two times come from two loggers, rather than one time written twice."""
    first_s, second_s = (time.times_s[np.isfinite(time.times_s)] for time in (first, second))
    shared_s = min(first_s[-1], second_s[-1]) - max(first_s[0], second_s[0])
    if shared_s < _SHARED * max(np.ptp(first_s), np.ptp(second_s)):
        return False
    step_s = float(np.median(np.diff(first_s)))
    return len(first_s) != len(second_s) or float(np.abs(first_s - second_s).max()) > _SAME_STEPS * step_s
