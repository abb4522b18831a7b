"""Measured and predicted cycles in one picture, for the segment of each run in which they differ most."""

from typing import Literal, NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.units import counted
from diagnosis.features.feature import Scales, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import Segment
from diagnosis.features.slips import SegmentSlips, find_slips
from diagnosis.gap.prepare import Prepared
from diagnosis.gap.problem import Problem
from diagnosis.result import Curve, Picture

Style = Literal["measured", "nominal", "retuned", "effect"]
_POINTS = 700  # points of a curve
_MOST_RUNS = 5  # most runs with a picture of a cycle
_SLIP_DIFFERS = 0.03  # smallest relative difference of two mean slips for which a close-up is drawn
_AXES = {"drive_force_N": "drive force [N]", "mass_accel_mps2": "acceleration of the mass [m/s²]"}


class Version(NamedTuple):
    """The signals of a run, [blocks] each: measured, or predicted by a model."""

    label: str
    style: Style
    signals: Signals


class ShownSegment(NamedTuple):
    """A segment of a run, and the difference of measurement and baseline there, in static friction forces."""

    run: Prepared
    segment: Segment
    versions: tuple[Version, ...]  # measured signals, the rig as described, the baseline, the named effects if any
    difference: float


def cycle_pictures(problem: Problem, models: list[dict[str, Version]]) -> list[Picture]:
    """The most telling segment of each run, and slips in close-up; `models` have a version for every run by its file."""
    shown = [
        _most_telling(
            run, (Version("measured", "measured", run.signals), *(model[run.file] for model in models)), problem.scales
        )
        for run in problem.runs
        if run.commands.segments
    ]
    shown = sorted(shown, key=lambda segment: -segment.difference)[:_MOST_RUNS]
    shown.sort(key=lambda segment: segment.run.file)
    drawn = [_force_picture(segment, problem.scales) for segment in shown]
    for name in ("drive_force_N", "mass_accel_mps2") if problem.rig.drive == "spring" else ():
        with_it = [segment for segment in shown if {"drive_force_N", name} <= segment.run.signals.keys()]
        slips = [slip for segment in with_it if (slip := _slip_picture(segment, name, problem.scales)) is not None]
        best = max(slips, key=_slip_difference, default=None)
        if best is not None and _slip_difference(best) > _SLIP_DIFFERS:
            drawn.append(best)
    return drawn


def slips_of(signals: Signals, segment: Segment, scales: Scales) -> SegmentSlips:
    """The slips of a segment that the drive force shows, in blocks of the run."""
    first = segment.first
    slips = find_slips({"drive_force_N": segment.sign * signals["drive_force_N"][first : segment.last]}, scales)
    return SegmentSlips(slips.tops + first, slips.bottoms + first, slips.middles + first, slips.weights)


def _most_telling(run: Prepared, versions: tuple[Version, ...], scales: Scales) -> ShownSegment:
    """The segment of a run in which measurement and baseline differ most."""
    measured, baseline = versions[0].signals, versions[2].signals
    shown: list[ShownSegment] = []
    for segment in run.commands.segments:
        if "drive_force_N" in measured:
            summaries = (_summary(signals, segment, scales) for signals in (measured, baseline))
            difference = float(np.abs(np.subtract(*summaries)).max())
            regular = len(slips_of(measured, segment, scales).tops) != 1
        else:
            spreads = (
                signals["mass_accel_mps2"][segment.first : segment.last].std() for signals in (measured, baseline)
            )
            difference, regular = float(abs(np.subtract(*spreads))), True
        # where small details decide whether or when the slide slips, a difference means little
        less = 0.3 if segment.at_the_edge or not regular else 1.0
        shown.append(ShownSegment(run, segment, versions, less * difference))
    return max(shown, key=lambda segment: segment.difference)


def _summary(signals: Signals, segment: Segment, scales: Scales) -> Floats:
    """Breakaway, re-stick and mean level in static friction forces, and a tenth of the logarithm of the period; [4]."""
    force_N = signals["drive_force_N"]
    slips = slips_of(signals, segment, scales)
    level_N = segment.sign * float(force_N[segment.first : segment.last].mean())
    if len(slips.tops) == 0:
        return np.array([level_N, level_N, level_N, 0.0]) / scales.force_N
    top_N = segment.sign * float(force_N[slips.tops].mean())
    bottom_N = segment.sign * float(force_N[slips.bottoms].mean())
    period = 0.1 * float(np.log(np.diff(slips.middles).mean() * BLOCK_S)) if len(slips.tops) > 1 else 0.0
    return np.array([top_N, bottom_N, level_N, period * scales.force_N]) / scales.force_N


