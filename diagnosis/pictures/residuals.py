"""Residuals of a run, 0 where the rig is as described, and the variables that could explain them; no fit, no simulation.

A residual that is not 0 shows which part of the rig or of the measurement differs from its description. The variable over which
it differs shows the effect.
"""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import scales_of
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.hypotheses.catalogue import BREAKAWAY
from diagnosis.latent.axis_rows import described_N
from diagnosis.model.sensor_chain import low_pass
from diagnosis.pictures.cycles import slips_of
from diagnosis.relations.exciter import delivered_log, pieces_of_vibration, row_means
from diagnosis.relations.relation import kept_blocks
from diagnosis.relations.shapes import bend, rate
from diagnosis.relations.spring import NEEDED

# Standard deviation of the smoothing, as a share of a slip. Too small: noise of the second derivative; too large: slips are cut.
# 0.14 is 5 ms on the paper's spring, where a slip keeps 90 % of its acceleration.
_SMOOTH_SHARE = 0.14
_SMOOTH_FREE = 5.0  # standard deviation with a force drive [blocks], where no slip gives a time scale
_FIRST_SHARE = 0.4  # share of this smoothing for a first derivative, which needs less
_SLOW_S = 0.08  # time constant of a high-pass at 2 Hz: accelerometers may begin at 0.5 Hz
# lowest speed at which the friction law holds, in Stribeck velocities; below, presliding sets the force
_SLIDES_FROM = 2.0
_EDGE_MARGIN = 3.0  # distance from the edges of a slip, in standard deviations of the smoothing
_FEWEST_OF_PATH = 100  # fewest blocks of a segment whose path of the drive is compared
_WITHOUT_VIBRATION = ("curvature", "motion", "friction")  # residuals that a vibration disturbs


class Residual(NamedTuple):
    """A residual of one run, [points], and its variables by name with unit, [points] each."""

    values: Floats
    over: dict[str, Floats]


def residual_of(name: str, rig: RigTable, run: Prepared) -> Residual | None:
    """The residual `name` of a run; None where its channels are missing. `rig` should hold the numbers of the baseline."""
    try:
        over = _variables(rig, run)
        if name == BREAKAWAY:
            return _breakaway(rig, run, over)
        if name == "exciter":
            return _exciter(run, over)
        values = _OF_BLOCKS[name](rig, run, over)
    except KeyError:  # the run lacks a channel
        return None
    kept = kept_blocks(run) & np.isfinite(values)
    if name in _WITHOUT_VIBRATION:
        kept &= run.commands.frequency_Hz == 0.0
    return Residual(values[kept], {variable: column[kept] for variable, column in over.items()})


def _variables(rig: RigTable, run: Prepared) -> dict[str, Floats]:
    """Variables over which a residual can be drawn, by name with unit, [blocks] each, as far as the channels give them."""
    signals, smooth = run.signals, _FIRST_SHARE * _smoothing_blocks(rig)
    over: dict[str, Floats] = {
        "time_s": (np.arange(len(run.commands.drive)) + 0.5) * BLOCK_S,
        "frequency_Hz": run.commands.frequency_Hz,
    }
    if "drive_force_N" in signals:
        over["force_N"] = signals["drive_force_N"]
    if "mass_accel_mps2" in signals:
        over["acceleration_mps2"] = gaussian_filter1d(signals["mass_accel_mps2"], smooth)
    stiffness = rig.drive_stiffness_N_per_m
    position_m, drive_m = signals.get("mass_position_m"), signals.get("drive_position_m")
    if stiffness is not None:
        drive_m = np.cumsum(run.commands.drive) * BLOCK_S if drive_m is None else drive_m
        over["drive_position_m"] = drive_m
        if "force_N" in over:
            position_m = drive_m - over["force_N"] / stiffness if position_m is None else position_m
            # the zero of the extension is unknown, and chosen so that the spring law holds on average
            extension_m = drive_m - position_m
            over["extension_m"] = extension_m - extension_m.mean() + over["force_N"].mean() / stiffness
            over["extension_rate_mps"] = rate(gaussian_filter1d(extension_m, smooth))
    if position_m is not None:
        over |= {"position_m": position_m, "velocity_mps": rate(gaussian_filter1d(position_m, smooth))}
    return over


def _breakaway(rig: RigTable, run: Prepared, over: dict[str, Floats]) -> Residual | None:
    """Breakaway forces less the rig's static friction [N], [breakaways].

    Segments under vibration are left out, as vibration lowers the breakaway force.
    """
    rows: list[tuple[float, ...]] = []  # block, dwell and direction of each breakaway
    for segment in run.commands.segments:
        if segment.frequency_Hz == 0.0 and segment.drive_velocity_mps != 0.0:
            slips = slips_of(run.signals, segment, scales_of(rig))
            # the dwell before the first breakaway begins before the segment, so this breakaway is left out
            ends = zip(slips.bottoms[:-1].tolist(), slips.tops[1:].tolist(), strict=True)
            rows += [(top, (top - before) * BLOCK_S, segment.sign) for before, top in ends]
    if not rows:
        return None
    at, dwell_s, direction = np.array(rows).T
    over = {name: column[at.astype(np.int64)] for name, column in over.items()}
    return Residual(
        direction * over["force_N"] - rig.static_force_N, over | {"dwell_s": dwell_s, "direction": direction}
    )


