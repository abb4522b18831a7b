"""The limits of the vibration, which no policy can exceed. Every command on the bus has passed `allow`."""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.messages import BLOCK, RESET, STALE, STOP
from bridge.wire.stickslip_pb2 import (
    FREQUENCY_BAND,
    GAIN_LIMIT,
    HELD_OPEN_LOOP,
    NO_DRIVE,
    NO_LIMIT,
    NOT_FINITE,
    OPERATOR_STOP,
    RANGE,
    SLEW,
    STALE_INPUT,
)
from controller.trips.doubts import ACCELEROMETER, DRIVE

TWO_PI = 2.0 * math.pi


@kernel
def _allowed_frequency(p: ControllerParams, frequency_Hz: float) -> float:
    """The nearest frequency inside the range and outside every forbidden band, upwards first [Hz]."""
    result = min(max(frequency_Hz, p.frequency_min_Hz), p.frequency_max_Hz)
    for i in range(p.bands):  # the bands are 2 Hz or more apart, so 1 Hz outside of a band is not in the next
        low, high = p.band_Hz[i, 0], p.band_Hz[i, 1]
        if low <= result <= high:
            if high < p.frequency_max_Hz:
                return min(high + 1.0, p.frequency_max_Hz)
            return max(low - 1.0, p.frequency_min_Hz)
    return result


@kernel
def allow(p: ControllerParams, s: ControllerMemory, events: int, wanted_Hz: float, wanted_m: float) -> None:
    """Set `allowed_Hz`, `allowed_m` and the `limit` that changed the wanted vibration.

    The amplitude goes to zero, at the slew limit, on an operator's stop, without fresh input, and for NaN or infinity. A stop
    stays until a reset.
    """
    if events & STOP:
        s.stopped = 1
    elif events & RESET:
        s.stopped = 0
    if events & STALE:
        s.stale = 1
    elif events & BLOCK:
        s.stale = 0

    limit = NO_LIMIT
    frequency_Hz = wanted_Hz
    target_m = wanted_m
    if not (math.isfinite(wanted_Hz) and math.isfinite(wanted_m)):
        limit, frequency_Hz, target_m = NOT_FINITE, s.allowed_Hz, 0.0
    elif s.stopped == 1:
        limit, target_m = OPERATOR_STOP, 0.0
    elif s.stale == 1:
        limit, target_m = STALE_INPUT, 0.0

    if target_m <= 0.0:
        target_m = 0.0
        frequency_Hz = s.allowed_Hz  # a vibration that fades keeps its frequency
    if frequency_Hz > 0.0:
        inside_Hz = _allowed_frequency(p, frequency_Hz)
        if inside_Hz != frequency_Hz and limit == NO_LIMIT:
            limit = FREQUENCY_BAND
        s.allowed_Hz = inside_Hz
        largest_m = min(p.amplitude_max_m, p.velocity_max_mps / (TWO_PI * inside_Hz))
    else:
        largest_m = 0.0  # the frequency is unknown before the first vibration
    if target_m > largest_m:
        target_m = largest_m
        if limit == NO_LIMIT:
            limit = RANGE
    low_m, high_m = s.allowed_m - p.slew_m_per_step, s.allowed_m + p.slew_m_per_step
    slewed_m = min(max(target_m, low_m), high_m)
    slewed_m = min(max(slewed_m, 0.0), largest_m)
    if slewed_m != target_m and limit == NO_LIMIT:
        limit = SLEW
    s.allowed_m = slewed_m
    if limit == NO_LIMIT:
        limit = _of_trips(s)
    s.limit = limit
    s.free_steps = s.free_steps + 1 if limit == NO_LIMIT else 0


@kernel
def _of_trips(s: ControllerMemory) -> int:
    """The limit that a doubted signal or the gain band sets, for the command; NO_LIMIT if neither does."""
    if s.doubted & DRIVE:
        return NO_DRIVE
    if s.wanted_m == 0.0:
        return NO_LIMIT
    if s.doubted & ACCELEROMETER:
        return HELD_OPEN_LOOP
    return GAIN_LIMIT if s.banded == 1 else NO_LIMIT
