"""Eight rigs in the time of two to four (`make bench`): the plant's equations with the rigs' numbers side by side in registers.

A refit asks for one run under many slightly different rigs. They get the same commands in the same steps, so that each operation
is done for all of them at once. What the compiler needs for that shapes this file: all numbers of all rigs in one array, in rows
of `LANES` at constant places; loops over the lanes alone, without a branch and with no call but to plain arithmetic; an
exponential made of additions and multiplications. What cannot be written so has loops of its own, which run only where a rig has
such an effect.

What is right is what `plant.core` does: tests/truth/test_side_by_side.py holds every form of every effect against it.
"""

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from bridge.kernel import Record, kernel
from plant.disturb import TWO_PI, ageing_N, late_mps, level, spring_N, wave, with_second
from plant.piezo import delivered_share

Floats = npt.NDArray[np.floating[Any]]
LANES: Final = 8
_FURTHEST, _HALVINGS = 4.0, 40  # to find the extension for a force: times that of the linear spring, to 1e-12 of that
# The rows, by the place of their first number. Of the rig:
_ROWS: Final = 81
_AT = range(0, _ROWS * LANES, LANES)
_M, _K_D, _H_D, _K_T, _PER_K_T, _H_T, _H_V, _F_C, _F_S, _PER_V_S, _TAIL, _AT_ONCE = _AT[:12]
_SLACK, _YIELD, _HARDENING, _KNEE, _KNEE_RATIO, _RELAXING = _AT[12:18]
_FORWARD, _BACKWARD, _KINETIC_BACKWARD, _QUADRATIC, _LATE_SHARE = _AT[18:23]
_DRIFT, _SETTLING, _PER_SETTLING_S, _BEFORE_S, _LOAD, _LOAD_SIN_2, _LOAD_COS_2 = _AT[23:30]
_FRAME_GIVE, _FRAME_2, _BASE_2, _SAG_PER_N = _AT[30:34]
# of its steps in a block:
_HALF_PER_M, _FRAME_LOSS, _FRAME_KEEP, _FRAME_KEEP_HELD, _BASE_KEEP, _BASE_GIVE, _LEAST = _AT[34:41]
_ARM_KEEP, _LOAD_SIN_STEP, _LOAD_COS_STEP, _SHARE = _AT[41:45]
# its state:
_X, _V, _Z, _V_R, _G, _S_D, _FORCE, _FRAME, _FRAME_V, _BASE, _BASE_V, _ARM = _AT[45:57]
_AGE, _V_LAG, _LOAD_SIN, _LOAD_COS = _AT[57:61]
# what one loop of a step leaves for the next:
_DRIVE, _PULL, _HELD, _HELD_STEP, _FREE, _DELIVERED, _V_R_NOW, _LEVEL, _SETTLED, _V_G, _TAILED, _LATE_FALL, _AGED = _AT[
    61:74
]
# sums over a block: the five signals, then the squares of the accelerations of mass and base
_SUM_FORCE, _SUM_MASS, _SUM_BASE, _SUM_X, _SUM_S_D, _SUM_MASS_2, _SUM_BASE_2 = _AT[74:81]
_ROUNDS: Final = 6755399441055744.0  # 1.5 * 2^52: what is added to it becomes a whole number, in its last bits


@kernel
def _gone(a: float) -> float:
    """exp(-a) - 1 for a >= 0, to 3e-16: -a = n ln 2 + r, the series of exp(r) - 1, and 2^n from its bits."""
    a = min(a, 700.0)
    turned = _ROUNDS - a * 1.4426950408889634
    n = turned - _ROUNDS
    r = (-a - n * 0.6931471803691238) - n * 1.9082149292705877e-10
    r2 = r * r
    r4 = r2 * r2
    low = (1 / 2 + r * (1 / 6)) + r2 * (1 / 24 + r * (1 / 120))
    middle = (1 / 720 + r * (1 / 5040)) + r2 * (1 / 40320 + r * (1 / 362880))
    high = (1 / 3628800 + r * (1 / 39916800)) + r2 * (1 / 479001600)
    series = r + r2 * (low + r4 * (middle + r4 * high))
    power = np.int64((np.float64(turned).view(np.int64) + 1023) << 52).view(np.float64)
    return power * series + (power - 1.0)


