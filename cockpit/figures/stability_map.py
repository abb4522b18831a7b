"""Stability of a rig as a picture: where it sticks and slips, and how much vibration removes stick-slip."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from bridge.faults import Fault
from bridge.files import replacing
from bridge.provenance import Provenance, provenance
from plant.config import RigConfig
from plant.stability import (
    Floats,
    critical_velocity_mps,
    hurwitz_margin,
    self_sustained_velocity_mps,
    stabilising_vibration_mps,
    with_constant_effects,
)
from plant.stability import stability_map as growth_map

_RED, _AMBER, _GREEN, _INK = "#d9826b", "#f2d694", "#dcebd8", "#1f2d3a"
_KINDS = (
    (2, _RED, "unstable: stick-slip"),
    (1, _AMBER, "smooth if undisturbed; stick-slip that has started can go on"),
    (0, _GREEN, "stable: smooth sliding"),
)
_RATIO_SET_POINT = 1.2  # the controller's default set point of v_a / v_d


class MapResult(NamedTuple):
    """Numbers behind the picture, SI, for JSON. None: no such value exists."""

    picture: str
    drive_velocity_mps: float
    drive_stiffness_N_per_m: float
    stable_without_vibration: bool
    growth_per_s: float  # largest real part of the poles at the operating point, without vibration
    smallest_vibration_velocity_mps: float | None  # least v_a with stable sliding; None: not stable up to 5 v_d
    # least v_a that also ends stick-slip that has started; 0 if no vibration is needed
    removing_vibration_velocity_mps: float | None
    critical_velocity_mps: float | None  # None: steady sliding is unstable at every velocity
    self_sustained_velocity_mps: float | None  # None: stick-slip that has started never ends
    left_out: tuple[str, ...]  # effects of the rig outside this theory
    answer: str


def stability_map(rig: RigConfig, out: Path, files: Iterable[Path] = ()) -> MapResult:
    """Draw the map of `rig`, which comes from `files`, to `out`, a .png, .svg or .pdf file, and return its numbers.

    The operating point is the velocity of the drive's profile that needs the most vibration: the highest, or with a damped
    drive, which is unstable at low velocities, possibly a lower one. Raises Fault CONFIG if the drive never moves, and
    OSError if `out` cannot be written.
    """
    effects, nominal = rig.effects, rig.model_copy(update={"effects": {}})
    alone = {name: with_constant_effects(rig.model_copy(update={"effects": {name: effects[name]}})) for name in effects}
    rig = with_constant_effects(rig)
    velocities_mps = rig.drive.speeds_mps()
    if not velocities_mps:
        raise Fault("CONFIG", f"{rig.name}: drive: it never moves; give it a velocity other than 0")
    sustained_mps = float(self_sustained_velocity_mps(rig))

    def needs_mps(velocity_mps: float) -> tuple[float, float]:
        smallest_mps = stabilising_vibration_mps(rig, velocity_mps)
        floor_mps = velocity_mps if velocity_mps < sustained_mps else 0.0
        return math.inf if smallest_mps is None else max(smallest_mps, floor_mps), velocity_mps

    removing_mps, v_d = max(map(needs_mps, velocities_mps))
    smallest_mps = stabilising_vibration_mps(rig, v_d)
    numbers = MapResult(
        picture=str(out),
        drive_velocity_mps=v_d,
        drive_stiffness_N_per_m=rig.drive.stiffness_N_per_m,
        stable_without_vibration=bool(hurwitz_margin(rig, v_d) >= 0.0),
        growth_per_s=float(growth_map(rig, v_d)),
        smallest_vibration_velocity_mps=smallest_mps,
        removing_vibration_velocity_mps=removing_mps if math.isfinite(removing_mps) else None,
        critical_velocity_mps=critical_velocity_mps(rig),
        self_sustained_velocity_mps=sustained_mps if math.isfinite(sustained_mps) else None,
        left_out=tuple(name for name, changed in alone.items() if changed == nominal),
        answer="",
    )
    result = numbers._replace(answer=_answer(rig.name, numbers))
    _draw(rig, result, out, provenance(files))
    return result


def _answer(name: str, result: MapResult) -> str:
    """Two sentences: behaviour at the operating point, and the critical drive velocity."""
    v_d, critical, sustained = (
        result.drive_velocity_mps,
        result.critical_velocity_mps,
        result.self_sustained_velocity_mps,
    )
    text = f"{name} at {_mm(v_d)} mm/s: "
    vibration = result.removing_vibration_velocity_mps
    remedy = "no vibration" if vibration is None else f"{_mm(vibration)} mm/s of vibration or more"
    if not result.stable_without_vibration:
        text += f"stick-slip without vibration; {remedy} removes it"
    elif sustained is None or v_d < sustained:
        text += f"a start at rest ends in stick-slip, though steady sliding is stable; {remedy} removes it"
    else:
        text += "no stick-slip, no vibration needed"
    if result.left_out:
        text += f".\nNot in this theory, and left out: {', '.join(result.left_out)}"
    if critical is None:
        return f"{text}.\nNo drive velocity is fast enough: the drive has no damping."
    if critical == 0.0:
        return f"{text}.\nSteady sliding is stable at every drive velocity."
    return f"{text}.\nCritical velocity {_mm(critical)} mm/s."


def _mm(velocity_mps: float) -> str:
    return f"{velocity_mps * 1e3:.3g}"


def _draw(rig: RigConfig, result: MapResult, out: Path, made: Provenance) -> None:
    figure = Figure(figsize=(12.5, 6.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    _draw_without_vibration(left, rig, result)
    _draw_with_vibration(right, rig, result)
    figure.suptitle(result.answer, fontsize=13, color=_INK)
    figure.supxlabel(made.in_words(), fontsize=6, color="#808b96", x=0.01, ha="left", parse_math=False)
    suffix = out.suffix.lower()
    with mpl.rc_context({"svg.hashsalt": "stickslip"}), replacing(out) as file:
        figure.savefig(file, dpi=120, format=suffix.removeprefix("."), metadata=made.metadata(suffix, "stability map"))


def _draw_without_vibration(axes: Any, rig: RigConfig, result: MapResult) -> None:
    v_d, k_d = result.drive_velocity_mps, result.drive_stiffness_N_per_m
    v_s = rig.contact.stribeck_velocity_mps
    # 20 v_s: beyond 27 v_s the slope of friction is 0 in double precision and an undamped rig would look stable
    velocity_mps = np.geomspace(min(v_d, v_s) / 20.0, max(v_d * 3.0, v_s * 20.0), 300)
    stiffness = np.geomspace(k_d / 30.0, k_d * 30.0, 201)
    grid = (velocity_mps, stiffness[:, None])
    unstable = hurwitz_margin(rig, *grid) < 0.0
    sustained = grid[0] < self_sustained_velocity_mps(rig, grid[1])
    areas = _regions(axes, velocity_mps * 1e3, stiffness * 1e-3, unstable, sustained)
    if result.critical_velocity_mps is None:
        # unstable at every velocity: draw lines of slow growth in place of a border
        growth_per_s = growth_map(rig, *grid)
        for level_per_s, style in ((1.0, "-"), (1e-3, "--")):
            axes.contour(
                velocity_mps * 1e3, stiffness * 1e-3, growth_per_s,
                levels=[level_per_s], colors="white", linestyles=style, linewidths=1.5,
            )  # fmt: skip
            label = f"white: to the right a disturbance takes over {1.0 / level_per_s:.0f} s to grow e-fold"
            axes.plot([], [], color="#b0b0b0", ls=style, label=label)
    elif result.critical_velocity_mps > 0.0:
        label = f"critical velocity at the rig's k_d: {_mm(result.critical_velocity_mps)} mm/s"
        axes.axvline(result.critical_velocity_mps * 1e3, color=_INK, lw=1.8, label=label)
    _operating_point(axes, v_d * 1e3, k_d * 1e-3, f"this rig: {_mm(v_d)} mm/s, {k_d * 1e-3:.3g} N/mm")
    axes.set(xscale="log", yscale="log", ylabel="drive stiffness k_d [N/mm]")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    axes.set_title("Without vibration", loc="left", fontsize=11)
    _finish(axes, areas)


def _draw_with_vibration(axes: Any, rig: RigConfig, result: MapResult) -> None:
    v_d = result.drive_velocity_mps
    removing = result.removing_vibration_velocity_mps
    top_mps = 2.5 * v_d
    velocity_mps = np.linspace(top_mps / 360.0, top_mps, 360)
    vibration_mps = np.linspace(0.0, top_mps, 361)
    unstable = hurwitz_margin(rig, velocity_mps, None, vibration_mps[:, None]) < 0.0
    # v_a = v_d ends started stick-slip; slightly less leaves a swing of 0.2 to 0.5 N on the paper's rig
    sustained = (velocity_mps < self_sustained_velocity_mps(rig)) & (vibration_mps[:, None] < velocity_mps)
    areas = _regions(axes, velocity_mps * 1e3, vibration_mps * 1e3, unstable, sustained)
    line_mm = np.array([0.0, top_mps * 1e3])
    axes.plot(line_mm, line_mm, color=_INK, lw=1.2, ls="--", label="v_a = v_d")
    set_point = f"v_a = {_RATIO_SET_POINT} v_d, a set point with margin"
    axes.plot(line_mm, _RATIO_SET_POINT * line_mm, color=_INK, lw=1.2, ls=":", label=set_point)
    if removing:
        axes.plot(
            [v_d * 1e3] * 2, [0.0, removing * 1e3], color=_INK, lw=2.0, ls="-", marker="_", ms=10,
            label=f"at {_mm(v_d)} mm/s: {_mm(removing)} mm/s of vibration or more removes stick-slip",
        )  # fmt: skip
    _operating_point(axes, v_d * 1e3, 0.0, f"this rig, vibration off: {_mm(v_d)} mm/s")
    axes.set(xlim=(0.0, line_mm[1]), ylim=(0.0, line_mm[1]), ylabel="vibration velocity amplitude v_a [mm/s]")
    axes.set_title("With vibration well above the contact resonance", loc="left", fontsize=11)
    _finish(axes, areas)


def _regions(axes: Any, x: Floats, y: Floats, unstable: Any, sustained: Any) -> list[Any]:
    """Colour the regions; returns a legend entry for each visible region."""
    kind = np.where(unstable, 2, np.where(sustained, 1, 0))
    axes.pcolormesh(x, y, kind, cmap=ListedColormap([_GREEN, _AMBER, _RED]), vmin=0, vmax=2, shading="nearest")
    return [Patch(fc=color, label=label) for number, color, label in _KINDS if (kind == number).any()]


def _operating_point(axes: Any, x: float, y: float, label: str) -> None:
    axes.plot([x], [y], "o", ms=10, mfc="white", mec=_INK, mew=2.0, label=label, clip_on=False, zorder=5, ls="")


def _finish(axes: Any, areas: list[Any]) -> None:
    handles, _ = axes.get_legend_handles_labels()
    axes.set_xlabel("drive velocity v_d [mm/s]")
    axes.legend(handles=[*areas, *handles], loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False, fontsize=9)
