"""One block of the rig: physics and the analogue half of the sensors. No clock, no bus, no randomness in here."""

import math
from typing import Any

import numpy.typing as npt

from bridge.kernel import Record, kernel
from plant.contact import step as contact_step
from plant.piezo import accepted, delivered_share

TWO_PI = 2.0 * math.pi


@kernel
def advance(
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    drive_velocity_mps: float,
    frequency_Hz: float,
    amplitude_m: float,
    analogue: npt.NDArray[Any],
    truth: npt.NDArray[Any],
) -> None:
    """Advance the rig by one block, in place.

    Args:
        params, state: records of `plant.records.PARAMS` and `STATE`, one element each.
        drive_velocity_mps: held over the block.
        frequency_Hz, amplitude_m: the command to the piezo, held over the block.
        analogue: filled with the sensors before noise and digitising, float64 [5, samples], rows as CHANNELS.
        truth: filled with what no sensor sees, float64 [5, samples], rows as TRUTH.

    """
    p: Record = params[0]
    s: Record = state[0]
    # into locals: through the record every store to an output array would force a reload (183 -> 2xx x real time)
    dt, m, k_d, h_d = p.dt_s, p.m, p.k_d, p.h_d
    k_t, h_t, h_v, F_c, F_s, per_v_s = p.k_t, p.h_t, p.h_v, p.F_c, p.F_s, 1.0 / p.v_s
    force_share, accel_share = 1.0 - p.force_keep, 1.0 - p.accel_keep
    position_share, slow_share = 1.0 - p.position_keep, 1.0 - p.accel_highpass_keep
    steps_per_sample, samples = p.steps_per_sample, p.samples_per_block
    frequency, target_m = accepted(p, frequency_Hz, amplitude_m)
    if s.amplitude_m == 0.0 and target_m > 0.0:
        s.phi = 0.0
    if s.amplitude_m == 0.0 or target_m > 0.0:
        s.frequency_Hz = frequency  # an exciter that fades out keeps its frequency
    share = delivered_share(p, s.frequency_Hz)
    omega = TWO_PI * s.frequency_Hz
    u0 = s.amplitude_m
    u0_step = p.amplitude_slew_m_per_s * dt
    vibrating = u0 > 0.0 or target_m > 0.0
    cos_phi, sin_phi = math.cos(s.phi), math.sin(s.phi)
    cos_half, sin_half = math.cos(0.5 * omega * dt), math.sin(0.5 * omega * dt)
    base_velocity = 0.0
    base_velocity_mid = 0.0
    base_accel = 0.0
    base_ramp = 0.0
    accel = 0.0
    x, v, z, v_r, g, s_d = s.x, s.v, s.z, s.v_r, s.g, s.s_d
    force_f, position_f, drive_f = s.force_f, s.mass_position_f, s.drive_position_f
    mass_f, mass_slow_f = s.mass_accel_f, s.mass_accel_slow_f
    base_f, base_slow_f = s.base_accel_f, s.base_accel_slow_f
    z_dt = dt if s.steps > 0 else 0.5 * dt

    for sample in range(samples):
        for _ in range(steps_per_sample):
            if vibrating:
                u0_before = u0
                if u0_step == 0.0:
                    u0 = target_m
                elif u0 < target_m:
                    u0 = min(u0 + u0_step, target_m)
                elif u0 > target_m:
                    u0 = max(u0 - u0_step, target_m)
                base_ramp = share * (u0 - u0_before) / dt if u0_step > 0.0 else 0.0
                peak = share * u0 * omega
                base_velocity = peak * cos_phi + base_ramp * sin_phi
                base_accel = 2.0 * base_ramp * omega * cos_phi - peak * omega * sin_phi
                cos_mid = cos_phi * cos_half - sin_phi * sin_half
                sin_mid = sin_phi * cos_half + cos_phi * sin_half
                base_velocity_mid = peak * cos_mid + base_ramp * sin_mid
                cos_phi = cos_mid * cos_half - sin_mid * sin_half
                sin_phi = sin_mid * cos_half + cos_mid * sin_half
            pull_N = k_d * (s_d + 0.5 * dt * drive_velocity_mps - x - 0.5 * dt * v)
            v_before = v
            v, v_mid, z, v_r, g = contact_step(
                dt, z_dt, m, h_d, k_t, h_t, h_v, F_c, F_s, per_v_s,
                pull_N, drive_velocity_mps, base_velocity, base_velocity_mid, v, z, v_r, g,
            )  # fmt: skip
            z_dt = dt
            x += dt * v_mid
            s_d += dt * drive_velocity_mps
            # the sensors' analogue filters, each driven by its signal at the end of the step
            force_N = k_d * (s_d - x) + h_d * (drive_velocity_mps - v)
            accel = (v - v_before) / dt
            force_f += force_share * (force_N - force_f)
            position_f += position_share * (x - position_f)
            drive_f += position_share * (s_d - drive_f)
            mass_f += accel_share * (accel - mass_f)
            base_f += accel_share * (base_accel - base_f)
            mass_slow_f += slow_share * (mass_f - mass_slow_f)
            base_slow_f += slow_share * (base_f - base_slow_f)
        analogue[0, sample] = force_f
        analogue[1, sample] = mass_f - mass_slow_f
        analogue[2, sample] = base_f - base_slow_f
        analogue[3, sample] = position_f
        analogue[4, sample] = drive_f
        truth[0, sample] = k_d * (s_d - x) + h_d * (drive_velocity_mps - v)
        truth[1, sample] = truth[0, sample] - m * accel
        truth[2, sample] = v
        truth[3, sample] = z
        truth[4, sample] = x

    steps = samples * steps_per_sample
    s.steps += steps
    s.x, s.v, s.z, s.v_r, s.g, s.s_d = x, v, z, v_r, g, s_d
    s.amplitude_m = u0
    s.phi = (s.phi + omega * dt * steps) % TWO_PI if vibrating else 0.0
    s.force_f, s.mass_position_f, s.drive_position_f = force_f, position_f, drive_f
    s.mass_accel_f, s.mass_accel_slow_f = mass_f, mass_slow_f
    s.base_accel_f, s.base_accel_slow_f = base_f, base_slow_f