@kernel
def advance_lanes(
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    drive: Floats,
    frequency_Hz: Floats,
    amplitude_m: Floats,
    steps: npt.NDArray[np.int64],
    entry_blocks: npt.NDArray[np.int64],
    entry_force_N: Floats,
    entry_age_s: Floats,
    out: Floats,
) -> None:
    """Take `LANES` rigs through one run.

    Args:
        params, state: records of `plant.records`, one a rig; the state is where the run begins.
        drive, frequency_Hz, amplitude_m, steps: of the run, [blocks].
        entry_blocks: where each slide is put where its spring has a given force, [entries];
        entry_force_N, entry_age_s: that force, and the age of the contact or NaN where it slides on, [entries, LANES].
        out: filled with the signals of `diagnosis.reduced`, [LANES, signals, blocks].

    """
    w = np.zeros(_ROWS * LANES)
    ripples = settles = tails = lags = ages = varies = False
    for i in range(LANES):
        p: Record = params[i]
        s: Record = state[i]
        w[_M + i], w[_K_D + i], w[_H_D + i], w[_K_T + i] = p.m, p.k_d, p.h_d, p.k_t
        w[_PER_K_T + i] = 1.0 / p.k_t
        w[_H_T + i], w[_H_V + i], w[_F_C + i], w[_F_S + i] = p.h_t, p.h_v, p.F_c, p.F_s
        w[_PER_V_S + i], w[_TAIL + i] = 1.0 / p.v_s, p.stribeck_tail
        w[_AT_ONCE + i] = 1.0 if p.disturbed else math.inf
        w[_SLACK + i], w[_KNEE + i], w[_KNEE_RATIO + i] = 0.5 * p.gap_m, p.knee_m, p.knee_ratio
        w[_HARDENING + i], w[_YIELD + i] = p.hardening_per_m2, math.inf
        if p.hardening_per_m2 < 0.0:
            w[_YIELD + i] = math.sqrt(-1.0 / (3.0 * p.hardening_per_m2))
        w[_RELAXING + i], w[_QUADRATIC + i] = p.relaxing_Ns_per_m, p.quadratic_Ns2_per_m2
        w[_FORWARD + i], w[_BACKWARD + i] = p.forward_ratio, p.backward_ratio
        w[_KINETIC_BACKWARD + i], w[_LATE_SHARE + i] = p.kinetic_backward_ratio, p.late_share
        w[_DRIFT + i] = p.drift_per_s
        if p.drift_settling_s > 0.0:
            w[_SETTLING + i], w[_PER_SETTLING_S + i], w[_BEFORE_S + i] = (
                p.drift_ratio,
                1.0 / p.drift_settling_s,
                p.drift_before_s,
            )
        w[_LOAD + i], w[_LOAD_SIN_2 + i], w[_LOAD_COS_2 + i] = p.load_ratio, p.load_sin_2, p.load_cos_2
        load_rad = TWO_PI * p.load_frequency_Hz * s.t_s + p.load_phase_rad
        w[_LOAD_SIN + i], w[_LOAD_COS + i] = math.sin(load_rad), math.cos(load_rad)
        if p.frame_m_per_N != 0.0:
            w[_FRAME_GIVE + i], w[_FRAME_2 + i] = p.frame_m_per_N, (TWO_PI * p.frame_Hz) ** 2
        if p.base_m_per_N != 0.0:
            w[_BASE_2 + i] = (TWO_PI * p.base_Hz) ** 2
        w[_SAG_PER_N + i] = p.sag_ratio / p.F_s if p.sag_settling_s == 0.0 else 0.0
        w[_X + i], w[_V + i], w[_Z + i], w[_V_R + i], w[_G + i], w[_S_D + i] = s.x, s.v, s.z, s.v_r, s.g, s.s_d
        w[_FORCE + i], w[_FRAME + i], w[_FRAME_V + i] = s.drive_N, s.frame_m, s.frame_mps
        w[_BASE + i], w[_BASE_V + i], w[_ARM + i] = s.base_m, s.base_mps, s.arm_N
        w[_AGE + i], w[_V_LAG + i] = s.age_s, s.v_lag
        ripples = ripples or p.ripple_ratio != 0.0
        settles = settles or p.drift_settling_s > 0.0
        tails = tails or p.stribeck_tail != 0.0
        lags = lags or p.lag_s > 0.0 or p.lag_dead_s > 0.0 or p.lag_distance_m > 0.0
        ages = ages or p.age_growth_N != 0.0
        varies = varies or _varies(p)
    t_s = state[0].t_s
    phi = vibrating_s = amplitude_before_m = dt_before = 0.0
    first = True
    entry = 0
    for block in range(len(drive)):
        if entry < len(entry_blocks) and entry_blocks[entry] == block:
            _enter(w, params, drive[block], entry_force_N[entry], entry_age_s[entry])
            entry += 1
        samples = steps[block]
        dt = 1e-3 / samples
        z_dt = dt
        if first:
            z_dt, first = 0.5 * dt, False
        target_m = amplitude_m[block]
        if amplitude_before_m == 0.0:
            phi = 0.0
        vibrating = amplitude_before_m > 0.0 or target_m > 0.0
        amplitude_before_m = target_m
        if not vibrating:
            vibrating_s = 0.0
        omega = TWO_PI * frequency_Hz[block]
        cos_phi, sin_phi = math.cos(phi), math.sin(phi)
        cos_half, sin_half = math.cos(0.5 * omega * dt), math.sin(0.5 * omega * dt)
        peak_mps = target_m * omega
        peak_mps2 = peak_mps * omega
        base_mps = base_mid_mps = base_mps2 = 0.0
        for i in range(LANES):
            p = params[i]
            share = delivered_share(p, frequency_Hz[block]) if vibrating else 1.0
            if p.sag_settling_s > 0.0:
                share *= 1.0 - p.sag_ratio * (1.0 - math.exp(-(vibrating_s + 0.5e-3) / p.sag_settling_s))
            w[_SHARE + i] = share
            w[_DRIVE + i] = drive[block]
            if dt != dt_before:
                _set_steps(w, p, i, dt)
        dt_before = dt
        for row in range(_SUM_FORCE, _SUM_FORCE + 7 * LANES):
            w[row] = 0.0

        for _ in range(samples):
            if vibrating:
                base_mps = peak_mps * cos_phi
                base_mps2 = -peak_mps2 * sin_phi
                cos_mid = cos_phi * cos_half - sin_phi * sin_half
                sin_mid = sin_phi * cos_half + cos_phi * sin_half
                base_mid_mps = peak_mps * cos_mid
                cos_phi = cos_mid * cos_half - sin_mid * sin_half
                sin_phi = sin_mid * cos_half + cos_mid * sin_half
            if ripples:
                for i in range(LANES):
                    p = params[i]
                    turns = p.ripple_frequency_Hz * (t_s + 0.5 * dt)
                    if p.ripple_wavelength_m > 0.0:
                        turns = w[_S_D + i] / p.ripple_wavelength_m
                    angle_rad = TWO_PI * turns + p.ripple_phase_rad
                    w[_DRIVE + i] = drive[block] * (
                        1.0 + p.ripple_ratio * wave(angle_rad, p.ripple_sin_2, p.ripple_cos_2)
                    )
            if settles:
                for i in range(LANES):
                    w[_SETTLED + i] = -w[_SETTLING + i] * _gone((w[_BEFORE_S + i] + t_s) * w[_PER_SETTLING_S + i])
            _approach(w, dt, t_s, base_mps)
            if varies:
                for i in range(LANES):
                    if _varies(params[i]):
                        at_m = w[_X + i] - w[_BASE + i]
                        load = (w[_LOAD_SIN + i], w[_LOAD_COS + i])
                        w[_LEVEL + i] = level(params[i], t_s, at_m, w[_V_R_NOW + i], *load)
            if lags:
                _lag(w, params, state, dt, t_s)
            if tails:
                for i in range(LANES):
                    q = w[_V_G + i] * w[_PER_V_S + i]
                    w[_TAILED + i] = w[_TAIL + i] / (1.0 + q * q)
            if ages:
                for i in range(LANES):
                    p = params[i]
                    w[_AGE + i] = (w[_AGE + i] + dt) / (1.0 + math.fabs(w[_V_R_NOW + i]) / p.age_length_m * dt)
                    w[_AGED + i] = ageing_N(p, w[_AGE + i]) if p.age_growth_N != 0.0 else 0.0
            _slide(w, dt, z_dt, base_mid_mps, base_mps2)
            z_dt = dt
            t_s += dt

        if vibrating:
            phi = (phi + omega * dt * samples) % TWO_PI
            vibrating_s += 1e-3
        for i in range(LANES):
            for row in range(5):
                out[i, row, block] = w[_SUM_FORCE + row * LANES + i] / samples
            for row in range(2):
                mean = out[i, 1 + row, block]
                square = w[_SUM_MASS_2 + row * LANES + i] / samples
                out[i, 5 + row, block] = math.sqrt(max(square - mean * mean, 0.0))


