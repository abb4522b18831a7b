"""One log, or two overlaid, as a figure: for a screen with the verdict as title, or for a paper without title."""

import re
import textwrap
from collections.abc import Sequence
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from bridge.files import replacing, write_whole
from bridge.log.logfile import RunData, read_run
from bridge.provenance import Provenance, provenance, shown_name
from bridge.units import counted
from bridge.wire import stickslip_pb2 as wire
from cockpit.figures.curves import PAPER, SCREEN, FigureRequest, LogCurve, as_table, curve_of, window_of
from cockpit.figures.signals import limits_of, named
from cockpit.judge.judged import judge_tables
from cockpit.judge.verdict import RunVerdict
from cockpit.judge.verdict_words import headline
from diagnosis.slips import Cycles

_SHADES: dict[int, tuple[str, str]] = {
    wire.EXCITE: ("#dcebd8", "vibrating"),
    wire.WAIT: ("#f2d694", "waiting for re-stick"),
    wire.PROBE: ("#d5e3f0", "probing"),
    wire.STOPPED: ("#f0d5d5", "stopped"),
}  # colour and label by mode
_INK, _SLIP = "#1f2d3a", "#b5402a"
_DPI = {SCREEN: 110.0, PAPER: 600.0}  # dots per inch of a .png
_MM = 1.0 / 25.4  # inches per mm
_FIRST_MM = {SCREEN: 90.0, PAPER: 42.0}  # height of the first panel, and of each that follows
_NEXT_MM = {SCREEN: 60.0, PAPER: 30.0}
_FOOT_MM = 1.35  # width of a letter in the foot line
_LETTER_MM, _KEY_MM = 0.18, 1.4  # width of a letter and of a key in the legend, per point of font size
_ON_TOP = 3.0  # z-order of the first signal; later signals lie behind it
_FAR_LIMIT = 3.0  # times the largest value of a curve, beyond which a limit does not scale its axis
_SECOND_ALPHA = 0.55  # opacity of the second log, whose lines are also dashed


class _Shown(NamedTuple):
    """A log in a figure."""

    run: RunData
    name: str
    verdict: RunVerdict
    cycles: Cycles | None  # slips; None without a force


class Plotted(NamedTuple):
    """A picture with the verdict on its first log."""

    verdict: RunVerdict
    picture: Path
    data: Path | None  # file with the numbers of the curves
    JSON_MERGED = "verdict"


def draw_logs(
    logs: Sequence[Path], out: Path, request: FigureRequest | None = None, data: Path | None = None
) -> list[RunVerdict]:
    """Draw one log, or two over each other, to `out`, a .png, .svg or .pdf file; returns their verdicts.

    `data`: path for the numbers of the curves as CSV. Raises Fault BAD_LOG, CONFIG, LOG_WRITE, and OSError if a file cannot
    be written.
    """
    wanted = request or FigureRequest()
    made = provenance(logs)
    runs = [read_run(path) for path in logs]
    shown = [_Shown(run, name, *judge_tables(run)) for run, name in zip(runs, _names(logs), strict=True)]
    from_s, to_s = window_of(runs, wanted)
    signals = [named(wanted.signals, log.run) for log in shown]
    panels = [
        [
            curve_of(log.run, log.name, signal, from_s, to_s)
            for signal in group
            for log, of_log in zip(shown, signals, strict=True)
            if signal in of_log
        ]
        for _, group in groupby(signals[0], lambda signal: (signal.axis, signal.unit))
    ]
    _save(_figure(shown, panels, wanted, (from_s, to_s), made), shown, out, wanted, made)
    if data is not None:
        write_whole(data, as_table([curve for panel in panels for curve in panel]))
    return [log.verdict for log in shown]


def _names(logs: Sequence[Path]) -> list[str]:
    """Distinct names of the logs: with their folders if the file names are equal, numbered if the paths are equal."""
    names = [shown_name(path.name) for path in logs]
    if len({*names}) == len(names):
        return names
    paths = [shown_name(str(path)) for path in logs]
    return paths if len({*paths}) == len(paths) else [f"{name} ({at})" for at, name in enumerate(names, 1)]


def _literal(name: str) -> str:
    """A name with escaped dollars, which would start a formula in matplotlib."""
    return name.replace("$", r"\$")


