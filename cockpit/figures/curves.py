"""The numbers in a figure, also as a table."""

import csv
import io
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bridge.faults import Fault
from bridge.log.logfile import RunData
from cockpit.figures.grid import Envelope, Grid, on_grid
from cockpit.figures.request import FigureRequest
from cockpit.figures.signals import Floats, PlottedSignal, samples_of

_HEAD = ("log", "signal", "t_s", "least", "mean", "largest")
FIRST_LINE = ",".join(_HEAD) + "\n"  # first line of the table; a file with another first line is not replaced
_BINS = 2000  # bins across a figure: 300 dpi over 170 mm. Fewer samples are drawn unbinned


class LogCurve(NamedTuple):
    """One signal of one log in a figure, in SI units; if `is_raw`, each point is a sample and no bin."""

    log: str
    signal: PlottedSignal
    t_s: Floats  # [points]
    values: Envelope
    is_raw: bool


def window_of(runs: Sequence[RunData], request: FigureRequest) -> tuple[float, float]:
    """Start and end of the shown time [s]. Raises Fault CONFIG for times outside the logs, BAD_LOG without blocks."""
    for run in runs:
        if not len(run.sensors):
            line = f"{run.path}: has no readable sensor block, so nothing can be drawn"
            raise Fault("BAD_LOG", f"{line}; `stickslip log check` lists its contents")
    end_s = max(float(run.sensors["t_ns"].max()) * 1e-9 for run in runs)
    start_s = min(max(float(run.sensors["t_ns"].min()) * 1e-9, 0.0) for run in runs)
    from_s, to_s = max(request.from_s, start_s), min(request.to_s, end_s)
    if request.is_window and from_s >= to_s:
        options = ("--from", request.from_s), ("--to", request.to_s)
        given = " ".join(f"{option} {time_s:g}" for option, time_s in options if math.isfinite(time_s))
        line = f"{given}: the log is from {start_s:g} to {end_s:g} s"
        raise Fault("CONFIG", f"{line}; choose times inside")
    return from_s, to_s


def curve_of(run: RunData, log: str, signal: PlottedSignal, from_s: float, to_s: float) -> LogCurve:
    """A signal between two times: its samples if at most `_BINS`, else bins."""
    t_s, values = samples_of(run, signal)
    inside = (t_s >= from_s) & (t_s <= to_s)
    t_s, values = t_s[inside], values[inside]
    if len(t_s) <= _BINS or to_s <= from_s:
        return LogCurve(log, signal, t_s, Envelope(values, values, values), is_raw=True)
    grid = Grid(from_s, (to_s - from_s) / (_BINS - 1), _BINS)
    return LogCurve(log, signal, grid.t_s, on_grid(t_s, values, grid), is_raw=False)


def as_table(curves: Sequence[LogCurve]) -> str:
    """The curves as CSV, a row per point, in SI units; points without a value are omitted."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(_HEAD)
    for curve in curves:
        rows = np.column_stack([curve.t_s, curve.values.least, curve.values.mean, curve.values.most])
        for row in rows[np.isfinite(rows[:, 2])].tolist():
            table.writerow([curve.log, curve.signal.name, *(f"{number:.9g}" for number in row)])
    return text.getvalue()
