"""Measured and predicted cycles in one picture, for the segment of each run in which they differ most."""

from typing import Literal, NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.units import counted
from diagnosis.features.feature import Scales, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import Segment
from diagnosis.features.slips import SegmentSlips
from diagnosis.gap.prepare import Prepared
from diagnosis.pictures.breakaways import slips_of
from diagnosis.result import Curve, Picture

Style = Literal["measured", "nominal", "retuned", "effect"]
_POINTS = 700  # points of a curve
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
    versions: tuple[Version, ...]  # measured signals first
    difference: float


def most_telling(run: Prepared, versions: tuple[Version, ...], scales: Scales) -> ShownSegment:
    """The segment of a run in which measurement and baseline (without a baseline, the last version) differ most."""
    baseline = next((version for version in versions if version.style == "retuned"), versions[-1])
    best = ShownSegment(run, run.commands.segments[0], versions, -1.0)
    for segment in run.commands.segments:
        difference = _difference(versions[0].signals, baseline.signals, segment, scales)
        # where small details decide whether or when the slide slips, a difference means little
        if segment.at_the_edge or not _is_regular(versions[0].signals, segment, scales):
            difference *= 0.3
        if difference > best.difference:
            best = ShownSegment(run, segment, versions, difference)
    return best


def _is_regular(signals: Signals, segment: Segment, scales: Scales) -> bool:
    """Whether the segment has no slip, or two or more."""
    return "drive_force_N" not in signals or len(slips_of(signals, segment, scales).tops) != 1


def _difference(measured: Signals, predicted: Signals, segment: Segment, scales: Scales) -> float:
    if "drive_force_N" not in measured:
        cut = slice(segment.first, segment.last)
        return float(abs(measured["mass_accel_mps2"][cut].std() - predicted["mass_accel_mps2"][cut].std()))
    return float(np.abs(_summary(measured, segment, scales) - _summary(predicted, segment, scales)).max())


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


def force_picture(shown: ShownSegment, scales: Scales) -> Picture:
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
        if max(counts) == min(counts) == 1 or (shown.segment.first and min(counts)):
            # the phase of stick-slip is random, so the first slips are aligned
            zeros = [float(slip.middles[0]) for slip in slips]
            title = f"{_place(shown)}: first slips aligned"
            curves = [
                _over_time(version, name, shown, zero) for version, zero in zip(shown.versions, zeros, strict=True)
            ]
            return Picture("cycle", title, "time after the middle of the first slip [ms]", _AXES[name], tuple(curves))
    curves = [_over_time(version, name, shown, None) for version in shown.versions]
    return Picture("cycle", f"{_place(shown)}: over time", "time in the run [s]", _AXES[name], tuple(curves))


def slip_picture(shown: ShownSegment, name: str, scales: Scales) -> Picture | None:
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


def slip_difference(shown: ShownSegment, name: str, scales: Scales) -> float:
    """Difference of measurement and baseline in the mean slip, relative to the slip; 0 if one of them does not slip."""
    picture = slip_picture(shown, name, scales)
    if picture is None:
        return 0.0
    measured = picture.curves[0].y
    baseline = next((curve for curve in picture.curves if curve.style == "retuned"), picture.curves[-1]).y
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


def _over_time(version: Version, name: str, shown: ShownSegment, zero: float | None) -> Curve:
    """All of a segment over the time in the run [s]; with `zero`, over the time since this block [ms]."""
    segment = shown.segment
    values = version.signals[name][segment.first : segment.last]
    block = max(len(values) // _POINTS, 1)
    kept = len(values) // block * block
    mean = values[:kept].reshape(-1, block).mean(axis=1)
    at = segment.first + (np.arange(len(mean), dtype=np.float64) + 0.5) * block
    x = at * BLOCK_S if zero is None else (at - zero) * BLOCK_S * 1e3
    return Curve(version.label, x, mean, version.style)


def _place(shown: ShownSegment) -> str:
    segment = shown.segment
    words = [shown.run.file.rsplit(".", 1)[0] + (" (held out)" if shown.run.holdout else "")]
    if segment.drive_velocity_mps != 0.0:
        words.append(f"{segment.drive_velocity_mps * 1e3:.3g} mm/s")
    if segment.frequency_Hz > 0.0:
        words.append(f"{segment.amplitude_m * 1e9:.3g} nm at {segment.frequency_Hz * 1e-3:.3g} kHz")
    return ", ".join(words)
