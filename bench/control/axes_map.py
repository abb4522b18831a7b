"""Map of the axes on which the controller works: stiffness over feed, a panel per noise, delays as lines, runs as points.

The area follows from the estimator's rule (`controller/estimate/contact.py`): a stick is seen in time where the window whose
slope has 12 sigma = v_d is shorter than the stick, 2 (F_s - F_c) / (k_d v_d). Stiffness and force noise are divided by the drop
of friction, so that one picture holds for small and large axes.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench.control.figures import Figures
from bench.control.scenario import BankScenario
from bridge.files import replacing
from bridge.provenance import provenance
from cockpit.run.scenario import load_rig
from plant.config import RigConfig

_SIGMAS, _HALF = 6.0, 0.5  # as in `controller.estimate.contact`: half of v_d exceeds 6 sigma in a window
_SHORTEST_S, _LONGEST_S = 4e-4, 1.0  # shortest and longest window of the estimator; each is twice the one before
_JUDGED_EVERY_S = 1e-3  # period in which the estimator judges the contact
_ROUNDED_UP = math.sqrt(2.0)  # mean factor from a needed length to the next longer window
_RATE_HZ = 2e4  # sample rate
_DELAYS_S = (0.01, 0.05)  # loop delays that the map shows as lines
_STROKE_M, _STROKE_HZ = 1e-7, 4500.0  # stroke of the paper's exciter, and the frequency at which it is used up
_RATIO = 1.2  # v_a / v_d that the stroke must allow
_FEEDS_MPS, _STIFFNESS_PER_M = (5e-8, 1e-2), (1e3, 1e7)  # ends of the axes; stiffness over the drop of friction
_LABEL_PER_M = 2e5  # stiffness over the drop of friction at which the lines have their labels
_CROWD_MM_PER_S = 0.4  # most runs have feeds near this value; names go on the emptier side
_OFF = 10.0  # time to see a stick over its duration, in place of infinity: far above the border at 1
_MACHINES = ("paper-c45-c45", "pneumatic-seal", "belt-axis", "ball-screw-axis")
_SEES, _BLIND, _INK = "#dcebd8", "#d5d8dc", "#1f2d3a"
_CLEAN, _MISSED, _REPORTS_BLIND, _HELPLESS = "clean", "slips or surges", "reports BLIND", "reports EXCITER_END"
_MARKS: dict[str, dict[str, Any]] = {
    _CLEAN: {"marker": "o", "color": "#1e8449", "s": 20, "linewidths": 0},
    _REPORTS_BLIND: {"marker": "s", "facecolors": "none", "color": "#17202a", "s": 70, "linewidths": 1.8},
    _HELPLESS: {"marker": "D", "facecolors": "none", "color": "#b9770e", "s": 80, "linewidths": 1.8},
    _MISSED: {"marker": "x", "color": "#c0392b", "s": 46, "linewidths": 2.0},
}


class Noise(NamedTuple):
    """White noise of a sample."""

    position_m: float  # noise of the slide position
    force_share: float  # noise of the force over the drop of friction

    def sigma_m(self, stiffness_per_m: Any) -> Any:
        """Noise of the slide's position from two sources: position, and force over k_d, weighted by their noise.

        Args:
            stiffness_per_m: k_d over the drop of friction.

        """
        force_m = self.force_share / stiffness_per_m
        return 1.0 / np.sqrt(1.0 / self.position_m**2 + 1.0 / force_m**2)


_PANELS = (
    (Noise(5e-7, 0.01), "quiet: position 0.5 µm, force 1 % of F_s − F_c"),
    (Noise(2.5e-6, 0.05), "five times the noise: 2.5 µm, 5 %"),
    (Noise(2e-5, 2.0), "useless force: 20 µm, 200 %"),
)


class Point(NamedTuple):
    """A run of the controller on the bank."""

    name: str
    panel: int
    stiffness_per_m: float
    slowest_mps: float
    fastest_mps: float
    outcome: str


_STIFFNESS, _FEED = Point._fields.index("stiffness_per_m"), Point._fields.index("slowest_mps")


def needed_window_s(sigma_m: Any, feed_mps: Any, rate_Hz: float = _RATE_HZ) -> Any:
    """Length T of a window in which half of v_d is 6 sigma of its slope, whose variance is 12 sigma^2 / (rate T^3)."""
    return (12.0 * (_SIGMAS / _HALF * sigma_m / feed_mps) ** 2 / rate_Hz) ** (1.0 / 3.0)


def window_s(sigma_m: Any, feed_mps: Any) -> Any:
    """Mean length of the estimator's shortest window that is long enough; infinite if it exceeds the longest window."""
    needed_s = needed_window_s(sigma_m, feed_mps)
    return np.where(needed_s > _LONGEST_S, np.inf, np.maximum(_ROUNDED_UP * needed_s, _SHORTEST_S))


def stick_s(stiffness_per_m: Any, feed_mps: Any) -> Any:
    """Duration of a stick, in which the drive winds up the spring by twice the drop of friction."""
    return 2.0 / (stiffness_per_m * feed_mps)


