"""The limits: commands are held at the alarm level, measured values reported above it; too long above the abort level trips."""

import math

from bridge.guard.records import FIRST
from bridge.guard.states import trip
from bridge.kernel import kernel
from bridge.layouts import ControllerParams, GuardMemory, GuardParams
from bridge.wire.stickslip_pb2 import (
    ACTIVE,
    ARMED,
    BAND,
    CHECKING,
    DRIVE_FAST,
    DRIVE_MAX,
    DRIVE_RATIO,
    DUTY,
    HEAT,
    LOUD,
    OVERTRAVEL,
)

_TWO_PI = 2.0 * math.pi
# Blocks within the abort level that undo one above it: two senders in turn cannot reset the count. Smaller: a level exceeded for
# half of the time does not trip. Larger: short excesses add up over a minute.
_UNDONE_BY = 4
# Windows of the drive's velocity from the start of a rig until its velocity is judged: the first ones are short and noisy.
_FAST_FROM = 10
_REPORT_PARTS = 10  # a loud vibration is reported after 1/10 of the time until it trips


@kernel
def passes(p: GuardParams, s: GuardMemory, limit: int, value: float) -> bool:
    """Whether a value is within the alarm level of a limit, else set `limit`; trip after too long above the abort level."""
    i = limit - FIRST
    s.over_blocks[i] = max(s.over_blocks[i] + (1.0 if value > p.abort[i] else -1.0 / _UNDONE_BY), 0.0)
    if s.over_blocks[i] > p.hold_blocks[i]:
        trip(s, limit)
    if value <= p.alarm[i]:
        return True
    s.limit = limit
    return False


@kernel
def exciter_gain(p: GuardParams, s: GuardMemory, frequency_Hz: float) -> float:
    """Delivered over commanded v_a at a frequency, from the loop check; linear between its tones."""
    if frequency_Hz <= p.tone_Hz[0]:
        return s.gain[0]
    for i in range(1, p.tones):
        if frequency_Hz <= p.tone_Hz[i]:
            share = (frequency_Hz - p.tone_Hz[i - 1]) / (p.tone_Hz[i] - p.tone_Hz[i - 1])
            return s.gain[i - 1] + share * (s.gain[i] - s.gain[i - 1])
    return s.gain[p.tones - 1]


@kernel
def nearest_allowed_Hz(p: GuardParams | ControllerParams, frequency_Hz: float) -> float:
    """The nearest frequency inside the range and outside every forbidden band, upwards first; also for the controller."""
    result = min(max(frequency_Hz, p.frequency_min_Hz), p.frequency_max_Hz)
    for i in range(p.bands):  # the bands are 2 Hz or more apart, so 1 Hz outside of a band is not in the next
        low, high = p.band_Hz[i, 0], p.band_Hz[i, 1]
        if low <= result <= high:
            if high < p.frequency_max_Hz:
                return min(high + 1.0, p.frequency_max_Hz)
            return max(low - 1.0, p.frequency_min_Hz)
    return result


@kernel
def slewed_m(before_m: float, target_m: float, most_m: float) -> float:
    """The amplitude that is nearest to the target and at most `most_m` from the amplitude before; also for the controller."""
    return min(max(target_m, before_m - most_m), before_m + most_m)


@kernel
def held(p: GuardParams, s: GuardMemory, frequency_Hz: float, amplitude_m: float) -> float:
    """The commanded amplitude, held at the absolute limits [m]."""
    if not passes(
        p, s, BAND, 0.0 if amplitude_m == 0.0 or nearest_allowed_Hz(p, frequency_Hz) == frequency_Hz else 1.0
    ):
        return 0.0
    result_m = amplitude_m
    if not passes(p, s, OVERTRAVEL, amplitude_m):
        result_m = p.alarm[OVERTRAVEL - FIRST]
    per_m = _TWO_PI * frequency_Hz
    measured_mps = s.vibration_mps if s.amplitude_m > 0.0 else 0.0
    if not passes(p, s, DRIVE_MAX, max(per_m * amplitude_m, measured_mps)):
        result_m = min(result_m, p.alarm[DRIVE_MAX - FIRST] / per_m)
    return result_m


@kernel
def held_by_drive(p: GuardParams, s: GuardMemory, frequency_Hz: float, amplitude_m: float) -> float:
    """The amplitude, held at its limit relative to the drive's velocity, once the loop check has measured the gain [m]."""
    if s.verified == 0:
        return amplitude_m
    # A measured gain below the gain of the rig file may be an error of the accelerometer: it must not raise the limit.
    per_m = _TWO_PI * frequency_Hz * max(exciter_gain(p, s, frequency_Hz), p.exciter_gain)
    before = s.limit
    if passes(p, s, DRIVE_RATIO, per_m * amplitude_m / max(s.drive_mps, 1e-12)):
        s.ratio_blocks = 0
        return amplitude_m
    s.ratio_blocks += 1
    if s.ratio_blocks <= p.window_blocks:
        s.limit = before  # not reported: the drive starts, and its velocity is known after this delay
    return min(amplitude_m, p.alarm[DRIVE_RATIO - FIRST] * s.drive_mps / per_m)


@kernel
def watch(p: GuardParams, s: GuardMemory) -> None:
    """Update warmth and duty of the exciter; where it may vibrate, check them and the measured velocities."""
    warmth = p.heat_per_Hz_m2 * s.frequency_Hz * s.amplitude_m * s.amplitude_m
    s.heat += p.heat_share * (warmth - s.heat)
    s.duty += p.duty_share * ((1.0 if s.amplitude_m > 0.0 else 0.0) - s.duty)
    if s.state not in (CHECKING, ARMED, ACTIVE):
        return
    passes(p, s, HEAT, s.heat)
    passes(p, s, DUTY, s.duty)
    passes(p, s, DRIVE_FAST, s.drive_mps if s.seen_blocks > _FAST_FROM * p.window_blocks else 0.0)
    loud = s.vibration_mps / max(s.drive_mps, 1e-12) if s.amplitude_m > 0.0 and s.state != CHECKING else 0.0
    before = s.limit
    if passes(p, s, LOUD, loud):
        s.loud_blocks = 0
        return
    s.loud_blocks += 1
    drive_starts = s.vibration_mps <= p.alarm[LOUD - FIRST] * s.fastest_mps
    if drive_starts or _REPORT_PARTS * s.loud_blocks <= p.hold_blocks[LOUD - FIRST]:
        s.limit = before  # not reported: the velocity of a starting drive is known late, and a stopping machine shakes its base
