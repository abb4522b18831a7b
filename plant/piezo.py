"""The motion of the base under a commanded amplitude and frequency of the piezo.

The displacement is u = u0 sin(phi), so u' = u0 phi' cos(phi) + u0' sin(phi): the paper's v_a cos(2 pi f (t - t_on)) once
the ramp of u0 is over. The phase continues through a change of frequency; it restarts at 0 only from complete rest.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import PlantMemory, PlantParams
from plant.effects.piezo import heat_share, load_share, mode_gain, roll_off
from plant.effects.waves import TWO_PI


@kernel
def delivered_share(p: PlantParams, frequency_Hz: float) -> float:
    """Delivered share of the commanded amplitude at this frequency; 1 on a rigid mount without effects."""
    share = p.delivered_ratio
    if p.mount_resonance_Hz > 0.0:
        r = frequency_Hz / p.mount_resonance_Hz
        damped = 2.0 * p.mount_damping_ratio * r
        squared = (1.0 - r * r) * (1.0 - r * r) + damped * damped
        if p.mode_ratio > 0.0:
            share *= mode_gain(p.mode_ratio, r, damped, squared)
        else:
            share /= math.sqrt(squared)
    if p.rolloff_Hz > 0.0:
        share /= roll_off(p, frequency_Hz)
    return share


@kernel
def accepted(p: PlantParams, frequency_Hz: float, amplitude_m: float) -> tuple[float, float]:
    """The commanded frequency [Hz] and amplitude [m], clipped to the exciter's own limits."""
    return (
        min(max(frequency_Hz, p.frequency_min_Hz), p.frequency_max_Hz),
        min(max(amplitude_m, 0.0), p.amplitude_max_m),
    )


@kernel
def base_velocity_mps(p: PlantParams, s: PlantMemory) -> float:
    """The vibration velocity amplitude v_a = 2 pi f u0 of the base at the end of the last block [m/s].

    Args:
        p, s: records of `plant.records.PARAMS` and `STATE`.

    """
    share = delivered_share(p, s.frequency_Hz)
    if p.sag_ratio != 0.0:
        share *= load_share(p.sag_ratio / p.F_s, s.drive_N) if p.sag_settling_s == 0.0 else heat_share(p, s.vibrating_s)
    return share * TWO_PI * s.frequency_Hz * s.amplitude_m