def _force_picture(shown: ShownSegment, scales: Scales) -> Picture:
    """The mean cycle, from slip to slip, if every version has two slips; else the signal over time."""
    name = "drive_force_N" if "drive_force_N" in shown.run.signals else "mass_accel_mps2"
    # with a force drive the force is not a saw tooth, and its phase follows the measured motion
    if name == "drive_force_N" and shown.segment.drive_velocity_mps != 0.0:
        slips = [slips_of(version.signals, shown.segment, scales) for version in shown.versions]
        counts = [len(slip.middles) for slip in slips]
        if min(counts) >= 2:
            curves = [_whole_cycle(version, slips_of) for version, slips_of in zip(shown.versions, slips, strict=True)]
            cycles = f"mean of {counts[0] - 1} cycles" if counts[0] > 2 else "one cycle"
            title = f"{_place(shown)}: {cycles} from slip to slip"
            return Picture("cycle", title, "time after the middle of the slip [ms]", _AXES[name], tuple(curves))
    curves = [_over_time(version, name, shown) for version in shown.versions]
    return Picture("cycle", f"{_place(shown)}: over time", "time in the run [s]", _AXES[name], tuple(curves))


def _slip_picture(shown: ShownSegment, name: str, scales: Scales) -> Picture | None:
    """The mean slip in close-up; None where a version does not slip."""
    curves: list[Curve] = []
    reach = np.arange(-1.5, 2.5, 0.02, dtype=np.float64) * scales.slip_s / BLOCK_S
    count = 0
    for version in shown.versions:
        middles = slips_of(version.signals, shown.segment, scales).middles
        values = shown.segment.sign * version.signals[name]
        middles = middles[(middles + reach[0] >= 0.0) & (middles + reach[-1] <= len(values) - 1.0)]
        if len(middles) == 0:
            return None
        count = count or len(middles)
        blocks = np.arange(len(values), dtype=np.float64)
        mean = np.mean([np.interp(middle + reach, blocks, values) for middle in middles], axis=0)
        curves.append(Curve(version.label, reach * BLOCK_S * 1e3, mean, version.style))
    title = f"{_place(shown)}: mean of {counted(count, 'slip')}, close up"
    return Picture("cycle", title, "time after the middle of the slip [ms]", _AXES[name], tuple(curves))


def _slip_difference(picture: Picture) -> float:
    """Difference of measurement and baseline in the mean slip, relative to the slip."""
    measured, baseline = picture.curves[0].y, picture.curves[2].y
    return float((measured - baseline).std() / (measured.std() + 1e-12))


def _whole_cycle(version: Version, slips: SegmentSlips) -> Curve:
    """The mean of all cycles, each stretched to the mean period so that the slips at its ends stay sharp."""
    values = version.signals["drive_force_N"]
    periods = np.diff(slips.middles)
    share = np.linspace(-0.12, 1.12, _POINTS)
    blocks = np.arange(len(values), dtype=np.float64)
    cycles = [
        np.interp(middle + share * period, blocks, values)
        for middle, period in zip(slips.middles[:-1].tolist(), periods.tolist(), strict=True)
    ]
    return Curve(version.label, share * float(periods.mean()) * BLOCK_S * 1e3, np.mean(cycles, axis=0), version.style)


def _over_time(version: Version, name: str, shown: ShownSegment) -> Curve:
    """All of a segment over the time in the run [s]."""
    segment = shown.segment
    values = version.signals[name][segment.first : segment.last]
    block = max(len(values) // _POINTS, 1)
    kept = len(values) // block * block
    mean = values[:kept].reshape(-1, block).mean(axis=1)
    at = segment.first + (np.arange(len(mean), dtype=np.float64) + 0.5) * block
    return Curve(version.label, at * BLOCK_S, mean, version.style)


def _place(shown: ShownSegment) -> str:
    segment = shown.segment
    words = [shown.run.file.rsplit(".", 1)[0] + (" (held out)" if shown.run.holdout else "")]
    if segment.drive_velocity_mps != 0.0:
        words.append(f"{segment.drive_velocity_mps * 1e3:.3g} mm/s")
    if segment.frequency_Hz > 0.0:
        words.append(f"{segment.amplitude_m * 1e9:.3g} nm at {segment.frequency_Hz * 1e-3:.3g} kHz")
    return ", ".join(words)
