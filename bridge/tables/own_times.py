"""Pairs of columns side by side, each with a time of its own: `t1, F, t2, x`, as spreadsheets merge two loggers."""

import re
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.table import Clock, Table
from bridge.tables.unit_words import bare_name, known_unit

Floats = npt.NDArray[np.float64]

_NAME = re.compile(r"(?:t|ts|time|zeit)(?:\d+|[ _.-].*)?", re.IGNORECASE)
_FEWEST_ROWS = 8
_SAME_STEPS = 1e-3  # of a step: two times that differ by less are one
_SHARED = 0.5  # of the longer record: two times that share less are not those of two loggers of one measurement


class _Time(NamedTuple):
    column: str
    times_s: Floats  # [rows], no number behind the last


def with_own_times(table: Table) -> Table:
    """The table with a clock for each column, that of the nearest time before it; as it is where there are no two such times."""
    names = list(table.columns)
    times = [(at, time) for at, name in enumerate(names) if (time := _time(table, name)) is not None]
    if len(times) < 2 or times[0][0] != 0:
        return table
    ends = [*(at for at, _ in times[1:]), len(names)]
    alone = any(end - at < 2 for (at, _), end in zip(times, ends, strict=True))
    if alone or not all(_differ(times[0][1], time) for _, time in times[1:]):
        return table
    clocks: dict[str, Clock] = {}
    own: dict[str, str] = {}
    for (at, time), end in zip(times, ends, strict=True):
        for name in names[at + 1 : end]:
            clocks[name], own[name] = Clock(0.0, 0.0, time.times_s), time.column
    told = "; ".join(
        f"{time.column!r} is the time of {', '.join(map(repr, (name for name in own if own[name] == time.column)))}"
        for _, time in times
    )
    finding = Finding("assumed", table.path.name, f"each channel has its own time: {told}")
    return replace(table, clocks=clocks, own_times=own, findings=[*table.findings, finding])


def _time(table: Table, name: str) -> _Time | None:
    """A column that holds a time: by its name or unit, and rising from the first row to its last number."""
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


def _differ(one: _Time, other: _Time) -> bool:
    """Whether two times are those of two loggers, and not one that is told twice."""
    one_s, other_s = (time.times_s[np.isfinite(time.times_s)] for time in (one, other))
    shared_s = min(one_s[-1], other_s[-1]) - max(one_s[0], other_s[0])
    if shared_s < _SHARED * max(np.ptp(one_s), np.ptp(other_s)):
        return False
    step_s = float(np.median(np.diff(one_s)))
    return len(one_s) != len(other_s) or float(np.abs(one_s - other_s).max()) > _SAME_STEPS * step_s