@kernel
def _varies(p: Record) -> bool:
    """Whether the friction's level depends on the place, or on chance."""
    return p.position_ratio != 0.0 or p.roughness_ratio != 0.0 or (p.load_ratio != 0.0 and p.load_seed >= 0.0)


@kernel
def _spring_N(w: Floats, i: int, extension_m: float) -> float:
    """As `plant.disturb.spring_N`, without its branches."""
    slack_m, yield_m, knee_m = w[_SLACK + i], w[_YIELD + i], w[_KNEE + i]
    e = extension_m - min(max(extension_m, -slack_m), slack_m)
    e = min(max(e, -yield_m), yield_m)
    knee_N = w[_KNEE_RATIO + i] * w[_K_D + i] * (e - min(max(e, -knee_m), knee_m))
    return w[_K_D + i] * e * (1.0 + w[_HARDENING + i] * e * e) + knee_N


@kernel
def _approach(w: Floats, dt: float, t_s: float, base_mps: float) -> None:
    """The drive's force in the middle of the step, the velocity over the base, the friction's level."""
    for i in range(LANES):
        # the drive's force in the middle of the step
        anchor_mps = w[_DRIVE + i] - w[_FRAME_V + i]
        extension_m = w[_S_D + i] - w[_FRAME + i] - w[_X + i]
        ahead_m = extension_m + 0.5 * dt * (anchor_mps - w[_V + i])
        holds = 0.0 if math.fabs(extension_m) < w[_SLACK + i] else 1.0
        w[_HELD + i] = holds
        w[_HELD_STEP + i] = holds * (w[_H_D + i] + w[_RELAXING + i] * (1.0 - w[_ARM_KEEP + i]))
        w[_PULL + i] = _spring_N(w, i, ahead_m) + w[_ARM_KEEP + i] * w[_ARM + i]
        # the base, and how fast the slide goes over it
        sag = max(1.0 - w[_SAG_PER_N + i] * math.fabs(w[_FORCE + i]), 0.0)
        delivered = w[_SHARE + i] * sag
        spring_mps2 = w[_BASE_2 + i] * (w[_BASE + i] + 0.5 * dt * w[_BASE_V + i])
        w[_DELIVERED + i] = delivered
        w[_FREE + i] = (w[_BASE_V + i] - 0.5 * dt * spring_mps2) * w[_BASE_KEEP + i]
        v_r = w[_V + i] - delivered * base_mps - w[_BASE_V + i]
        w[_V_R_NOW + i] = v_r
        w[_V_G + i] = v_r
        # the friction's level where no place and no chance has a say in it
        load_sin, load_cos = w[_LOAD_SIN + i], w[_LOAD_COS + i]
        load = with_second(load_sin, load_cos, w[_LOAD_SIN_2 + i], w[_LOAD_COS_2 + i])
        direction = w[_FORWARD + i] + (v_r < 0.0) * (w[_BACKWARD + i] - w[_FORWARD + i])
        friction = (1.0 + w[_DRIFT + i] * t_s + w[_SETTLED + i]) * (1.0 + w[_LOAD + i] * load)
        w[_LEVEL + i] = max(friction * (1.0 + direction), 0.01)


