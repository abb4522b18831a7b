"""The delivered v_a, measured by the accelerometer of the base."""

import math

from bridge.kernel import Record, hypot, kernel
from bridge.layouts import ControllerMemory, ControllerParams


@kernel
def _fit(samples: Record, step_rad: float, start_rad: float) -> tuple[float, float]:
    """Fit a cos + b sin at one frequency to `samples` by least squares; return a and b.

    The fit is exact for a pure sine over any share of a period, unlike a plain correlation. The angle is rotated from sample to
    sample: four calls of sine and cosine a block instead of forty, as these calls limit the speed of a replay.
    """
    c, sn = math.cos(start_rad), math.sin(start_rad)
    turn_c, turn_sn = math.cos(step_rad), math.sin(step_rad)
    cos_cos, cos_sin, sin_sin, with_cos, with_sin = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(samples.shape[0]):
        value = float(samples[i])
        cos_cos += c * c
        cos_sin += c * sn
        sin_sin += sn * sn
        with_cos += value * c
        with_sin += value * sn
        c, sn = c * turn_c - sn * turn_sn, sn * turn_c + c * turn_sn
    determinant = cos_cos * sin_sin - cos_sin * cos_sin
    if determinant < 1e-9:
        return 0.0, 0.0
    a = (with_cos * sin_sin - with_sin * cos_sin) / determinant
    b = (with_sin * cos_cos - with_cos * cos_sin) / determinant
    return a, b


@kernel
def measure(p: ControllerParams, s: ControllerMemory, base_accel_mps2: Record) -> None:
    """Demodulate the base accelerometer at the commanded frequency into v_a = a / (2 pi f).

    Args:
        base_accel_mps2: [samples].

    """
    frequency_Hz = s.allowed_Hz if s.allowed_Hz > 0.0 else p.frequency_Hz
    step_rad = math.tau * frequency_Hz * p.sample_s
    a, b = _fit(base_accel_mps2, step_rad, s.phase_rad)
    s.phase_rad = (s.phase_rad + step_rad * p.samples_per_block) % math.tau
    s.in_phase_mps2 += p.filter_share * (a - s.in_phase_mps2)
    s.quadrature_mps2 += p.filter_share * (b - s.quadrature_mps2)
    per_mps2 = hypot(1.0, frequency_Hz / p.accel_bandwidth_Hz) / (math.tau * frequency_Hz)
    s.vibration_velocity_mps = per_mps2 * hypot(s.in_phase_mps2, s.quadrature_mps2)
    s.fast_mps = per_mps2 * hypot(a, b)


@kernel
def skip(p: ControllerParams, s: ControllerMemory, blocks: int) -> None:
    """Advance the demodulator's phase over lost blocks, during which the exciter continued."""
    s.phase_rad = (s.phase_rad + math.tau * s.allowed_Hz * p.block_s * blocks) % math.tau
