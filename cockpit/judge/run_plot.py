"""A run as a picture: drive force, vibration against drive velocity, and what the controller did."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from bridge.files import replacing
from bridge.log.logfile import read_run
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge.verdict import RunVerdict, headline, judge_run

_SHADES: dict[int, str] = {wire.EXCITE: "#dcebd8", wire.WAIT: "#f2d694", wire.PROBE: "#d5e3f0", wire.STOPPED: "#f0d5d5"}
_NAMES: dict[int, str] = {
    wire.EXCITE: "vibrating",
    wire.WAIT: "waiting for re-stick",
    wire.PROBE: "probing",
    wire.STOPPED: "stopped",
}
_INK, _RED, _BLUE = "#1f2d3a", "#b5402a", "#2a6fb5"


def plot_run(path: Path, out: Path) -> RunVerdict:
    """Draw the run in a log to `out`, a .png, .svg or .pdf file; its figures.

    Raises Fault BAD_LOG, and OSError when `out` cannot be written.
    """
    from matplotlib.figure import Figure

    run = read_run(path)
    verdict = judge_run(run)
    t_s = run.sensors["t_ns"] * 1e-9
    force_N = run.sensors["drive_force_N"].mean(axis=1)
    trace = run.trace
    trace_s = trace["t_ns"] * 1e-9
    figure = Figure(figsize=(11, 6.4), layout="constrained")
    upper: Any
    lower: Any
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    figure.suptitle(headline(verdict), color=_INK)
    for axes in (upper, lower):
        _shade(axes, trace_s, trace["mode"])
        axes.margins(x=0)
        axes.spines[["top", "right"]].set_visible(False)
    upper.plot(t_s, force_N, color=_INK, linewidth=1.0)
    upper.set_ylabel("drive force F_d [N]")
    if upper.get_legend_handles_labels()[0]:
        upper.legend(loc="lower right", frameon=True)
    lower.plot(
        trace_s, 1e3 * trace["vibration_velocity_mps"], color=_BLUE, linewidth=1.2, label="v_a, vibration, measured"
    )
    lower.plot(trace_s, 1e3 * trace["drive_velocity_mps"], color=_RED, linewidth=1.2, label="v_d, drive, measured")
    lower.set_ylabel("velocity [mm/s]")
    lower.set_ylim(bottom=0.0)
    lower.set_xlabel("time [s]")
    lower.legend(handles=lower.lines, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False)
    with replacing(out) as file:
        figure.savefig(file, dpi=110, format=out.suffix.lower().removeprefix("."))
    return verdict


def _shade(axes: Any, t_s: Any, mode: Any) -> None:
    """Colour the background by mode, each mode once in the legend."""
    if not len(mode):
        return
    edges = [0, *(np.flatnonzero(np.diff(mode.astype(int))) + 1).tolist(), len(mode) - 1]
    named: set[int] = set()
    for start, end in pairwise(edges):
        now = int(mode[start])
        if now in _SHADES and end > start:
            label = None if now in named else _NAMES[now]
            named.add(now)
            axes.axvspan(t_s[start], t_s[end], color=_SHADES[now], label=label, linewidth=0)