@kernel
def _slide(w: Floats, dt: float, z_dt: float, base_mid_mps: float, base_mps2: float) -> None:
    """One step of contact, slide, base and frame, as `plant.contact` and `plant.core` do it."""
    per_s = 1.0 / dt
    for i in range(LANES):
        # the steady friction at this velocity
        v, v_r, z = w[_V + i], w[_V_R_NOW + i], w[_Z + i]
        backward = w[_KINETIC_BACKWARD + i] if v_r < 0.0 else 0.0
        coulomb_N = w[_F_C + i] * w[_LEVEL + i] * (1.0 + backward)
        static_N = (w[_F_S + i] + w[_AGED + i]) * w[_LEVEL + i]
        q = w[_V_G + i] * w[_PER_V_S + i]
        fall = _gone(q * q) + 1.0
        fall += w[_TAILED + i] - w[_TAIL + i] * fall
        fall += w[_LATE_SHARE + i] * (w[_LATE_FALL + i] - fall)
        g, g_before = coulomb_N + (static_N - coulomb_N) * fall, w[_G + i]
        guarded = w[_AT_ONCE + i] < math.inf
        least_N = w[_LEAST + i] * math.fabs(z)
        g_guarded = max(g, least_N)
        before_guarded = min(g_before, 3.0 * g_guarded - 2.0 * max(least_N, 0.5 * g_guarded))
        g = g_guarded if guarded else g
        g_before = before_guarded if guarded else g_before
        # the bristle over the step, and its share of sliding in the middle of it
        k_t = w[_K_T + i]
        g_mid = 1.5 * g - 0.5 * g_before
        per_both = 1.0 / (g * g_mid)  # one division in place of two: they are what a step waits for
        decay = k_t * math.fabs(v_r) * z_dt * (g_mid * per_both)
        z_end = g * w[_PER_K_T + i]
        z_end = z_end if v_r > 0.0 else -z_end
        moved = (z - z_end) * _gone(decay)
        z += moved
        per_g_mid = k_t * (g * per_both)
        per_g_mid = -per_g_mid if 1.5 * v_r - 0.5 * w[_V_R + i] < 0.0 else per_g_mid
        at_once = moved / (v_r * z_dt)
        share = 1.0 - per_g_mid * z
        share = at_once if decay > w[_AT_ONCE + i] else share
        # the slide
        damping = w[_H_T + i] * share + w[_H_V + i] + w[_QUADRATIC + i] * math.fabs(v_r)
        give = 1.0 + damping * w[_BASE_GIVE + i]  # as friction moves the base while it acts
        anchor_mps = w[_DRIVE + i] - w[_FRAME_V + i]
        held = w[_HELD_STEP + i]
        half = w[_HALF_PER_M + i]
        base_now_mps = w[_DELIVERED + i] * base_mid_mps + w[_FREE + i]
        pushed_mps = (v + half * (w[_PULL + i] + held * anchor_mps)) * give
        v_mid = (pushed_mps + half * (damping * base_now_mps - k_t * z)) / (give + half * (held * give + damping))
        v_end = 2.0 * v_mid - v
        x = w[_X + i] + dt * v_mid
        s_d = w[_S_D + i] + dt * w[_DRIVE + i]
        accel = (v_end - v) * per_s
        # base and frame
        base_mean_mps = w[_FREE + i] + w[_BASE_GIVE + i] * (
            w[_PULL + i] + held * (anchor_mps - v_mid) - w[_M + i] * accel
        )
        yield_mps2 = 2.0 * (base_mean_mps - w[_BASE_V + i]) * per_s
        w[_BASE + i] += dt * base_mean_mps
        w[_BASE_V + i] = 2.0 * base_mean_mps - w[_BASE_V + i]
        frame_m, frame_mps = w[_FRAME + i] + dt * w[_FRAME_V + i], w[_FRAME_V + i]
        force_N = _spring_N(w, i, s_d - frame_m - x) + w[_HELD + i] * w[_H_D + i] * (anchor_mps - v_end)
        keep = w[_ARM_KEEP + i] * w[_ARM_KEEP + i]
        arm_N = keep * w[_ARM + i] + w[_HELD + i] * w[_RELAXING + i] * (1.0 - keep) * (anchor_mps - v_mid)
        force_N += arm_N
        per_m = dt * w[_FRAME_2 + i]
        gain_mps = per_m * (force_N * w[_FRAME_GIVE + i] - frame_m) - 2.0 * w[_FRAME_LOSS + i] * frame_mps
        frame_mps += gain_mps * (w[_FRAME_KEEP + i] + w[_HELD + i] * w[_FRAME_KEEP_HELD + i])
        load_sin, load_cos = w[_LOAD_SIN + i], w[_LOAD_COS + i]
        w[_LOAD_SIN + i] = load_sin * w[_LOAD_COS_STEP + i] + load_cos * w[_LOAD_SIN_STEP + i]
        w[_LOAD_COS + i] = load_cos * w[_LOAD_COS_STEP + i] - load_sin * w[_LOAD_SIN_STEP + i]
        w[_X + i], w[_V + i], w[_Z + i], w[_V_R + i], w[_G + i], w[_S_D + i] = x, v_end, z, v_r, g, s_d
        w[_FORCE + i], w[_FRAME + i], w[_FRAME_V + i], w[_ARM + i] = force_N, frame_m, frame_mps, arm_N
        base_accel = w[_DELIVERED + i] * base_mps2 + yield_mps2
        w[_SUM_FORCE + i] += force_N
        w[_SUM_MASS + i] += accel
        w[_SUM_BASE + i] += base_accel
        w[_SUM_X + i] += x
        w[_SUM_S_D + i] += s_d
        w[_SUM_MASS_2 + i] += accel * accel
        w[_SUM_BASE_2 + i] += base_accel * base_accel