def _exciter(run: Prepared, over: dict[str, Floats]) -> Residual | None:
    """Delivered over commanded vibration of the base, less 1; a point for each 20 ms."""
    pieces = pieces_of_vibration(run)
    if not pieces or "base_shake_mps2" not in run.signals:
        return None
    rows = np.concatenate([np.arange(*piece) for piece in pieces])
    return Residual(
        np.expm1(delivered_log(run)[rows]), {name: row_means(column)[rows] for name, column in over.items()}
    )


def _spring(rig: RigTable, run: Prepared, over: dict[str, Floats]) -> Floats:
    force_N, slide_m, drive_m = (run.signals[name] for name in NEEDED)
    left = force_N - _pull_N(rig, drive_m - slide_m, over["extension_rate_mps"])
    return left - left.mean()  # the zero between the two displacement sensors is not known


def _curvature(rig: RigTable, run: Prepared, over: dict[str, Floats]) -> Floats:
    apart = _accel_mps2(rig, run) - _bent(rig, over["drive_position_m"])
    return _without_slow(-_bent(rig, run.signals["drive_force_N"]) - _pull_N(rig, apart, rate(apart)))


def _motion(rig: RigTable, run: Prepared, _: dict[str, Floats]) -> Floats:
    return _without_slow(_accel_mps2(rig, run) - _bent(rig, run.signals["mass_position_m"]))


def _drive(_: RigTable, run: Prepared, __: dict[str, Floats]) -> Floats:
    kept, path_m = kept_blocks(run), run.signals["drive_position_m"]
    values = np.zeros(len(kept))
    for segment in run.commands.segments:
        at = np.arange(segment.first, segment.last)[kept[segment.first : segment.last]]
        if len(at) > _FEWEST_OF_PATH:
            # subtracting a parabola removes the bow of the displacement sensor
            values[at] = path_m[at] - np.polynomial.Polynomial.fit(at, path_m[at], 2)(at)
    return values


def _friction(rig: RigTable, run: Prepared, over: dict[str, Floats]) -> Floats:
    """Sliding friction less the law of the manifest, NaN where presliding sets the force."""
    if "mass_accel_mps2" in run.signals:
        smooth = 1.0  # it resolves the edges of a slip
        accel_mps2 = gaussian_filter1d(run.signals["mass_accel_mps2"], smooth)
    else:
        smooth = _smoothing_blocks(rig)
        accel_mps2 = _bent(rig, run.signals["mass_position_m"])
    speed_mps = np.abs(over["velocity_mps"])
    law_N = np.sign(over["velocity_mps"]) * described_N(rig, speed_mps)
    left_N = gaussian_filter1d(run.signals["drive_force_N"], smooth) - rig.mass_kg * accel_mps2 - law_N
    width = 2 * math.ceil(_EDGE_MARGIN * max(smooth, _FIRST_SHARE * _smoothing_blocks(rig))) + 1
    slides = minimum_filter1d(speed_mps > _SLIDES_FROM * rig.stribeck_velocity_mps, width)
    return np.where(slides, left_N, np.nan)


_OF_BLOCKS: Final[dict[str, Callable[[RigTable, Prepared, dict[str, Floats]], Floats]]] = {
    "friction": _friction, "spring": _spring, "curvature": _curvature, "motion": _motion, "drive": _drive,
}  # fmt: skip


def _pull_N(rig: RigTable, extension: Floats, its_rate: Floats) -> Floats:
    return (rig.drive_stiffness_N_per_m or 0.0) * extension + (rig.drive_damping_Ns_per_m or 0.0) * its_rate


def _smoothing_blocks(rig: RigTable) -> float:
    """Standard deviation [blocks] of the smoothing before signals are compared."""
    if rig.drive == "force":
        return _SMOOTH_FREE
    return float(np.clip(_SMOOTH_SHARE * scales_of(rig).slip_s / BLOCK_S, 1.0, 50.0))


def _accel_mps2(rig: RigTable, run: Prepared) -> Floats:
    return gaussian_filter1d(run.signals["mass_accel_mps2"], _smoothing_blocks(rig))


def _bent(rig: RigTable, values: Floats) -> Floats:
    """Smoothed second derivative of `values` [blocks]."""
    return bend(gaussian_filter1d(values, _smoothing_blocks(rig), mode="nearest"))


def _without_slow(values: Floats) -> Floats:
    """`values` [blocks] without the part slower than 2 Hz."""
    return values - low_pass(values, _SLOW_S)
