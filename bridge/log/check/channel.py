"""Faults of one channel by itself: no finite numbers, dead or clipped. One rule for `log check` and for the verdict."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from bridge.log.check.signal_range import SignalLook
from bridge.log.finding import Finding
from bridge.log.metadata import is_number
from bridge.units import counted
from bridge.wire.messages import CHANNELS

_ACCEL = "accel_noise_mps2", "accel_resolution_mps2", "", "accel_range_mps2"
_POSITION = "position_noise_m", "position_resolution_m", "position_lowest_m", "position_range_m"
_FORCE = "force_noise_N", "force_resolution_N", "force_lowest_N", "force_range_N"
_KEYS = dict(zip(CHANNELS, (_FORCE, _ACCEL, _ACCEL, _POSITION, _POSITION), strict=True))
# Noise over resolution from which a live channel never repeats a value for long; 2 sigma are half a step then. Larger: a dead
# channel of coarse steps passes; smaller: a channel at rest, whose samples are all the same step, counts as dead.
_NOISY = 0.25
_DEAD_S = 1.0  # of equal samples. Larger: a shorter failure passes; smaller: a position at rest counts as dead
# Samples at the largest value of a channel with noise from which it is clipped, although no two of them follow each other: more
# than chance gives, in a short log, and as a share in a long one. Larger: a clipped channel passes.
FEW_AT_END, _SHARE_AT_END = 20, 1e-5
# Range of the values over the noise, up to which a channel shows noise alone and may have more samples at its end: noise alone
# spans 8 sigma. Smaller: 41 samples of an accelerometer at rest count as clipped; larger: a clipped channel passes.
_NOISE_ALONE = 20.0
_BEYOND = 1e-3  # of the range, by which a value is beyond it. Smaller: rounding to float32, 1e-7, counts; larger: units of 1 %
_ROUNDING = 1e-6  # of an end of the range, to which a value reaches it. Smaller than 6e-8: float32 misses it; larger: spare range


class Channel(NamedTuple):
    """The description of a channel, in its unit; NaN, or infinite ends, for a number that a log does not have."""

    noise: float = math.nan  # rms of a sample
    step: float = math.nan  # resolution
    low: float = -math.inf  # ends of the range
    high: float = math.inf

    @property
    def is_noisy(self) -> bool:
        """Whether a live channel of this kind repeats no value for long."""
        return self.noise > 0.0 and self.noise >= _NOISY * self.step


def channels_of(plant: Any) -> dict[str, Channel]:
    """By channel, from the configuration of a plant, which may be anything."""
    for name in ("rig", "sensors"):
        plant = plant.get(name) if isinstance(plant, Mapping) else None
    sensors: Mapping[str, Any] = plant if isinstance(plant, Mapping) else {}

    def number(key: str, otherwise: float) -> float:
        return float(sensors[key]) if is_number(sensors.get(key)) else otherwise

    found: dict[str, Channel] = {}
    for name, (noise, step, lowest, highest) in _KEYS.items():
        high = number(highest, math.inf)
        low = number(lowest, -math.inf) if lowest else -high
        found[name] = Channel(number(noise, math.nan), number(step, math.nan), low, high)
    return found


def channel_findings(name: str, seen: SignalLook, sample_s: float, of: Channel) -> list[Finding]:
    """Findings on a channel of `/sensors`, whose samples are `sample_s` apart; `times` are the samples concerned."""
    where, found = "/sensors " + name, not_finite(name, seen, sample_s)
    if seen.constant:
        return [*found, Finding("dead", where, f"constant at {seen.lowest:g} over the whole log", seen.samples)]
    live = of.is_noisy or not math.isfinite(of.noise)  # equal samples are a fault
    if live and seen.longest_run * sample_s > _DEAD_S:
        from_s = (seen.longest_run_end - seen.longest_run + 1) * sample_s
        text = f"constant for {seen.longest_run * sample_s:.2f} s from {from_s:.3f} s on"
        found.append(Finding("dead", where, text, seen.longest_run))
    return [*found, *_clipped(where, seen, of, dwells=name.endswith("_m"))]


def not_finite(name: str, seen: SignalLook, sample_s: float) -> list[Finding]:
    """A finding where samples of a channel are no finite number."""
    if not seen.not_finite:
        return []
    at_s = seen.first_not_finite * sample_s
    text = (
        f"{counted(seen.not_finite, 'sample is', 'samples are')} no finite number, first after {at_s:.3f} s of samples"
    )
    return [Finding("not-finite", f"/sensors {name}", text, seen.not_finite)]


def _clipped(where: str, seen: SignalLook, of: Channel, dwells: bool) -> list[Finding]:
    beyond = _BEYOND * (of.high - of.low)  # infinite where an end is not known
    shows_more = of.is_noisy and not dwells and seen.highest - seen.lowest > _NOISE_ALONE * of.noise
    many = max(FEW_AT_END, _SHARE_AT_END * seen.samples) if shows_more else math.inf
    parts: list[str] = []
    times, reached = 1, math.nan
    for value, runs, at, end, over in (
        (seen.highest, seen.clipped_high, seen.at_highest, of.high, seen.highest - of.high),
        (seen.lowest, seen.clipped_low, seen.at_lowest, of.low, of.low - seen.lowest),
    ):
        if over > beyond:
            text = f"shows {value:.4g}, beyond the end of its range, {end:g}: another signal or unit"
            return [Finding("clipped", where, text, seen.samples)]
        if value == 0.0 and end == 0.0:  # a sensor of one sign at rest clips its noise there, and nothing is lost
            continue
        if runs or (at > many and value != 0.0):
            parts.append(f"{counted(max(runs, at if at > many else 0), 'sample')} at {value:g}")
            times = max(times, runs, at)
        if math.isfinite(end) and over >= -_ROUNDING * abs(end):
            reached, times = end, max(times, at)
    if not parts and math.isnan(reached):
        return []
    text = " and ".join(parts) or f"reaches the end of its range, {reached:g}"
    return [Finding("clipped", where, f"{text}: more was there than the sensor shows", times)]
