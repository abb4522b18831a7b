"""Content of a figure: the request, checked before the work, and the numbers of its curves, also as a table.

A curve of many samples is reduced to the least, mean and largest value of each bin, so that a slip of a few ms stays visible.
"""

import csv
import io
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.log.logfile import RunData
from bridge.log.viewers.stretches import Envelope, envelope_of
from cockpit.figures.signals import PlottedSignal, samples_of

_HEAD = ("log", "signal", "t_s", "least", "mean", "largest")
FIRST_LINE = ",".join(_HEAD) + "\n"  # first line of the table; a file with another first line is not replaced
_BINS = 2000  # bins across a figure: 300 dpi over 170 mm. Fewer samples are drawn unbinned
SCREEN, PAPER = "screen", "paper"
_WIDTH_MM = {SCREEN: 280.0, PAPER: 85.0}  # 85 mm is one column of most journals
_NARROWEST_MM, _WIDEST_MM = 40.0, 500.0


class FigureRequest(NamedTuple):
    """A requested figure; times in seconds of the run, -inf and inf for its ends."""

    from_s: float = -math.inf
    to_s: float = math.inf
    signals: str = ""  # comma-separated; empty: the default signals
    style: str = SCREEN
    width_mm: float = _WIDTH_MM[SCREEN]

    @property
    def is_window(self) -> bool:
        """True if only part of the run is requested."""
        return math.isfinite(self.from_s) or math.isfinite(self.to_s)


def request_of(from_s: float, to_s: float, signals: str, style: str, width_mm: float | None) -> FigureRequest:
    """A checked request; the width defaults to the style. Raises Fault CONFIG."""
    if from_s >= to_s:
        raise Fault("CONFIG", f"--from {from_s:g} --to {to_s:g}: from must be before to; exchange them")
    if style not in _WIDTH_MM:
        raise Fault("CONFIG", f"--style {style}: must be {SCREEN} or {PAPER}; choose one of these")
    width_mm = width_mm or _WIDTH_MM[style]
    if not _NARROWEST_MM <= width_mm <= _WIDEST_MM:
        line = f"--width {width_mm:g}: must be from {_NARROWEST_MM:g} to {_WIDEST_MM:g} mm"
        raise Fault("CONFIG", f"{line}; a column of a journal is about {_WIDTH_MM[PAPER]:g}")
    return FigureRequest(from_s, to_s, signals, style, width_mm)


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


class Grid(NamedTuple):
    """Bins centred at `start_s`, `start_s + step_s`, ..."""

    start_s: float
    step_s: float
    bins: int

    @property
    def t_s(self) -> Floats:
        """Centres of the bins, [bins]."""
        return np.arange(self.bins, dtype=np.float64) * self.step_s + self.start_s


def on_grid(t_s: Floats, values: Floats, grid: Grid) -> Envelope:
    """Sort values, [samples] in any order, into bins; omits values that are not finite or outside the grid."""
    bins = np.rint((t_s - grid.start_s) / grid.step_s)
    kept = np.isfinite(values) & (bins >= 0) & (bins < grid.bins)
    at, values = bins[kept].astype(np.int64), values[kept]
    if (np.diff(at) < 0).any():  # a clock that jumped back
        order = np.argsort(at, kind="stable")
        at, values = at[order], values[order]
    starts = np.flatnonzero(np.diff(at, prepend=-1))
    made = Envelope(*(np.full(grid.bins, np.nan) for _ in range(3)))
    if len(starts):
        for column, filled in zip(made, envelope_of(values, starts), strict=True):
            column[at[starts]] = filled
    return made
