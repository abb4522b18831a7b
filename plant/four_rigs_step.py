"""One step of four or eight rigs side by side, whose numbers are in one array, in rows of `LANES` at constant places.

The compiler vectorises it because its loops run over the lanes alone, without a branch and with plain arithmetic only; the
exponential consists of additions and multiplications. The critical path of a step leads from one velocity to the next: two
exponentials and two divisions in sequence. Everything else is computed in parallel to it: 2.2 times the speed of the plant's
kernel instead of 1.6 (`make bench`).

The equations are the same as in `plant.contact`, `plant.effects` and `plant.core`.
"""

import math
from typing import Final

import numpy as np

from bridge.arrays import Floats, Records
from bridge.kernel import has_wide_vectors, kernel
from bridge.layouts import PlantParams
from plant.effects.drive import spring_law_N
from plant.effects.friction_memory import late_mps
from plant.effects.waves import TWO_PI, lattice_value, noise_in_cell, with_second

# A tuple with a number per rig: its length is a part of its type, so a kernel is compiled for each length.
Width = tuple[int, ...]
# Rigs at once: a register of AVX2 holds four, one of AVX-512 eight. With AVX2 eight rigs take 1.9 times as long as four, so there
# is one width; with AVX-512 calls for up to four rigs stay narrow.
NARROW: Final = 4
LANES: Final = 8 if has_wide_vectors() else NARROW
# The rows, by the place of their first number: parameters of the rig,
ROWS: Final = 87
_AT = range(0, ROWS * LANES, LANES)
M, K_D, H_D, K_T, PER_K_T, H_T, H_V, F_C, F_S, PER_V_S, TAIL, AT_ONCE = _AT[:12]
SLACK, YIELD, HARDENING, KNEE, KNEE_RATIO, RELAXING = _AT[12:18]
FORWARD, BACKWARD, KINETIC_BACKWARD, QUADRATIC, LATE_SHARE, FALLING = _AT[18:24]
DRIFT, SETTLING, PER_SETTLING_S, BEFORE_S, LOAD, LOAD_SIN_2, LOAD_COS_2 = _AT[24:31]
FRAME_GIVE, FRAME_2, BASE_2, SAG_PER_N = _AT[31:35]
# numbers that depend on the length of a step,
HALF_PER_M, FRAME_LOSS, FRAME_KEEP, FRAME_KEEP_HELD, BASE_KEEP, BASE_GIVE, LEAST = _AT[35:42]
ARM_KEEP, LOAD_SIN_STEP, LOAD_COS_STEP, SHARE = _AT[42:46]
# the state of the rig,
X, V, Z, V_R, G, S_D, FORCE, FRAME, FRAME_V, BASE, BASE_V, ARM = _AT[46:58]
AGE, V_LAG, LOAD_SIN, LOAD_COS = _AT[58:62]
# intermediate values from one loop of a step to the next,
DRIVE, PULL, HELD, HELD_STEP, FREE, DELIVERED, V_R_NOW, LEVEL, SETTLED, V_G, LATE_FALL, AGED = _AT[62:74]
# a rough surface: its ratio, length of a cell of its lattice, position in cells, present cell, noise at both ends of the cell,
ROUGH, CELL_M, AT_CELL, CELL, CELL_BEGIN, CELL_END = _AT[74:80]
# sums over a block: the five signals, then the squares of the accelerations of mass and base.
SUM_FORCE, SUM_MASS, SUM_BASE, SUM_X, SUM_S_D, SUM_MASS_2, SUM_BASE_2 = _AT[80:87]
_ROUNDS: Final = 6755399441055744.0  # 1.5 * 2^52: a number added to it is rounded to a whole number, in its last bits


@kernel
def decayed(a: float) -> float:
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
    series = (r + r2 * low) + r2 * r4 * (middle + r4 * high)
    power = np.int64((np.float64(turned).view(np.int64) + 1023) << 52).view(np.float64)
    return power * series + (power - 1.0)


