"""The rig's motion: slide, bristle contact, spring drive, vibrated base; classic Runge-Kutta, 3.85 us steps.

State y, float64[15]: x, v of the slide [m, m/s]; z of four bristle elements [m]; frame x, v; base x, v; Maxwell
force [N]; inner mass x, v; seal deflection [m]; deflection of a second guide [m]. Bristle rate as LuGre (Canudas de Wit
et al. 1995): z' = v_r - sigma0 |v_r| z / g(v_r). At 22 mm/s of slip sigma0 |v| / g is 1.2e5 1/s, 0.45 per step of 3.85 us;
Runge-Kutta is stable up to 2.78, so a stiff element or a slip five times as fast is stable too.

Memory without a rate (rest time, lag of g, clamp slider, heat, distance slid one way) is carried from step to step.
An effect that is off is a factor of exactly 1 or an addend of exactly 0.
"""

import math

import numba as nb
import numpy as np

SAMPLE_RATE_HZ = 20_000
SUBSTEPS = 13
STATES = 15
REST_SPEED_MPS = 2e-5  # below it the contact rests and ages; drive velocities start at 0.15 mm/s
SMOOTHING_S = 1e-3  # time constant of slip speed and drive force as inputs of slow mechanisms


@nb.njit(cache=True)
def spring_force_N(p, stretch_m, slider_m):
    """Static force of the drive spring at a stretch; slider_m is the position of the clamp's slider."""
    s = stretch_m
    if p.backlash_m > 0.0:
        half, edge = 0.5 * p.backlash_m, 0.1 * p.backlash_m  # a soft edge: the teeth give a little
        s += 0.5 * (math.sqrt((s - half) ** 2 + edge**2) - math.sqrt((s + half) ** 2 + edge**2))
    force = s
    if p.spring_cubic > 0.0:
        force += p.spring_cubic * s * (s / 1e-3) ** 2
    if p.spring_knee > 0.0:
        over = abs(s) - p.spring_knee_m
        if over > 0.0:
            force += math.copysign(p.spring_knee * over, s)
    if p.spring_exponential > 0.0:
        force += p.spring_exponential * s * (math.exp(abs(s) / p.spring_exponential_m) - 1.0)
    if p.clamp_share > 0.0:
        force -= p.clamp_share * slider_m
    return p.drive_stiffness_N_per_m * force


@nb.njit(cache=True)
def place_force_N(p, x_m):
    """The force on the slide at a place, in both directions of motion: the track's tilt, a magnet's detent."""
    place = x_m - p.tilt_centre_m
    force = -(p.tilt_N_per_m * place + p.tilt_N_per_m2 * place * place)
    if p.detent_force_N > 0.0:
        force -= p.detent_force_N * math.sin(p.detent_wavenumber_radpm * x_m + p.detent_phase_rad)
    return force


@nb.njit(cache=True)
def _aged(p, rest_s):
    """Relative growth of F_s with rest time against a rest of 1 s: power law or two time constants."""
    if p.ageing_exponent > 0.0:
        return p.ageing * (rest_s**p.ageing_exponent - 1.0)
    fast = math.exp(-1.0 / p.ageing_fast_s) - math.exp(-rest_s / p.ageing_fast_s)
    slow = math.exp(-1.0 / p.ageing_slow_s) - math.exp(-rest_s / p.ageing_slow_s)
    return p.ageing * (fast + slow)


@nb.njit(cache=True)
def _stribeck_share(p, r):
    """The share of F_s - F_c that is left at r times the Stribeck velocity."""
    if p.lorentzian > 0.0:
        return 1.0 / (1.0 + r * r)
    if p.stribeck_exponent == 2.0:
        return math.exp(-r * r)
    return math.exp(-(r**p.stribeck_exponent))


@nb.njit(cache=True)
def _steady_friction_N(p, v_r, lagged_mps, level, aged, stribeck_mps):
    """g, the friction force at a steady speed. `level` is load times surface; lagged_mps < 0: nothing lags."""
    coulomb = p.coulomb_force_N
    static = p.static_force_N * (1.0 + aged)
    side = 1.0 if v_r >= 0.0 else -1.0
    coulomb *= 1.0 + p.direction_coulomb * side
    static *= 1.0 + p.direction_static * side
    share = _stribeck_share(p, abs(v_r) / stribeck_mps)
    if lagged_mps >= 0.0:
        share += p.lag_share * (_stribeck_share(p, lagged_mps / stribeck_mps) - share)
    return level * (coulomb + max(static - coulomb, 0.005 * coulomb) * share)


@nb.njit(cache=True)
def _between(knots, n, share):
    return knots[n] + share * (knots[n + 1] - knots[n])


@nb.njit(cache=True)
def _surface(x_m, step_m, table):
    place = min(max(x_m / step_m, 0.0), len(table) - 1.001)
    i = int(place)
    return table[i] + (place - i) * (table[i + 1] - table[i])