@kernel
def _set_steps(w: Floats, p: Record, i: int, dt: float) -> None:
    """What of a rig depends on the length of a step."""
    w[_FRAME_LOSS + i] = p.frame_damping_ratio * TWO_PI * p.frame_Hz * dt
    w[_FRAME_KEEP + i] = 1.0 / (1.0 + w[_FRAME_LOSS + i])
    held = 1.0 / (1.0 + w[_FRAME_LOSS + i] + dt * w[_FRAME_2 + i] * w[_FRAME_GIVE + i] * p.h_d)
    w[_FRAME_KEEP_HELD + i] = held - w[_FRAME_KEEP + i]
    w[_BASE_KEEP + i] = 1.0 / (1.0 + p.base_damping_ratio * TWO_PI * p.base_Hz * dt)
    give = 0.5 * dt * p.base_m_per_N * w[_BASE_2 + i] * w[_BASE_KEEP + i]
    w[_BASE_GIVE + i] = give
    w[_HALF_PER_M + i] = 0.5 * dt / p.m
    w[_LEAST + i] = p.k_t / (1.0 + 1.0 / (dt * p.h_t * (1.0 / p.m + 2.0 * give / dt))) if p.h_t > 0.0 else 0.0
    w[_ARM_KEEP + i] = math.exp(-0.5 * dt / p.relaxation_s) if p.relaxing_Ns_per_m > 0.0 else 1.0
    load_rad = TWO_PI * p.load_frequency_Hz * dt
    w[_LOAD_SIN_STEP + i], w[_LOAD_COS_STEP + i] = math.sin(load_rad), math.cos(load_rad)