@kernel
def _spring_N(w: Floats, i: int, extension_m: float) -> float:
    return spring_law_N(
        w[K_D + i], w[SLACK + i], w[YIELD + i], w[HARDENING + i], w[KNEE + i], w[KNEE_RATIO + i], extension_m
    )


@kernel
def approach(w: Floats, width: Width, dt: float, t_s: float, base_mps: float) -> None:
    """Compute the drive's force in the middle of the step, the velocity over the base, and the friction's level."""
    for i in range(len(width)):
        # the drive's force in the middle of the step
        anchor_mps = w[DRIVE + i] - w[FRAME_V + i]
        extension_m = w[S_D + i] - w[FRAME + i] - w[X + i]
        ahead_m = extension_m + 0.5 * dt * (anchor_mps - w[V + i])
        holds = 0.0 if math.fabs(extension_m) < w[SLACK + i] else 1.0
        w[HELD + i] = holds
        w[HELD_STEP + i] = holds * (w[H_D + i] + w[RELAXING + i] * (1.0 - w[ARM_KEEP + i]))
        w[PULL + i] = _spring_N(w, i, ahead_m) + holds * w[ARM_KEEP + i] * w[ARM + i]
        # the base, and the velocity of the slide over it
        spring_mps2 = w[BASE_2 + i] * (w[BASE + i] + 0.5 * dt * w[BASE_V + i])
        w[FREE + i] = (w[BASE_V + i] - 0.5 * dt * spring_mps2) * w[BASE_KEEP + i]
        v_r = w[V + i] - (w[DELIVERED + i] * base_mps + w[BASE_V + i])
        w[V_R_NOW + i] = v_r
        w[V_G + i] = v_r
        # the friction's level without dependence on position or noise
        load_sin, load_cos = w[LOAD_SIN + i], w[LOAD_COS + i]
        load = with_second(load_sin, load_cos, w[LOAD_SIN_2 + i], w[LOAD_COS_2 + i])
        direction = w[FORWARD + i] + (v_r < 0.0) * (w[BACKWARD + i] - w[FORWARD + i])
        friction = (1.0 + w[DRIFT + i] * t_s + w[SETTLED + i]) * (1.0 + w[LOAD + i] * load)
        w[LEVEL + i] = max(friction * (1.0 + direction), 0.01)