def points(bank: Sequence[BankScenario], runs: Sequence[Figures]) -> list[Point]:
    """The runs of the controller on axes whose friction drops, each in the panel with the most similar noise."""
    scenarios = {scenario.name: scenario for scenario in bank}
    return [
        _point(scenarios[run.scenario], run)
        for run in runs
        if run.expect != "not-needed" and _drop_N(scenarios[run.scenario].rig) > 0.0
    ]


def _point(scenario: BankScenario, run: Figures) -> Point:
    rig = scenario.rig
    stiffness_per_m = rig.drive.stiffness_N_per_m / _drop_N(rig)
    own_m = _noise(rig).sigma_m(stiffness_per_m)
    away = [abs(math.log(own_m / noise.sigma_m(stiffness_per_m))) for noise, _ in _PANELS]
    fastest_mps = max(rig.drive.speeds_mps(), default=scenario.slowest_mps)
    return Point(
        scenario.name, away.index(min(away)), stiffness_per_m, scenario.slowest_mps, fastest_mps, _outcome(run)
    )


def _outcome(run: Figures) -> str:
    if run.expect == "helped":
        return _MISSED if run.slips + run.surges else _REPORTS_BLIND if run.blind_share > 0.5 else _CLEAN
    if run.expect == "cannot-help":
        return _HELPLESS if "EXCITER_END" in run.words else _MISSED
    return _REPORTS_BLIND if "BLIND" in run.words else _MISSED if run.slips + run.surges else _CLEAN


def _drop_N(rig: RigConfig) -> float:
    return rig.contact.static_force_N - rig.contact.coulomb_force_N


def _noise(rig: RigConfig) -> Noise:
    sensors, spread = rig.sensors, 1.0 / math.sqrt(12.0)
    position_m = math.hypot(sensors.position_noise_m, spread * sensors.position_resolution_m)
    force_N = math.hypot(sensors.force_noise_N, spread * sensors.force_resolution_N)
    return Noise(position_m, force_N / _drop_N(rig))


def draw(bank: Sequence[BankScenario], runs: Sequence[Figures], path: Path) -> None:
    """Draw the picture, a .png, .svg or .pdf file. Raises OSError where it cannot be written.

    Args:
        bank: the scenarios.
        runs: the controller's runs of them.

    """
    import matplotlib as mpl
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure = Figure(figsize=(15, 7.6), layout=ConstrainedLayoutEngine(rect=(0.0, 0.1, 1.0, 0.9)))
    every: Any = figure.subplots(1, len(_PANELS), sharex=True, sharey=True)
    shown = points(bank, runs)
    for number, (axes, (noise, title)) in enumerate(zip(every, _PANELS, strict=True)):
        _areas(axes, noise)
        _machines(axes)
        _runs(axes, [point for point in shown if point.panel == number])
        axes.set_title(title, loc="left", fontsize=11)
        axes.set_xlabel("feed v_d [mm/s]")
    every[0].set_ylabel("stiffness over the drop of friction, k_d / (F_s − F_c)  [N/µm per N]")
    _legend(figure, every[0])
    made = provenance()
    figure.text(0.005, 0.008, made.in_words(), fontsize=5.5, color="#7f8c8d", wrap=True)
    suffix = path.suffix.lower()
    with mpl.rc_context({"svg.hashsalt": "stickslip"}), replacing(path) as file:
        metadata = made.metadata(suffix, "for which axes it works")
        figure.savefig(file, dpi=110, format=suffix.removeprefix("."), metadata=metadata)
    if suffix == ".png":
        reduce_colours(path)