@nb.njit(cache=True)
def _rates(p, y, dy, drive_m, drive_mps, base_mps, level, aged, lagged_mps, stribeck_mps, slider_m):
    """Fills dy. Returns drive force [N], slip force over g [1], relative speed [m/s], base mode accel [m/s2]."""
    x, v = y[0], y[1]
    v_r = v - base_mps - y[9]
    force = spring_force_N(p, drive_m + y[6] - x, slider_m) + p.drive_damping_Ns_per_m * (drive_mps + y[7] - v) + y[10]
    if p.maxwell_stiffness_N_per_m > 0.0:
        dy[10] = p.maxwell_stiffness_N_per_m * (drive_mps + y[7] - v) - y[10] / p.maxwell_time_s
    g = _steady_friction_N(p, v_r, lagged_mps, level, aged, stribeck_mps)
    elastic, friction = 0.0, 0.0
    for i in range(int(p.elements)):
        stiffness = p.contact_stiffness_N_per_m * p.stiffness_share[i]
        z = y[2 + i]
        dy[2 + i] = v_r - stiffness * abs(v_r) * z / (p.force_share[i] * g)
        elastic += stiffness * z
        friction += stiffness * z + p.contact_damping_Ns_per_m * p.stiffness_share[i] * dy[2 + i]
    friction += p.viscous_damping_Ns_per_m * v_r + p.quadratic_damping_Ns2_per_m2 * v_r * abs(v_r)
    total = force - friction
    if p.seal_force_N > 0.0:
        dy[13] = v - p.seal_stiffness_N_per_m * abs(v) * y[13] / p.seal_force_N
        total -= p.seal_stiffness_N_per_m * y[13]
    if p.guide_force_N > 0.0:
        steady_N = p.guide_force_N * (1.0 + p.guide_static_share * math.exp(-((v / p.guide_stribeck_mps) ** 2)))
        dy[14] = v - p.guide_stiffness_N_per_m * abs(v) * y[14] / steady_N
        total -= p.guide_stiffness_N_per_m * y[14]
    total += place_force_N(p, x)
    if p.inner_mass_ratio > 0.0:
        w = p.inner_omega_radps
        pull = w * w * (y[11] - x) + 2.0 * p.inner_damping_ratio * w * (y[12] - v)
        total += p.inner_mass_ratio * p.mass_kg * pull
        dy[11] = y[12]
        dy[12] = -pull
    mass = p.mass_kg
    if p.acceleration_friction_s2_per_m > 0.0 and total * v_r > 0.0:
        mass += p.acceleration_friction_s2_per_m * abs(friction)  # friction grows while the slide speeds up
    dy[0] = v
    dy[1] = total / mass
    if p.frame_inverse_mass_1_per_kg > 0.0:  # the pull of the drive bends the support back
        w = p.frame_omega_radps
        dy[6] = y[7]
        dy[7] = -force * p.frame_inverse_mass_1_per_kg - w * w * y[6] - 2.0 * p.frame_damping_ratio * w * y[7]
    if p.base_inverse_mass_1_per_kg > 0.0:  # friction drags the base along
        w = p.base_omega_radps
        dy[8] = y[9]
        dy[9] = friction * p.base_inverse_mass_1_per_kg - w * w * y[8] - 2.0 * p.base_damping_ratio * w * y[9]
    return force, elastic / g, v_r, dy[9]


@nb.njit(cache=True)
def _vibration(p, amplitude_m, growth_mps, omega_radps, phase_rad):
    """Velocity and acceleration of u = a (sin + harmonics) while the amplitude a grows at growth_mps."""
    s, c = math.sin(phase_rad), math.cos(phase_rad)
    velocity = growth_mps * s + amplitude_m * omega_radps * c
    accel = 2.0 * growth_mps * omega_radps * c - amplitude_m * omega_radps**2 * s
    if p.second_harmonic != 0.0:
        w = 2.0 * omega_radps
        velocity += p.second_harmonic * amplitude_m * w * math.cos(2.0 * phase_rad)
        accel -= p.second_harmonic * amplitude_m * w * w * math.sin(2.0 * phase_rad)
    if p.subharmonic != 0.0:
        w = 0.5 * omega_radps
        velocity += p.subharmonic * amplitude_m * w * math.cos(0.5 * phase_rad)
        accel -= p.subharmonic * amplitude_m * w * w * math.sin(0.5 * phase_rad)
    return velocity, accel


