"""Four or eight rigs through one run side by side (`make bench`): a refit simulates one run of many slightly different rigs.

They get the same commands in the same steps, so that `four_rigs_step` does each step for all of them at once. Terms that
do not fit into its loops (a sine of the position, a power of an age) have separate loops here, for rigs with such an effect only.

The reference is `plant.core`: tests/truth/test_side_by_side.py compares every form of every effect with it.
"""

import math

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats, Records
from bridge.kernel import kernel, unlocked_kernel
from bridge.layouts import PlantMemory, PlantParams
from plant import four_rigs_step as at
from plant.effects.drive import extension_m, unevenness, yield_m
from plant.effects.friction import level
from plant.effects.friction_memory import ageing_N
from plant.effects.piezo import heat_share, load_share
from plant.effects.waves import TWO_PI
from plant.four_rigs_step import LANES, Width
from plant.piezo import delivered_share


@unlocked_kernel
def advance_lanes(
    width: Width,
    params: Records,
    state: Records,
    block_s: float,
    drive: Floats,
    frequency_Hz: Floats,
    amplitude_m: Floats,
    steps: npt.NDArray[np.int64],
    entry_blocks: npt.NDArray[np.int64],
    entry_force_N: Floats,
    entry_age_s: Floats,
    out: Floats,
) -> None:
    """Simulate one run of as many rigs as `width` is long.

    Args:
        width: `NARROW` or `LANES` numbers, whose values do not matter.
        params, state: records of `plant.records`, one a rig; `state` holds the begin of the run.
        block_s: length of a block, over which the commands hold.
        drive, frequency_Hz, amplitude_m, steps: the drive's velocity, the vibration and the number of steps, [blocks].
        entry_blocks: blocks at whose begin each slide is placed so that its spring has a given force, [entries];
        entry_force_N, entry_age_s: this force; the age of the contact, or NaN if the slide slides, [entries, rigs].
        out: filled with the means over every block of the five signals CHANNELS, then the standard deviations of the
            accelerations of mass and base within the block, [rigs, 7, blocks].

    """
    w = np.zeros(at.ROWS * LANES)
    ripples = sags = settles = lags = ages = varies = rough = False
    for i in range(len(width)):
        p: PlantParams = params[i]
        s: PlantMemory = state[i]
        w[at.M + i], w[at.K_D + i], w[at.H_D + i], w[at.K_T + i] = p.m, p.k_d, p.h_d, p.k_t
        w[at.PER_K_T + i] = 1.0 / p.k_t
        w[at.H_T + i], w[at.H_V + i], w[at.F_C + i], w[at.F_S + i] = p.h_t, p.h_v, p.F_c, p.F_s
        w[at.PER_V_S + i], w[at.TAIL + i] = 1.0 / p.v_s, p.stribeck_tail
        w[at.AT_ONCE + i] = 1.0 if p.disturbed else math.inf
        w[at.SLACK + i], w[at.KNEE + i], w[at.KNEE_RATIO + i] = 0.5 * p.gap_m, p.knee_m, p.knee_ratio
        w[at.HARDENING + i], w[at.YIELD + i] = p.hardening_per_m2, yield_m(p.hardening_per_m2)
        w[at.RELAXING + i], w[at.QUADRATIC + i] = p.relaxing_Ns_per_m, p.quadratic_Ns2_per_m2
        w[at.FORWARD + i], w[at.BACKWARD + i] = p.forward_ratio, p.backward_ratio
        w[at.KINETIC_BACKWARD + i], w[at.LATE_SHARE + i] = p.kinetic_backward_ratio, p.late_share
        w[at.FALLING + i] = (1.0 - p.stribeck_tail) * (1.0 - p.late_share)
        w[at.DRIFT + i] = p.drift_rate_per_s
        if p.drift_settling_s > 0.0:
            w[at.SETTLING + i], w[at.BEFORE_S + i] = p.drift_ratio, p.drift_before_s
            w[at.PER_SETTLING_S + i] = 1.0 / p.drift_settling_s
        w[at.LOAD + i] = p.load_ratio
        w[at.LOAD_SIN_2 + i], w[at.LOAD_COS_2 + i] = p.load_second_sin, p.load_second_cos
        load_rad = TWO_PI * p.load_frequency_Hz * s.t_s + p.load_phase_rad
        w[at.LOAD_SIN + i], w[at.LOAD_COS + i] = math.sin(load_rad), math.cos(load_rad)
        if p.frame_m_per_N != 0.0:
            w[at.FRAME_GIVE + i], w[at.FRAME_2 + i] = p.frame_m_per_N, (TWO_PI * p.frame_Hz) ** 2
        if p.base_m_per_N != 0.0:
            w[at.BASE_2 + i] = (TWO_PI * p.base_Hz) ** 2
        w[at.SAG_PER_N + i] = p.sag_ratio / p.F_s if p.sag_settling_s == 0.0 else 0.0
        w[at.X + i], w[at.V + i], w[at.Z + i] = s.x, s.v, s.z
        w[at.V_R + i], w[at.G + i], w[at.S_D + i] = s.v_r, s.g, s.s_d
        w[at.FORCE + i], w[at.FRAME + i], w[at.FRAME_V + i] = s.drive_N, s.frame_m, s.frame_mps
        w[at.BASE + i], w[at.BASE_V + i], w[at.ARM + i] = s.base_m, s.base_mps, s.arm_N
        w[at.AGE + i], w[at.V_LAG + i] = s.age_s, s.v_lag
        w[at.CELL_M + i], w[at.CELL + i] = 1.0, math.inf
        if p.roughness_ratio != 0.0 and not _varies(p):  # else `level` includes the roughness
            w[at.ROUGH + i], w[at.CELL_M + i] = p.roughness_ratio, p.roughness_length_m
        ripples = ripples or p.ripple_ratio != 0.0 or p.ripple_per_N != 0.0
        sags = sags or w[at.SAG_PER_N + i] != 0.0
        settles = settles or p.drift_settling_s > 0.0
        lags = lags or p.lag_s > 0.0 or p.lag_dead_s > 0.0 or p.lag_distance_m > 0.0
        ages = ages or p.age_growth_N != 0.0
        varies = varies or _varies(p)
        rough = rough or w[at.ROUGH + i] != 0.0
    t_s = state[0].t_s
    travelled_m = 0.0
    phi = vibrating_s = amplitude_before_m = dt_before = 0.0
    first = True
    entry = 0
    for block in range(len(drive)):
        if entry < len(entry_blocks) and entry_blocks[entry] == block:
            _enter(w, width, params, drive[block], entry_force_N[entry], entry_age_s[entry])
            entry += 1
        samples = steps[block]
        dt = block_s / samples
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
        for i in range(len(width)):
            p = params[i]
            share = delivered_share(p, frequency_Hz[block]) if vibrating else 1.0
            if p.sag_settling_s > 0.0:
                share *= heat_share(p, vibrating_s + 0.5 * block_s)
            w[at.SHARE + i] = w[at.DELIVERED + i] = share
            w[at.DRIVE + i] = drive[block]
            if dt != dt_before:
                at.set_steps(w, p, i, dt)
        dt_before = dt
        for row in range(at.SUM_FORCE, at.SUM_FORCE + 7 * LANES):
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
                for i in range(len(width)):
                    even_m = state[i].even_m + travelled_m + 0.5 * dt * drive[block]
                    w[at.DRIVE + i] = drive[block] * unevenness(params[i], t_s + 0.5 * dt, even_m, w[at.FORCE + i])
            if settles:
                for i in range(len(width)):
                    w[at.SETTLED + i] = -w[at.SETTLING + i] * at.decayed(
                        (w[at.BEFORE_S + i] + t_s) * w[at.PER_SETTLING_S + i]
                    )
            if sags:
                for i in range(len(width)):
                    w[at.DELIVERED + i] = w[at.SHARE + i] * load_share(w[at.SAG_PER_N + i], w[at.FORCE + i])
            at.approach(w, width, dt, t_s, base_mps)
            if varies:
                for i in range(len(width)):
                    if _varies(params[i]):
                        at_m = w[at.X + i] - w[at.BASE + i]
                        load = (w[at.LOAD_SIN + i], w[at.LOAD_COS + i])
                        w[at.LEVEL + i] = level(params[i], t_s, at_m, w[at.V_R_NOW + i], *load)
            if rough:
                at.roughen(w, width, params)
            if lags:
                at.lag(w, width, params, state, dt, t_s)
            if ages:
                for i in range(len(width)):
                    p = params[i]
                    w[at.AGE + i] = (w[at.AGE + i] + dt) / (1.0 + math.fabs(w[at.V_R_NOW + i]) / p.age_length_m * dt)
                    w[at.AGED + i] = ageing_N(p, w[at.AGE + i]) if p.age_growth_N != 0.0 else 0.0
            at.slide(w, width, dt, z_dt, base_mid_mps, base_mps2)
            z_dt = dt
            t_s += dt
            travelled_m += dt * drive[block]

        if vibrating:
            phi = (phi + omega * dt * samples) % TWO_PI
            vibrating_s += block_s
        for i in range(len(width)):
            for row in range(5):
                out[i, row, block] = w[at.SUM_FORCE + row * LANES + i] / samples
            for row in range(2):
                mean = out[i, 1 + row, block]
                square = w[at.SUM_MASS_2 + row * LANES + i] / samples
                out[i, 5 + row, block] = math.sqrt(max(square - mean * mean, 0.0))


