"""The limits of the vibration, which no policy can exceed. Every command on the bus has passed `allow`."""

import math

from bridge.guard.limits import nearest_allowed_Hz, slewed_m
from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import BLOCK, RESET, STOP
from controller.trips.doubts import ACCELEROMETER, DRIVE


@kernel
def allow(p: ControllerParams, s: ControllerMemory, events: int, wanted_Hz: float, wanted_m: float) -> None:
    """Set `allowed_Hz`, `allowed_m` and the first `limit` that changed the wanted vibration, or that a doubted signal sets.

    The amplitude goes to zero, at the slew limit, on an operator's stop, without a block, and for NaN or infinity. A stop
    stays until a reset.
    """
    if events & STOP:
        s.stopped = 1
    elif events & RESET:
        s.stopped = 0
    s.limit = wire.NO_LIMIT
    _note(s, wire.NOT_FINITE, not (math.isfinite(wanted_Hz) and math.isfinite(wanted_m)))
    _note(s, wire.OPERATOR_STOP, s.stopped == 1)
    _note(s, wire.STALE_INPUT, events & BLOCK == 0)
    target_m = max(wanted_m, 0.0) if s.limit == wire.NO_LIMIT else 0.0
    # a vibration that fades keeps its frequency; before the first vibration it has none
    frequency_Hz = wanted_Hz if target_m > 0.0 else s.allowed_Hz
    largest_m = 0.0
    if frequency_Hz > 0.0:
        s.allowed_Hz = nearest_allowed_Hz(p, frequency_Hz)
        _note(s, wire.FREQUENCY_BAND, s.allowed_Hz != frequency_Hz)
        largest_m = min(p.amplitude_max_m, p.velocity_max_mps / (math.tau * s.allowed_Hz))
    _note(s, wire.RANGE, target_m > largest_m)
    target_m = min(target_m, largest_m)
    s.allowed_m = min(max(slewed_m(s.allowed_m, target_m, p.slew_m_per_step), 0.0), largest_m)
    _note(s, wire.SLEW, s.allowed_m != target_m)
    _note(s, wire.NO_DRIVE, s.doubted & DRIVE != 0)
    if s.wanted_m > 0.0:
        _note(s, wire.HELD_OPEN_LOOP, s.doubted & ACCELEROMETER != 0)
        _note(s, wire.GAIN_LIMIT, s.banded == 1)


@kernel
def _note(s: ControllerMemory, limit: int, holds: bool) -> None:
    """Set the limit if it holds and is the first."""
    if holds and s.limit == wire.NO_LIMIT:
        s.limit = limit