@nb.njit(cache=True)
def integrate(
    params, y, age_s, slider_m, table, table_step_m, drive_m, drive_mps, load, amplitude_m, frequency_Hz, phase_rad,
    substeps, out,
):  # fmt: skip
    """Moves the rig from sample to sample and fills out.

    params (1,) PARAMS; y (15,) state, overwritten; table (points,) friction level along the track; drive_m,
    drive_mps, load, amplitude_m (samples + 1,) linear in between; frequency_Hz, phase_rad (samples,) held;
    out (4, samples): drive force [N], slide and base acceleration [m/s2], slide position [m].
    """
    p = params[0]
    samples = out.shape[1]
    h = 1.0 / SAMPLE_RATE_HZ / substeps
    k1, k2, k3, k4, w = np.zeros(STATES), np.zeros(STATES), np.zeros(STATES), np.zeros(STATES), np.zeros(STATES)
    phase, smooth_force, smooth_slip, rest_s, heat = 0.0, 0.0, 0.0, age_s, 0.0
    lagged, lag_on, past_at = -1.0, p.lag_delay_s > 0.0 or p.lag_distance_m > 0.0, 0
    past = np.zeros(max(int(p.lag_delay_s / h + 0.5), 1))
    aged, stribeck = 0.0, p.stribeck_velocity_mps
    preload_heat, smooth_v, side, wiped_m, grown = 0.0, 0.0, 0.0, 0.0, 1.0
    if lag_on:
        lagged = 0.0
    for n in range(samples):
        if p.ageing != 0.0:
            aged = _aged(p, rest_s)
        if p.warming != 0.0:
            stribeck = p.stribeck_velocity_mps * (1.0 + p.warming * heat)
        if p.preload_growth != 0.0:
            grown = 1.0 + p.preload_growth * preload_heat
        if p.starvation != 0.0:
            grown = 1.0 + p.starvation * (1.0 - math.exp(-wiped_m / p.starvation_m))
        sag = 1.0 - p.sag_load * smooth_force / p.static_force_N
        a0, a1 = amplitude_m[n] * sag, amplitude_m[n + 1] * sag
        growth = (a1 - a0) * SAMPLE_RATE_HZ
        omega = 2.0 * math.pi * frequency_Hz[n]
        for j in range(substeps):
            f0, fh, f1 = j / substeps, (j + 0.5) / substeps, (j + 1.0) / substeps
            at = phase + phase_rad[n]
            u0 = u1 = uh = base_accel = 0.0
            if a0 != 0.0 or a1 != 0.0:
                u0, base_accel = _vibration(p, a0 + f0 * (a1 - a0), growth, omega, at)
                uh, _ = _vibration(p, a0 + fh * (a1 - a0), growth, omega, at + 0.5 * h * omega)
                u1, _ = _vibration(p, a0 + f1 * (a1 - a0), growth, omega, at + h * omega)
            d0, e0 = _between(drive_m, n, f0), _between(drive_mps, n, f0)
            dh, eh = _between(drive_m, n, fh), _between(drive_mps, n, fh)
            d1, e1 = _between(drive_m, n, f1), _between(drive_mps, n, f1)
            # the finest wave of the surface is 10 um long, a step moves 0.1 um at most: held over a step
            level = _between(load, n, fh) * _surface(y[0], table_step_m, table) * grown
            force, over, v_r, mode_accel = _rates(p, y, k1, d0, e0, u0, level, aged, lagged, stribeck, slider_m)
            if j == 0:
                out[0, n] = force
                out[1, n] = k1[1]
                out[2, n] = base_accel + mode_accel
                out[3, n] = y[0]
            for i in range(STATES):
                w[i] = y[i] + 0.5 * h * k1[i]
            _rates(p, w, k2, dh, eh, uh, level, aged, lagged, stribeck, slider_m)
            for i in range(STATES):
                w[i] = y[i] + 0.5 * h * k2[i]
            _rates(p, w, k3, dh, eh, uh, level, aged, lagged, stribeck, slider_m)
            for i in range(STATES):
                w[i] = y[i] + h * k3[i]
            _rates(p, w, k4, d1, e1, u1, level, aged, lagged, stribeck, slider_m)
            for i in range(STATES):
                y[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
            phase += h * omega
            if phase > 4.0 * math.pi:  # two turns, so that the subharmonic does not jump
                phase -= 4.0 * math.pi
            slip = abs(over * v_r)  # inelastic part of the relative speed
            smooth_slip += h / SMOOTHING_S * (slip - smooth_slip)
            smooth_force += h / SMOOTHING_S * (abs(force) - smooth_force)
            if p.ageing != 0.0:
                if smooth_slip < REST_SPEED_MPS:
                    rest_s += h
                else:
                    rest_s *= math.exp(-h * smooth_slip / p.ageing_reset_m)
            if p.lag_distance_m > 0.0:
                now = abs(v_r)
                lagged = now + (lagged - now) * math.exp(-h * now / p.lag_distance_m)
            elif lag_on:
                lagged, past[past_at] = past[past_at], abs(v_r)
                past_at = (past_at + 1) % len(past)
            if p.warming != 0.0:  # 1 at the friction work of F_c at 1 mm/s
                heat += h / p.warming_time_s * (slip / 1e-3 - heat)
            if p.preload_growth != 0.0:  # 1 at the friction work of F_c at 1 mm/s
                preload_heat += h / p.preload_time_s * (slip / 1e-3 - preload_heat)
            if p.starvation != 0.0:
                smooth_v += h / SMOOTHING_S * (over * v_r - smooth_v)
                if smooth_v * side < -REST_SPEED_MPS or side == 0.0:  # it slides the other way, where the oil is
                    side = math.copysign(1.0, smooth_v)
                    wiped_m = 0.0
                wiped_m += h * abs(smooth_v)
            if p.clamp_share > 0.0:
                stretch = d1 + y[6] - y[0]
                slider_m = min(max(slider_m, stretch - p.clamp_yield_m), stretch + p.clamp_yield_m)