def _figure(
    shown: Sequence[_Shown],
    panels: Sequence[Sequence[LogCurve]],
    request: FigureRequest,
    window_s: tuple[float, float],
    made: Provenance,
) -> Any:
    paper = request.style == PAPER
    heights_mm = [_FIRST_MM[request.style], *([_NEXT_MM[request.style]] * (len(panels) - 1))]
    size = (request.width_mm * _MM, sum(heights_mm) * _MM)
    with mpl.rc_context(_rules(paper)):
        figure = Figure(figsize=size, layout="constrained")
        every: Any = figure.subplots(len(panels), 1, sharex=True, squeeze=False, height_ratios=heights_mm)[:, 0]
        if not paper:
            figure.suptitle(_title(shown, request, window_s), color=_INK, parse_math=False)
            foot = textwrap.fill(made.in_words(), int(request.width_mm / _FOOT_MM))
            figure.supxlabel(foot, fontsize=6, color="#808b96", x=0.01, ha="left", parse_math=False)
        for number, (axes, curves) in enumerate(zip(every, panels, strict=True)):
            _panel(axes, shown, curves, window_s)
            if len(shown) == 1:
                _shade(axes, shown[0], window_s, named=number == 0)
            _legend(axes, request)
        every[-1].set_xlabel("time [s]")
        every[-1].set_xlim(*window_s) if window_s[1] > window_s[0] else None
    return figure


def _rules(paper: bool) -> Any:
    """Settings of matplotlib: small, searchable text for a paper, and reproducible SVG."""
    size = 7.0 if paper else 10.0
    return {
        "font.family": "DejaVu Sans",  # shipped with matplotlib, so equal on every computer
        "font.size": size,
        "axes.linewidth": 0.5 if paper else 0.8,
        "lines.linewidth": 0.8 if paper else 1.2,
        "lines.markersize": 3.0 if paper else 6.0,
        "legend.fontsize": size - (0.5 if paper else 1.0),
        "pdf.fonttype": 42,
        "svg.hashsalt": "stickslip",
    }


def _title(shown: Sequence[_Shown], request: FigureRequest, window_s: tuple[float, float]) -> str:
    """The headline of each log's verdict; for a part of a run also the number of slips in it."""
    lines: list[str] = []
    for log in shown:
        name = f"{log.name}: " if len(shown) > 1 else ""
        part = ""
        if request.is_window:
            part = f"\nshown: {window_s[0]:g} to {window_s[1]:g} s of {log.verdict.seconds:.4g} s"
            if log.cycles is not None:
                inside = log.cycles.between(*window_s).slips
                part += f", {inside} of {counted(log.cycles.slips, 'slip')}"
        lines.append(name + headline(log.verdict) + part)
    return "\n".join(lines)


def _panel(axes: Any, shown: Sequence[_Shown], curves: Sequence[LogCurve], window_s: tuple[float, float]) -> None:
    names = [log.name for log in shown]
    signals = list(dict.fromkeys(curve.signal for curve in curves))
    first = signals[0]
    axes.margins(x=0)
    axes.spines[["top", "right"]].set_visible(False)
    for curve in curves:
        whose = f", {_literal(curve.log)}" if len(shown) > 1 else ""
        zorder = _ON_TOP - 0.1 * signals.index(curve.signal)
        _draw(axes, curve, curve.signal.title + whose, names.index(curve.log) > 0, zorder)
    for words, value in limits_of(shown[0].run, first.axis):
        shown_to = max(abs(axes.get_ylim()[0]), abs(axes.get_ylim()[1]))
        far = (
            value * first.factor > _FAR_LIMIT * shown_to
        )  # the axis is the curve's; a limit beyond it is in the legend alone
        at, label = (
            (np.nan, f"{words}, {value * first.factor:.4g} {first.unit}") if far else (value * first.factor, words)
        )
        axes.axhline(at, color=_SLIP, linewidth=0.6, linestyle="--", label=label)
    if first.name == "drive_force_N":
        for number, log in enumerate(shown):
            _mark_slips(axes, log, window_s, second=number > 0, several=len(shown) > 1)
    axes.set_ylabel(first.axis_title)
    if first.axis in {"velocity", "amplitude"} and axes.get_ylim()[1] > 0.0:
        least = [float(np.nanmin(curve.values.least, initial=0.0)) for curve in curves]
        axes.set_ylim(bottom=min(least) * first.factor * 1.05)


