"""Faults of a single channel: not finite, dead or clipped. The same rule serves `log check` and the verdict."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from bridge.log.check.signal_range import SignalLook
from bridge.log.finding import Finding
from bridge.log.metadata import is_number
from bridge.units import counted
from bridge.wire.channels import SENSOR_CHANNELS

# Noise over resolution from which a live channel never repeats a value for long: 2 sigma are then half a step. Larger: a dead
# channel of coarse steps passes. Smaller: a channel at rest, whose samples all fall on the same step, counts as dead.
_NOISY = 0.25
_DEAD_S = 1.0  # equal samples for this long: a dead channel. Larger: a shorter failure passes; smaller: a position at rest counts
# Samples at the largest value from which a noisy channel is clipped although no two of them are neighbours: a count for short
# logs and a share for long ones, both above chance. Larger: a clipped channel passes.
FEW_AT_END, _SHARE_AT_END = 20, 1e-5
# Range of the values over the noise up to which a channel shows noise alone (which spans 8 sigma) and may have more samples at
# its extreme. Smaller: 41 samples of an accelerometer at rest count as clipped. Larger: a clipped channel passes.
_NOISE_ALONE = 20.0
_BEYOND = 1e-3  # share of the range from which an excess is a wrong unit. Below 1e-7: float32 rounding counts; larger: it passes
_ROUNDING = 1e-6  # relative distance from an end of the range that counts as reached. Below 6e-8: float32 misses it


class ChannelLimits(NamedTuple):
    """Noise, resolution and range of a channel, in its unit; NaN or infinite for a number that the log lacks."""

    noise: float = math.nan  # rms
    step: float = math.nan  # resolution
    low: float = -math.inf  # ends of the range
    high: float = math.inf

    @property
    def is_noisy(self) -> bool:
        """Whether a live channel of this noise and resolution repeats no value for long."""
        return self.noise > 0.0 and self.noise >= _NOISY * self.step


def channels_of(plant: Any) -> dict[str, ChannelLimits]:
    """The channels described by the configuration of a plant, which may be malformed."""
    for name in ("rig", "sensors"):
        plant = plant.get(name) if isinstance(plant, Mapping) else None
    sensors: Mapping[str, Any] = plant if isinstance(plant, Mapping) else {}

    def number(key: str, otherwise: float) -> float:
        return float(sensors[key]) if is_number(sensors.get(key)) else otherwise

    channels: dict[str, ChannelLimits] = {}
    for channel in SENSOR_CHANNELS.values():
        sensor, unit = channel.sensor, channel.name.rpartition("_")[2]
        high = number(f"{sensor}_range_{unit}", math.inf)
        low = number(f"{sensor}_lowest_{unit}", -math.inf) if channel.has_lowest else -high
        noise, step = (number(f"{sensor}_{of}_{unit}", math.nan) for of in ("noise", "resolution"))
        channels[channel.name] = ChannelLimits(noise, step, low, high)
    return channels


def channel_findings(name: str, seen: SignalLook, sample_s: float, limits: ChannelLimits) -> list[Finding]:
    """Findings on a channel of `/sensors` with samples `sample_s` apart; `times` counts the samples concerned."""
    where, findings = "/sensors " + name, not_finite(name, seen, sample_s)
    if seen.constant:
        return [*findings, Finding("dead", where, f"constant at {seen.lowest:g} over the whole log", seen.samples)]
    live = limits.is_noisy or not math.isfinite(limits.noise)  # equal samples are a fault
    if live and seen.longest_run * sample_s > _DEAD_S:
        from_s = (seen.longest_run_end - seen.longest_run + 1) * sample_s
        text = f"constant for {seen.longest_run * sample_s:.2f} s from {from_s:.3f} s on"
        findings.append(Finding("dead", where, text, seen.longest_run))
    return [*findings, *_clipped(where, seen, limits, dwells=name.endswith("_m"))]


def not_finite(name: str, seen: SignalLook, sample_s: float) -> list[Finding]:
    """A finding if the channel has samples that are not finite."""
    if not seen.not_finite:
        return []
    at_s = seen.first_not_finite * sample_s
    text = (
        f"{counted(seen.not_finite, 'sample is', 'samples are')} no finite number, first after {at_s:.3f} s of samples"
    )
    return [Finding("not-finite", f"/sensors {name}", text, seen.not_finite)]


def _clipped(where: str, seen: SignalLook, limits: ChannelLimits, dwells: bool) -> list[Finding]:
    beyond = _BEYOND * (limits.high - limits.low)  # infinite for an unknown end
    shows_more = limits.is_noisy and not dwells and seen.highest - seen.lowest > _NOISE_ALONE * limits.noise
    many = max(FEW_AT_END, _SHARE_AT_END * seen.samples) if shows_more else math.inf
    parts: list[str] = []
    times, reached = 1, math.nan
    for value, runs, at, end, over in (
        (seen.highest, seen.clipped_high, seen.at_highest, limits.high, seen.highest - limits.high),
        (seen.lowest, seen.clipped_low, seen.at_lowest, limits.low, limits.low - seen.lowest),
    ):
        if over > beyond:
            text = f"shows {value:.4g}, beyond the end of its range, {end:g}: another signal or unit"
            return [Finding("clipped", where, text, seen.samples)]
        if value == 0.0 and end == 0.0:  # a sensor of one sign at rest clips its noise at 0; no signal is lost
            continue
        if runs or (at > many and value != 0.0):
            parts.append(f"{counted(max(runs, at if at > many else 0), 'sample')} at {value:g}")
            times = max(times, runs, at)
        if math.isfinite(end) and over >= -_ROUNDING * abs(end):
            reached, times = end, max(times, at)
    if not parts and math.isnan(reached):
        return []
    text = " and ".join(parts) or f"reaches the end of its range, {reached:g}"
    return [Finding("clipped", where, f"{text}: the signal went beyond", times)]