@kernel
def _varies(p: PlantParams) -> bool:
    """Whether the level of friction follows the position or a random load, for which the vector loops have no terms."""
    return p.position_ratio != 0.0 or (p.load_ratio != 0.0 and p.load_seed >= 0.0)


@kernel
def _enter(w: Floats, width: Width, params: Records, drive_mps: float, force_N: Floats, age_s: Floats) -> None:
    """Place every slide so that its spring has a force [rigs]; it sticks for its age [rigs] so far, or slides if that is NaN."""
    for i in range(len(width)):
        p: PlantParams = params[i]
        w[at.FRAME + i], w[at.FRAME_V + i] = force_N[i] * p.frame_m_per_N, 0.0
        w[at.BASE + i], w[at.BASE_V + i] = force_N[i] * p.base_m_per_N, 0.0
        w[at.X + i] = w[at.S_D + i] - w[at.FRAME + i] - extension_m(p, force_N[i] - w[at.ARM + i])
        w[at.Z + i] = min(max(force_N[i], -p.F_s), p.F_s) / p.k_t
        if math.isnan(age_s[i]):
            w[at.V + i] = w[at.V_R + i] = drive_mps
        else:
            w[at.V + i] = w[at.V_R + i] = 0.0
            w[at.AGE + i] = age_s[i]