@kernel
def slide(w: Floats, width: Width, dt: float, z_dt: float, base_mid_mps: float, base_mps2: float) -> None:
    """One step of contact, slide, base and frame, as `plant.contact` and `plant.core` do it."""
    per_s = 1.0 / dt
    for i in range(len(width)):
        # the steady friction at this velocity
        v, v_r, z = w[V + i], w[V_R_NOW + i], w[Z + i]
        backward = w[KINETIC_BACKWARD + i] if v_r < 0.0 else 0.0
        coulomb_N = w[F_C + i] * w[LEVEL + i] * (1.0 + backward)
        static_N = (w[F_S + i] + w[AGED + i]) * w[LEVEL + i]
        excess_N = static_N - coulomb_N
        q = w[V_G + i] * w[PER_V_S + i]
        # the excess over Coulomb friction: a part that falls with the present velocity, and the parts of tail and late velocity
        late, falling = w[LATE_SHARE + i], w[FALLING + i]
        standing = falling + (1.0 - late) * (w[TAIL + i] / (1.0 + q * q)) + late * w[LATE_FALL + i]
        g = (coulomb_N + excess_N * standing) + (excess_N * falling) * decayed(q * q)
        guarded = w[AT_ONCE + i] < math.inf
        least_N = w[LEAST + i] * math.fabs(z)
        g, g_before = max(g, least_N), w[G + i]
        before_guarded = min(g_before, 3.0 * g - 2.0 * max(least_N, 0.5 * g))
        g_before = before_guarded if guarded else g_before
        # the bristle over the step, and its share of sliding in the middle of it
        k_t = w[K_T + i]
        sliding = k_t * math.fabs(v_r) * z_dt
        per_slid = 1.0 / (v_r * z_dt)
        decay = sliding / g
        per_g_mid = k_t / (1.5 * g - 0.5 * g_before)
        per_g_mid = -per_g_mid if 1.5 * v_r - 0.5 * w[V_R + i] < 0.0 else per_g_mid
        z_end = g * w[PER_K_T + i]
        z_end = z_end if v_r > 0.0 else -z_end
        moved = (z - z_end) * decayed(decay)
        z += moved
        share = 1.0 - per_g_mid * z
        share = moved * per_slid if decay > w[AT_ONCE + i] else share
        # the slide
        damping = w[H_T + i] * share + (w[H_V + i] + w[QUADRATIC + i] * math.fabs(v_r))
        anchor_mps = w[DRIVE + i] - w[FRAME_V + i]
        held, half, give = w[HELD_STEP + i], w[HALF_PER_M + i], w[BASE_GIVE + i]
        push_N = w[PULL + i] + held * anchor_mps
        pushed_mps = v + half * push_N
        base_now_mps = w[DELIVERED + i] * base_mid_mps + w[FREE + i]
        carried_mps = give * pushed_mps + half * base_now_mps  # friction moves the base within the step
        slowed = 1.0 + half * held
        v_mid = ((pushed_mps - half * (k_t * z)) + damping * carried_mps) / (slowed + damping * (give * slowed + half))
        v_end = 2.0 * v_mid - v
        x = w[X + i] + dt * v_mid
        s_d = w[S_D + i] + dt * w[DRIVE + i]
        accel = (v_end - v) * per_s
        # base and frame
        per_mps = 2.0 * w[M + i] * per_s
        base_mean_mps = (w[FREE + i] + give * (push_N + per_mps * v)) - (give * (held + per_mps)) * v_mid
        yield_mps2 = 2.0 * (base_mean_mps - w[BASE_V + i]) * per_s
        w[BASE + i] += dt * base_mean_mps
        w[BASE_V + i] = 2.0 * base_mean_mps - w[BASE_V + i]
        frame_m, frame_mps = w[FRAME + i] + dt * w[FRAME_V + i], w[FRAME_V + i]
        force_N = _spring_N(w, i, s_d - frame_m - x) + w[HELD + i] * w[H_D + i] * (anchor_mps - v_end)
        keep = w[ARM_KEEP + i] * w[ARM_KEEP + i]
        arm_N = w[HELD + i] * (keep * w[ARM + i] + w[RELAXING + i] * (1.0 - keep) * (anchor_mps - v_mid))
        force_N += arm_N
        per_m = dt * w[FRAME_2 + i]
        gain_mps = per_m * (force_N * w[FRAME_GIVE + i] - frame_m) - 2.0 * w[FRAME_LOSS + i] * frame_mps
        frame_mps += gain_mps * (w[FRAME_KEEP + i] + w[HELD + i] * w[FRAME_KEEP_HELD + i])
        load_sin, load_cos = w[LOAD_SIN + i], w[LOAD_COS + i]
        w[LOAD_SIN + i] = load_sin * w[LOAD_COS_STEP + i] + load_cos * w[LOAD_SIN_STEP + i]
        w[LOAD_COS + i] = load_cos * w[LOAD_COS_STEP + i] - load_sin * w[LOAD_SIN_STEP + i]
        w[X + i], w[V + i], w[Z + i], w[V_R + i], w[G + i], w[S_D + i] = x, v_end, z, v_r, g, s_d
        w[FORCE + i], w[FRAME + i], w[FRAME_V + i], w[ARM + i] = force_N, frame_m, frame_mps, arm_N
        base_accel = w[DELIVERED + i] * base_mps2 + yield_mps2
        w[SUM_FORCE + i] += force_N
        w[SUM_MASS + i] += accel
        w[SUM_BASE + i] += base_accel
        w[SUM_X + i] += x
        w[SUM_S_D + i] += s_d
        w[SUM_MASS_2 + i] += accel * accel
        w[SUM_BASE_2 + i] += base_accel * base_accel


