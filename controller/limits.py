"""The limits of the vibration, which no policy can exceed. Every command on the bus has passed `allow`."""

import math

from bridge.guard.limits import nearest_allowed_Hz, slewed_m
from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import BLOCK, RESET, STALE, STOP
from controller.trips.doubts import ACCELEROMETER, DRIVE

TWO_PI = 2.0 * math.pi


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

    limit = wire.NO_LIMIT
    frequency_Hz = wanted_Hz
    target_m = wanted_m
    if not (math.isfinite(wanted_Hz) and math.isfinite(wanted_m)):
        limit, frequency_Hz, target_m = wire.NOT_FINITE, s.allowed_Hz, 0.0
    elif s.stopped == 1:
        limit, target_m = wire.OPERATOR_STOP, 0.0
    elif s.stale == 1:
        limit, target_m = wire.STALE_INPUT, 0.0

    if target_m <= 0.0:
        target_m = 0.0
        frequency_Hz = s.allowed_Hz  # a vibration that fades keeps its frequency
    if frequency_Hz > 0.0:
        inside_Hz = nearest_allowed_Hz(p, frequency_Hz)
        if inside_Hz != frequency_Hz and limit == wire.NO_LIMIT:
            limit = wire.FREQUENCY_BAND
        s.allowed_Hz = inside_Hz
        largest_m = min(p.amplitude_max_m, p.velocity_max_mps / (TWO_PI * inside_Hz))
    else:
        largest_m = 0.0  # the frequency is unknown before the first vibration
    if target_m > largest_m:
        target_m = largest_m
        if limit == wire.NO_LIMIT:
            limit = wire.RANGE
    s.allowed_m = min(max(slewed_m(s.allowed_m, target_m, p.slew_m_per_step), 0.0), largest_m)
    if s.allowed_m != target_m and limit == wire.NO_LIMIT:
        limit = wire.SLEW
    if limit == wire.NO_LIMIT:
        limit = _of_trips(s)
    s.limit = limit


@kernel
def _of_trips(s: ControllerMemory) -> int:
    """The limit that a doubted signal or the gain band sets, for the command; NO_LIMIT if neither does."""
    if s.doubted & DRIVE:
        return wire.NO_DRIVE
    if s.wanted_m == 0.0:
        return wire.NO_LIMIT
    if s.doubted & ACCELEROMETER:
        return wire.HELD_OPEN_LOOP
    return wire.GAIN_LIMIT if s.banded == 1 else wire.NO_LIMIT