def reduce_colours(picture: Path) -> None:
    """Rewrite a .png with 64 colours, at a third of its size; its texts stay. Raises OSError where it cannot be written."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    with Image.open(picture) as image:
        few, dpi, texts = image.convert("RGB").quantize(64, dither=Image.Dither.NONE), image.info.get("dpi"), PngInfo()
        for key, text in image.info.items():
            if isinstance(key, str) and isinstance(text, str):
                texts.add_text(key, text)
    with replacing(picture) as file:
        few.save(file, format="PNG", optimize=True, dpi=dpi, pnginfo=texts)


def _areas(axes: Any, noise: Noise) -> None:
    """Draw where a stick is seen in time, where late commands miss the first slip, and where the stroke ends."""
    feed_mps = np.geomspace(*_FEEDS_MPS, 300)
    stiffness_per_m = np.geomspace(*_STIFFNESS_PER_M, 240)[:, None]
    seen_s = window_s(noise.sigma_m(stiffness_per_m), feed_mps) + _JUDGED_EVERY_S
    lasts_s = stick_s(stiffness_per_m, feed_mps)
    x, y = feed_mps * 1e3, stiffness_per_m[:, 0] * 1e-6
    axes.set_facecolor(_SEES)
    axes.contourf(x, y, np.minimum(seen_s / lasts_s, _OFF), levels=[1.0, _OFF], colors=[_BLIND])
    for delay_s, side, place in zip(_DELAYS_S, ("left", "right"), (1.05, 0.95), strict=True):
        left_s = lasts_s - seen_s - delay_s
        axes.contour(
            x,
            y,
            np.where(np.isfinite(left_s), left_s, np.nan),
            levels=[0.0],
            colors=_INK,
            linewidths=1.0,
            linestyles="--",
        )
        at = int(np.argmin(np.abs(stiffness_per_m[:, 0] - _LABEL_PER_M)))
        style = {"fontsize": 8, "rotation": -62, "ha": side, "va": "center", "color": _INK}
        axes.text(x[np.flatnonzero(left_s[at] > 0.0)[-1]] * place, y[at], f"{1e3 * delay_s:.0f} ms late", **style)
    most_mm_per_s = 2e3 * math.pi * _STROKE_HZ * _STROKE_M / _RATIO
    axes.axvline(most_mm_per_s, color="#2a6fb5", linewidth=1.0, linestyle=":")
    text = f"{_STROKE_M * 1e6:g} µm at {_STROKE_HZ:.0f} Hz"
    axes.text(most_mm_per_s, y[0] * 1.15, text, rotation=90, fontsize=7, color="#2a6fb5", ha="right", va="bottom")
    axes.set(xscale="log", yscale="log", xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")


def _machines(axes: Any) -> None:
    """Draw the stiffness of some rigs of deploy/rigs at the left edge."""
    for name in _MACHINES:
        rig = load_rig(name, [])
        y = rig.drive.stiffness_N_per_m / _drop_N(rig) * 1e-6
        axes.axhline(y, xmax=0.05, color="#7f8c8d", linewidth=1.0)
        axes.text(_FEEDS_MPS[0] * 1.25e3, y * 1.06, name, fontsize=8, color="#566573", va="bottom")


def _runs(axes: Any, shown: list[Point]) -> None:
    """Draw the runs: one mark with a count for equal results at one place; failed runs by name."""
    places: dict[tuple[float, float], dict[str, list[Point]]] = {}
    for point in shown:
        place = round(math.log10(point.slowest_mps), 1), round(math.log10(point.stiffness_per_m), 1)
        places.setdefault(place, {}).setdefault(point.outcome, []).append(point)
    for groups in places.values():
        every = [point for group in groups.values() for point in group]
        x, y = (float(np.exp(np.mean(np.log([point[i] for point in every])))) for i in (_FEED, _STIFFNESS))
        x, y = 1e3 * x, 1e-6 * y
        fastest_mps = max(point.fastest_mps for point in every)
        if 1e3 * fastest_mps > 1.3 * x:
            axes.plot([x, 1e3 * fastest_mps], [y, y], color=_INK, linewidth=0.5, alpha=0.4)
        for outcome in (outcome for outcome in _MARKS if outcome in groups):
            axes.scatter([x], [y], zorder=4, **_MARKS[outcome])
            _label(axes, x, y, outcome, [point.name for point in groups[outcome]])


def _label(axes: Any, x: float, y: float, outcome: str, names: list[str]) -> None:
    """Write the number of runs at a mark, or the names of failed runs, two per line."""
    style: dict[str, Any] = {
        "fontsize": 7,
        "color": _MARKS[outcome]["color"],
        "zorder": 5,
        "textcoords": "offset points",
    }
    if outcome == _MISSED and len(names) > 2:
        line = {"arrowstyle": "-", "color": style["color"], "linewidth": 0.7, "relpos": (1.0, 1.0)}
        lines = [", ".join(names[i : i + 2]) for i in range(0, len(names), 2)]
        axes.annotate("\n".join(lines), (x, y), (-60.0, -20.0), ha="right", va="top", arrowprops=line, **style)
    elif outcome == _MISSED:
        place = (
            {"xytext": (-4.0, -9.0), "ha": "right"} if x < _CROWD_MM_PER_S else {"xytext": (4.0, -9.0), "ha": "left"}
        )
        axes.annotate(", ".join(names), (x, y), **place, **style)
    elif len(names) > 1:
        axes.annotate(str(len(names)), (x, y), (0.0, 6.0), ha="center", **style)


def _legend(figure: Any, axes: Any) -> None:
    from matplotlib.patches import Patch

    handles = [
        Patch(fc=_SEES, label="a stick is seen before it ends"),
        Patch(fc=_BLIND, label="it is not: BLIND, vibrates while the drive moves"),
        axes.plot([], [], "--", color=_INK, linewidth=1.0, label="above: commands so late come after the first slip")[
            0
        ],
        axes.plot([], [], ":", color="#2a6fb5", linewidth=1.0, label="right: the stroke does not reach 1.2 v_d")[0],
        *(axes.scatter([], [], label=f"run of the bank: {outcome}", **mark) for outcome, mark in _MARKS.items()),
    ]
    figure.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 0.02), ncols=4, frameon=False, fontsize=9)