@kernel
def set_steps(w: Floats, p: PlantParams, i: int, dt: float) -> None:
    """Set the numbers of a rig that depend on the length of a step."""
    w[FRAME_LOSS + i] = p.frame_damping_ratio * TWO_PI * p.frame_Hz * dt
    w[FRAME_KEEP + i] = 1.0 / (1.0 + w[FRAME_LOSS + i])
    held = 1.0 / (1.0 + w[FRAME_LOSS + i] + dt * w[FRAME_2 + i] * w[FRAME_GIVE + i] * p.h_d)
    w[FRAME_KEEP_HELD + i] = held - w[FRAME_KEEP + i]
    w[BASE_KEEP + i] = 1.0 / (1.0 + p.base_damping_ratio * TWO_PI * p.base_Hz * dt)
    give = 0.5 * dt * p.base_m_per_N * w[BASE_2 + i] * w[BASE_KEEP + i]
    w[BASE_GIVE + i] = give
    w[HALF_PER_M + i] = 0.5 * dt / p.m
    guards = p.disturbed and p.h_t > 0.0
    w[LEAST + i] = p.k_t / (1.0 + 1.0 / (dt * p.h_t * (1.0 / p.m + 2.0 * give / dt))) if guards else 0.0
    w[ARM_KEEP + i] = math.exp(-0.5 * dt / p.relaxation_s) if p.relaxing_Ns_per_m > 0.0 else 1.0
    load_rad = TWO_PI * p.load_frequency_Hz * dt
    w[LOAD_SIN_STEP + i], w[LOAD_COS_STEP + i] = math.sin(load_rad), math.cos(load_rad)


@kernel
def roughen(w: Floats, width: Width, params: Records) -> None:
    """Multiply the friction's level by a rough surface, the noise of `plant.effects.waves`; its sines are kept for a cell."""
    entered = 0
    for i in range(len(width)):
        at = (w[X + i] - w[BASE + i]) / w[CELL_M + i]
        w[AT_CELL + i] = at
        entered += math.floor(at) != w[CELL + i]
    if entered > 0:
        for i in range(len(width)):
            p: PlantParams = params[i]
            cell = math.floor(w[AT_CELL + i])
            if p.roughness_ratio != 0.0 and cell != w[CELL + i]:
                w[CELL_BEGIN + i] = lattice_value(cell, p.roughness_seed)
                w[CELL_END + i] = lattice_value(cell + 1.0, p.roughness_seed)
            w[CELL + i] = cell
    for i in range(len(width)):
        noise = noise_in_cell(w[AT_CELL + i] - w[CELL + i], w[CELL_BEGIN + i], w[CELL_END + i])
        rough = max(1.0 + w[ROUGH + i] * noise, 0.0)
        w[LEVEL + i] = max(w[LEVEL + i] * rough, 0.01)


@kernel
def lag(w: Floats, width: Width, params: Records, state: Records, dt: float, t_s: float) -> None:
    """Update the lagging velocity, and the Stribeck curve at it."""
    for i in range(len(width)):
        p: PlantParams = params[i]
        v_r = w[V_R_NOW + i]
        if p.lag_distance_m > 0.0:
            slid_m = math.fabs(v_r) * dt
            w[V_LAG + i] -= decayed(slid_m / p.lag_distance_m) * (math.fabs(v_r) - w[V_LAG + i])
        elif p.lag_s > 0.0:
            w[V_LAG + i] -= decayed(dt / p.lag_s) * (v_r - w[V_LAG + i])
            w[V_G + i] = w[V_LAG + i]
        elif p.lag_dead_s > 0.0:
            w[V_LAG + i] = late_mps(p, state[i], t_s, math.fabs(v_r))
        q = w[V_LAG + i] * w[PER_V_S + i]
        fall = decayed(q * q) + 1.0
        w[LATE_FALL + i] = fall + w[TAIL + i] * (1.0 / (1.0 + q * q) - fall)
