"""The paper's Figures 2-4 and 6-9 from the simulated runs, as PNG pictures inside the page."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from bridge.pages import png
from cockpit.paper.runs import DRIVE_VELOCITY_MPS, FREQUENCIES_HZ, Key, PairRun, vibration_velocity_mps

_FORCE, _SLIDE, _DRIVE = "#1b4f72", "#b03a2e", "#808b96"


class PageFigure(NamedTuple):
    """One figure of the page: `png` is base64."""

    title: str
    caption: str
    png: str


def figures(runs: Mapping[Key, PairRun]) -> list[PageFigure]:
    """Every figure of the page, in the paper's order."""
    pairs = ("C45-C45 @ 0.063", "C45-GGG40 @ 0.063", "C45-PTFE @ 0.063")
    return [
        _over_time(
            "Figure 2: without vibration",
            "Drive force F_d, position of the slide x and of the drive s_d at 0.063 N/mm². "
            "Steel and cast iron stick and slip; PTFE slides evenly.",
            [(runs[pair, 0], pair.split(" @ ")[0]) for pair in pairs],
            (0.0, 16.0),
            4.6,
        ),
        *(
            _over_time(
                f"Figure {number}: {pair} N/mm², 0 to 5 kHz",
                "The four seconds after the vibration starts at t = 8 s, with the same seconds without it on the "
                "left. The swing of F_d and the steps of x shrink from left to right; from 4 kHz on both vanish.",
                [(runs[pair, frequency_Hz], _at(frequency_Hz, "\n")) for frequency_Hz in FREQUENCIES_HZ],
                (8.0, 12.0),
                5.0,
            )
            for number, pair in (("3", "C45-C45 @ 0.063"), ("4", "C45-C45 @ 0.104"))
        ),
        *(
            _over_time(
                f"Figure {number}: {pair} N/mm² at 1 and 3 kHz",
                "The whole run. The vibration starts at the dotted line.",
                [(runs[pair, frequency_Hz], _at(frequency_Hz, ", ")) for frequency_Hz in (1000, 3000)],
                (0.0, 16.0),
                4.8,
                starts_s=8.0,
            )
            for number, pair in (("6", "C45-C45 @ 0.063"), ("7", "C45-GGG40 @ 0.063"))
        ),
        *(_against_frequency(runs, number, material) for number, material in (("8", "C45-C45"), ("9", "C45-GGG40"))),
    ]


def _over_time(
    title: str,
    caption: str,
    columns: Sequence[tuple[PairRun, str]],
    window_s: tuple[float, float],
    height_in: float,
    starts_s: float | None = None,
) -> PageFigure:
    """Force above positions, a column for each run with its title; a dotted line at the start of the vibration."""
    figure, axes = _grid(2, len(columns), height_in)
    for (force, position), (run, name) in zip(axes.T, columns, strict=True):
        course = run.course
        part = slice(*np.searchsorted(course.t_s, window_s))
        t_s = course.t_s[part]
        force.plot(t_s, course.drive_force_N[part], color=_FORCE, linewidth=0.9)
        position.plot(t_s, course.drive_position_m[part] * 1e3, color=_DRIVE, linewidth=0.9, label="drive s_d")
        position.plot(t_s, course.position_m[part] * 1e3, color=_SLIDE, linewidth=0.9, label="slide x")
        force.set_title(name, fontsize=9)
        force.set_xlim(*window_s)
        position.set_xlabel("time t [s]")
        for axis in (force, position) if starts_s is not None else ():
            axis.axvline(starts_s, color="black", linewidth=0.8, linestyle=":")
    axes[0, 0].set_ylabel("drive force F_d [N]")
    axes[1, 0].set_ylabel("position [mm]")
    axes[1, 0].legend(frameon=False, fontsize=8)
    return PageFigure(title, caption, _png(figure))


def _against_frequency(runs: Mapping[Key, PairRun], number: str, material: str) -> PageFigure:
    figure, axes = _grid(1, 2, 3.2, share_y=False)
    f_kHz = np.array(FREQUENCIES_HZ) / 1000.0
    for axis, pressure in zip(axes[0], ("0.063", "0.104"), strict=True):
        at = [runs[f"{material} @ {pressure}", f].mean for f in FREQUENCIES_HZ]
        # without slips the largest and the smallest force are both the force of even sliding
        high_N = [m.settled_force_N if np.isnan(m.force_max_N) else m.force_max_N for m in at]
        low_N = [m.settled_force_N if np.isnan(m.force_min_N) else m.force_min_N for m in at]
        axis.plot(f_kHz, high_N, "o-", color=_SLIDE, label="F_d max")
        axis.plot(f_kHz, low_N, "s-", color=_FORCE, label="F_d min")
        axis.fill_between(f_kHz, low_N, high_N, color=_FORCE, alpha=0.08)
        edge_kHz = DRIVE_VELOCITY_MPS / vibration_velocity_mps(1000.0)
        axis.axvline(edge_kHz, color="black", linewidth=0.8, linestyle=":")
        axis.set_title(f"p_n = {pressure} N/mm²", fontsize=9)
        axis.set_xlabel("vibration frequency f [kHz]")
        axis.set_ylabel("drive force F_d [N]")
        axis.legend(frameon=False)
    return PageFigure(
        f"Figure {number}: {material}, largest and smallest drive force against frequency",
        "Means over the cycles of t = 10.5-20 s. To the right of the dotted line v_a exceeds v_d: the two "
        "curves meet, and the force falls further.",
        _png(figure),
    )


def _at(frequency_Hz: int, separator: str) -> str:
    if frequency_Hz == 0:
        return f"no vibration{separator}v_a = 0"
    return f"{frequency_Hz // 1000} kHz{separator}v_a = {vibration_velocity_mps(frequency_Hz) * 1e3:.3f} mm/s"


def _grid(rows: int, columns: int, height_in: float, share_y: bool = True) -> tuple[Figure, Any]:
    figure = Figure(figsize=(11.0, height_in), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=share_y, sharey="row" if share_y else False, squeeze=False)
    return figure, axes


def _png(figure: Figure) -> str:
    for axis in figure.axes:
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=8)
    return png(figure, 120)
