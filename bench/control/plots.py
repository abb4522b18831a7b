"""A failed run as a picture: the whole run on the left, where it first went wrong on the right."""

from itertools import pairwise
from typing import Any

import numpy as np

from bench.control.record import BLOCK_ROWS
from bench.control.run import Curves, Judged
from bridge.pages import png
from bridge.wire.stickslip_pb2 import EXCITE, PROBE, STICK

_INK, _RED, _BLUE, _GREEN, _PURPLE = "#1f2d3a", "#b5402a", "#2a6fb5", "#2e7d32", "#8e44ad"
_SHADES: dict[int, str] = {EXCITE: "#dcebd8", PROBE: "#d5e3f0"}
_FORCE, _SPEED, _DRIVE, _V_A, _STATE, _MODE = range(len(BLOCK_ROWS))
# Time shown around a failure: longest, shortest, and as a multiple of the failure's duration.
_DETAIL_S, _LEAST_DETAIL_S, _DETAIL_LENGTHS = 0.5, 0.1, 12.0


def picture(judged: Judged, at_s: float, length_s: float, oracle: Curves | None) -> str:
    """A PNG of a run, in base64.

    Args:
        at_s: begin of the first failure, which the right side shows.
        length_s: its duration.
        oracle: curves of the oracle at that time; None: it was not run.

    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 3.6), layout="constrained")
    axes: Any = figure.subplots(2, 2, sharex="col", height_ratios=[1, 1])
    parts = [part for part in judged.kept if part.begin_s <= at_s < part.begin_s + len(part.rows) * part.step_s]
    shown_s = min(max(_DETAIL_LENGTHS * length_s, _LEAST_DETAIL_S), _DETAIL_S)
    detail = _around(parts[0], at_s, shown_s) if parts else (judged.kept or [judged.coarse])[0]
    for column, curves in enumerate((judged.coarse, detail)):
        t_s = curves.begin_s + curves.step_s * (np.arange(len(curves.rows)) + 1)
        upper, lower = axes[0][column], axes[1][column]
        for each in (upper, lower):
            _shade(each, t_s, curves.rows[:, _MODE])
            each.margins(x=0)
            each.spines[["top", "right"]].set_visible(False)
        upper.plot(t_s, curves.rows[:, _FORCE], color=_INK, linewidth=0.9)
        stuck = np.where(curves.rows[:, _STATE] == STICK, curves.rows[:, _FORCE], np.nan)
        upper.plot(t_s, stuck, color=_RED, linewidth=1.6, label="reported STICK")
        lower.plot(t_s, 1e3 * curves.rows[:, _SPEED], color=_INK, linewidth=0.8, label="slide")
        lower.plot(t_s, 1e3 * curves.rows[:, _DRIVE], color=_GREEN, linewidth=1.0, label="drive")
        lower.plot(t_s, 1e3 * curves.rows[:, _V_A], color=_BLUE, linewidth=1.0, label="v_a")
        if column == 1 and oracle is not None:
            oracle_curves = _around(oracle, at_s, shown_s)
            oracle_s = oracle_curves.begin_s + oracle_curves.step_s * (np.arange(len(oracle_curves.rows)) + 1)
            style = {"color": _PURPLE, "linewidth": 1.2, "linestyle": "--", "label": "slide, oracle"}
            lower.plot(oracle_s, 1e3 * oracle_curves.rows[:, _SPEED], **style)
        for each in (upper, lower):
            each.axvline(at_s, color=_RED, linewidth=0.8, linestyle=":")
        lower.set_xlabel("time [s]")
    axes[0][0].set_ylabel("F_d [N]")
    axes[1][0].set_ylabel("[mm/s]")
    axes[0][1].legend(loc="best", fontsize=7, frameon=False)
    axes[1][1].legend(loc="best", fontsize=7, frameon=False, ncols=4)
    return png(figure, 75)


def _around(curves: Curves, at_s: float, length_s: float) -> Curves:
    """The part of the curves around a time, `length_s` long."""
    first = max(int((at_s - 0.5 * length_s - curves.begin_s) / curves.step_s), 0)
    rows = curves.rows[first : first + max(int(length_s / curves.step_s), 20)]
    return Curves(curves.begin_s + first * curves.step_s, curves.step_s, rows)


def _shade(axes: Any, t_s: Any, mode: Any) -> None:
    """Colour the background where the controller excites or probes."""
    if len(t_s) == 0:
        return
    edges = [0, *(np.flatnonzero(np.diff(mode)) + 1), len(mode) - 1]
    for first, last in pairwise(edges):
        if (shade := _SHADES.get(int(mode[first]))) is not None:
            axes.axvspan(t_s[first], t_s[last], color=shade, linewidth=0)