@kernel
def _lag(w: Floats, params: npt.NDArray[Any], state: npt.NDArray[Any], dt: float, t_s: float) -> None:
    """The velocity that the friction still goes by, where it lags."""
    for i in range(LANES):
        p: Record = params[i]
        v_r = w[_V_R_NOW + i]
        if p.lag_distance_m > 0.0:
            slid_m = math.fabs(v_r) * dt
            w[_V_LAG + i] -= _gone(slid_m / p.lag_distance_m) * (math.fabs(v_r) - w[_V_LAG + i])
        elif p.lag_s > 0.0:
            w[_V_LAG + i] -= _gone(dt / p.lag_s) * (v_r - w[_V_LAG + i])
            w[_V_G + i] = w[_V_LAG + i]
        elif p.lag_dead_s > 0.0:
            w[_V_LAG + i] = late_mps(p, state[i], t_s, math.fabs(v_r))
        q = w[_V_LAG + i] * w[_PER_V_S + i]
        fall = _gone(q * q) + 1.0
        w[_LATE_FALL + i] = fall + w[_TAIL + i] * (1.0 / (1.0 + q * q) - fall)


@kernel
def _enter(w: Floats, params: npt.NDArray[Any], drive_mps: float, force_N: Floats, age_s: Floats) -> None:
    """Put every slide where its spring has a force [LANES], stuck where the age [LANES] is a number."""
    for i in range(LANES):
        p: Record = params[i]
        held_N = force_N[i] - w[_ARM + i]
        extension_m = 0.0
        step_m = _FURTHEST * held_N / p.k_d + math.copysign(0.5 * p.gap_m, held_N)
        for _ in range(_HALVINGS):
            step_m *= 0.5
            if math.fabs(spring_N(p, extension_m + step_m)) < math.fabs(held_N):
                extension_m += step_m
        w[_FRAME + i], w[_FRAME_V + i] = force_N[i] * p.frame_m_per_N, 0.0
        w[_BASE + i], w[_BASE_V + i] = force_N[i] * p.base_m_per_N, 0.0
        w[_X + i] = w[_S_D + i] - w[_FRAME + i] - extension_m
        w[_Z + i] = min(max(force_N[i], -p.F_s), p.F_s) / p.k_t
        if math.isnan(age_s[i]):
            w[_V + i] = w[_V_R + i] = drive_mps
        else:
            w[_V + i] = w[_V_R + i] = 0.0
            w[_AGE + i] = age_s[i]