def _legend(axes: Any, request: FigureRequest) -> None:
    """Legend above the axes, where it hides no slip, in as many columns as fit."""
    handles, labels = axes.get_legend_handles_labels()
    if len(handles) < 2:
        return
    size = _rules(request.style == PAPER)["legend.fontsize"]
    fitting = int(0.85 * request.width_mm / (size * (_KEY_MM + _LETTER_MM * max(map(_letters, labels)))))
    columns = min(max(fitting, 1), len(handles))
    axes.legend(handles, labels, ncols=columns, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0))


def _letters(label: str) -> int:
    """Visible letters of a label; a formula symbol such as v_a counts as two."""
    return len(re.sub(r"\$.*?\$", "vd", label))


def _draw(axes: Any, curve: LogCurve, label: str, second: bool, zorder: float) -> None:
    """Draw the mean as a line over the range from least to largest."""
    factor, colour = curve.signal.factor, curve.signal.colour
    alpha = _SECOND_ALPHA if second else 1.0
    if not curve.is_raw:
        low, high = factor * curve.values.least, factor * curve.values.most
        axes.fill_between(curve.t_s, low, high, color=colour, alpha=0.3 * alpha, linewidth=0, zorder=zorder)
    line = "--" if second else "-"
    mean = factor * curve.values.mean
    axes.plot(curve.t_s, mean, color=colour, alpha=alpha, linestyle=line, label=label, zorder=zorder)


def _mark_slips(axes: Any, shown: _Shown, window_s: tuple[float, float], second: bool, several: bool) -> None:
    """Draw a triangle at each breakaway; the legend states the number of slips."""
    if shown.cycles is None:
        return
    inside = (shown.cycles.breakaway_t_s >= window_s[0]) & (shown.cycles.breakaway_t_s <= window_s[1])
    if not inside.any():
        return
    whose = f", {_literal(shown.name)}" if several else ""
    axes.plot(
        shown.cycles.breakaway_t_s[inside],
        shown.cycles.breakaway_force_N[inside],
        color=_SLIP,
        marker="^" if second else "v",
        markerfacecolor="none" if second else _SLIP,
        linestyle="none",
        zorder=_ON_TOP,
        label=f"{counted(np.count_nonzero(inside), 'slip')}{whose}",
    )


def _shade(axes: Any, shown: _Shown, window_s: tuple[float, float], named: bool) -> None:
    """Colour the background by mode and mark the start of control if it is in the picture.

    `named`: with labels for the legend.
    """
    t_s, mode = shown.run.trace["t_ns"] * 1e-9, shown.run.trace["mode"]
    from_s, to_s = window_s
    inside = (t_s >= from_s) & (t_s <= to_s)
    t_s, mode = t_s[inside], mode[inside]
    if (
        from_s <= shown.verdict.enabled_from_s <= to_s
        and shown.verdict.enabled_from_s > 0.0
        and not shown.verdict.imported
    ):
        label = "controller takes over" if named else None
        axes.axvline(shown.verdict.enabled_from_s, color=_INK, linewidth=0.6, linestyle=":", label=label)
    if not len(mode):
        return
    edges = [0, *(np.flatnonzero(np.diff(mode.astype(int))) + 1).tolist(), len(mode) - 1]
    labelled: set[int] = set()
    for start, end in pairwise(edges):
        now = int(mode[start])
        if now in _SHADES and end > start:
            colour, words = _SHADES[now]
            label = words if named and now not in labelled else None
            labelled.add(now)
            axes.axvspan(t_s[start], t_s[end], color=colour, label=label, linewidth=0, zorder=0)


def _save(figure: Any, shown: Sequence[_Shown], out: Path, request: FigureRequest, made: Provenance) -> None:
    suffix = out.suffix.lower()
    metadata = made.metadata(suffix, "; ".join(log.name for log in shown))
    with mpl.rc_context(_rules(request.style == PAPER)), replacing(out) as file:
        figure.savefig(file, dpi=_DPI[request.style], format=suffix.removeprefix("."), metadata=metadata)
