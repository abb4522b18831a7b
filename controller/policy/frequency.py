"""Choice of the vibration's frequency among the allowed frequencies."""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams

TWO_PI = 2.0 * math.pi


@kernel
def cost(p: ControllerParams, s: ControllerMemory, i: int, velocity_mps: float) -> float:
    """Cost of a v_a [m/s] at candidate `i`: sum of its squared shares of the stroke and of the accelerometer's range.

    A resonance needs less stroke, but its gain varies; so a gain above 1 counts as 1.
    """
    frequency_Hz = p.candidate_Hz[i]
    gain = min(math.exp(s.log_gain[i]), 1.0) if s.gain_known[i] == 1 else 1.0
    stroke = velocity_mps / (TWO_PI * frequency_Hz) / gain / p.amplitude_max_m
    accel = TWO_PI * frequency_Hz * velocity_mps / p.accel_range_mps2
    return stroke * stroke + accel * accel


@kernel
def cheapest(p: ControllerParams, s: ControllerMemory, velocity_mps: float, but: int) -> int:
    """The candidate of least cost, the lowest of equals; not candidate `but` unless it is the only one."""
    best, least = -1, math.inf
    for i in range(p.candidates):
        if i == but and p.candidates > 1:
            continue
        now = cost(p, s, i, velocity_mps)
        if now < least:
            best, least = i, now
    return best
