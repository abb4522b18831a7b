"""One block of the rig: physics and the analogue half of the sensors. No clock, no bus, no randomness in here.

Compiled twice from one source: `advance`, the nominal rig, in which the compiler drops every branch of the effects, and
`advance_disturbed`, which has all branches; its speed depends on the effects that are switched on.
"""

import math
from collections.abc import Callable

from bridge.arrays import Floats, Records
from bridge.kernel import kernel, shared_kernel
from bridge.layouts import PlantMemory, PlantParams
from plant.contact import elasto_plastic_share
from plant.contact import step as contact_step
from plant.effects.drive import spring_N, unevenness
from plant.effects.friction import level
from plant.effects.friction_memory import ageing_N, late_mps
from plant.effects.piezo import heat_share, load_share
from plant.effects.sensors import force_reading_N
from plant.effects.structure import base_free_mps, base_give, frame_gain_mps
from plant.effects.waves import TWO_PI
from plant.piezo import accepted, delivered_share

# Share of v_s. While |v_r| stays below it for a sample, the slide sticks: the next sample takes few long steps. The error of the
# slip times was the same from 0.01 to 0.05 (docs/method/rig.md). Larger: a slip begins in a long step. Smaller: fewer samples
# take long steps.
_STICK_SHARE = 0.02


@kernel
def _stribeck_share(q: float, tail: float) -> float:
    """Remaining share of F_s - F_c at q times the Stribeck velocity."""
    share = math.exp(-q * q)
    if tail != 0.0:
        share += tail * (1.0 / (1.0 + q * q) - share)
    return share


def _compiled(disturbed: bool) -> Callable[..., None]:
    def advance(
        params: Records,
        state: Records,
        drive: float,
        frequency_Hz: float,
        amplitude_m: float,
        analogue: Floats,
        truth: Floats,
    ) -> None:
        """Advance the rig by one block, in place.

        Args:
            params, state: records of `plant.records.PARAMS` and `STATE`, one element each.
            drive: velocity of the drive [m/s], held over the block; with `force_driven` the force on the slide [N].
            frequency_Hz, amplitude_m: the command to the piezo, held over the block.
            analogue: filled with the sensors before noise and digitising, float64 [5, samples], rows as CHANNELS.
            truth: filled with quantities without a sensor, float64 [6, samples], rows as TRUTH.

        """
        p: PlantParams = params[0]
        s: PlantMemory = state[0]
        # copied to locals: the compiler would reload record fields after every store to an output array
        dt, m, k_d, h_d = p.dt_s, p.m, p.k_d, p.h_d
        fine_dt, stick_dt, stick_mps = dt, p.stick_dt_s, _STICK_SHARE * p.v_s
        k_t, h_t, h_v, F_c, F_s, per_v_s = p.k_t, p.h_t, p.h_v, p.F_c, p.F_s, 1.0 / p.v_s
        tail = p.stribeck_tail
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
        free_mps = 0.0
        accel = 0.0
        drive_velocity_mps = drive
        h_d_now, h_d_step, F_c_now, F_s_now, sliding_share, gives = h_d, h_d, F_c, F_s, 1.0, 0.0
        force_N, slack = s.drive_N, False
        # the rest is used by the disturbed kernel only
        t_s = s.t_s
        frame_m, frame_mps, base_m, base_mps, yield_mps2 = s.frame_m, s.frame_mps, s.base_m, s.base_mps, 0.0
        age_s, v_lag, arm_N = s.age_s, s.v_lag, s.arm_N
        arm_keep_half = math.exp(-0.5 * dt / p.relaxation_s) if p.relaxing_Ns_per_m > 0.0 else 1.0
        lag_share = 1.0 - math.exp(-dt / p.lag_s) if p.lag_s > 0.0 else 1.0
        frame_omega, base_omega = TWO_PI * p.frame_Hz, TWO_PI * p.base_Hz
        frame_loss, base_loss = p.frame_damping_ratio * frame_omega * dt, p.base_damping_ratio * base_omega * dt
        if disturbed and p.base_m_per_N != 0.0:
            gives = base_give(dt, base_omega, base_loss, p.base_m_per_N)
        # lowest g over |z|: below it, where friction falls abruptly, the bristle's damper makes the step unstable
        least_N_per_m = k_t / (1.0 + 1.0 / (dt * h_t * (1.0 / m + 2.0 * gives / dt))) if h_t > 0.0 else 0.0
        block_s = samples * steps_per_sample * dt
        vibrating_s = s.vibrating_s if vibrating else 0.0
        warm_share, sag_per_N = 1.0, 0.0
        if p.sag_settling_s == 0.0:
            sag_per_N = p.sag_ratio / F_s
        else:
            warm_share = heat_share(p, vibrating_s + 0.5 * block_s)
        if disturbed and p.force_driven:
            drive_velocity_mps = 0.0
        # the load's sine is rotated from step to step: computed in each step, it slowed a rig with a varying load by a third
        load_omega = TWO_PI * p.load_frequency_Hz
        load_rad = load_omega * t_s + p.load_phase_rad
        load_sin, load_cos = math.sin(load_rad), math.cos(load_rad)
        load_sin_step, load_cos_step = math.sin(load_omega * dt), math.cos(load_omega * dt)
        x, v, z, v_r, g, s_d, even_m = s.x, s.v, s.z, s.v_r, s.g, s.s_d, s.even_m
        force_f, position_f, drive_f = s.force_f, s.mass_position_f, s.drive_position_f
        mass_f, mass_slow_f = s.mass_accel_f, s.mass_accel_slow_f
        base_f, base_slow_f = s.base_accel_f, s.base_accel_slow_f
        dt_before, z_dt, ahead = s.dt_s, dt if s.dt_s > 0.0 else 0.5 * dt, 0.5
        sticks = s.sticks != 0

        for sample in range(samples):
            steps = steps_per_sample
            if not disturbed:  # long steps, not with effects: other parts may swing while the slide sticks
                coarse = sticks and not vibrating
                steps = p.steps_per_stick_sample if coarse else steps_per_sample
                dt = stick_dt if coarse else fine_dt
                force_share = 1.0 - (p.force_keep_stick if coarse else p.force_keep)
                accel_share = 1.0 - (p.accel_keep_stick if coarse else p.accel_keep)
                position_share = 1.0 - (p.position_keep_stick if coarse else p.position_keep)
                slow_share = 1.0 - (p.accel_highpass_keep_stick if coarse else p.accel_highpass_keep)
                sticks = True
            for _ in range(steps):
                if vibrating:
                    u0_before = u0
                    if u0_step == 0.0:
                        u0 = target_m
                    elif u0 < target_m:
                        u0 = min(u0 + u0_step, target_m)
                    elif u0 > target_m:
                        u0 = max(u0 - u0_step, target_m)
                    share_now = share
                    if disturbed and p.sag_ratio != 0.0:
                        share_now *= warm_share * load_share(sag_per_N, force_N)
                    base_ramp = share_now * (u0 - u0_before) / dt if u0_step > 0.0 else 0.0
                    peak = share_now * u0 * omega
                    base_velocity = peak * cos_phi + base_ramp * sin_phi
                    base_accel = 2.0 * base_ramp * omega * cos_phi - peak * omega * sin_phi
                    cos_mid = cos_phi * cos_half - sin_phi * sin_half
                    sin_mid = sin_phi * cos_half + cos_phi * sin_half
                    base_velocity_mid = peak * cos_mid + base_ramp * sin_mid
                    cos_phi = cos_mid * cos_half - sin_mid * sin_half
                    sin_phi = sin_mid * cos_half + cos_mid * sin_half
                if disturbed:
                    if p.ripple_ratio != 0.0 or p.ripple_per_N != 0.0:
                        drive_velocity_mps = drive * unevenness(p, t_s + 0.5 * dt, even_m + 0.5 * dt * drive, force_N)
                        even_m += dt * drive
                    anchor_mps = drive_velocity_mps - frame_mps
                    extension_m = s_d - frame_m - x
                    pull_N = drive if p.force_driven else spring_N(p, extension_m + 0.5 * dt * (anchor_mps - v))
                    # a slack drive does not damp; a force drive has no damper
                    slack = math.fabs(extension_m) < 0.5 * p.gap_m
                    h_d_now = 0.0 if p.force_driven or slack else h_d
                    h_d_step = h_d_now
                    if p.relaxing_Ns_per_m > 0.0:  # Maxwell arm: force left at mid-step, damping for new force
                        arm_N = 0.0 if slack else arm_N  # the gap is in series with the relaxing damper too
                        pull_N += arm_keep_half * arm_N
                        h_d_step += 0.0 if slack else p.relaxing_Ns_per_m * (1.0 - arm_keep_half)
                else:
                    anchor_mps = drive_velocity_mps
                    pull_N = k_d * (s_d + 0.5 * dt * drive_velocity_mps - x - 0.5 * dt * v)
                v_r_before, g_before, v_before = v_r, g, v
                v_r = v - base_velocity
                if not disturbed:
                    sticks = sticks and math.fabs(v_r) < stick_mps
                    z_dt = 0.5 * (dt_before + dt)
                    ahead = 0.5 * dt / dt_before if dt_before > 0.0 else 0.5
                    dt_before = dt
                v_g = v_r
                base_mid_mps = base_velocity_mid
                if disturbed:
                    v_r -= base_mps
                    if p.base_m_per_N != 0.0:
                        free_mps = base_free_mps(dt, base_omega, base_loss, base_m, base_mps)
                        base_mid_mps += free_mps
                    friction = level(p, t_s, x - base_m, v_r, load_sin, load_cos)
                    load_sin, load_cos = (
                        load_sin * load_cos_step + load_cos * load_sin_step,
                        load_cos * load_cos_step - load_sin * load_sin_step,
                    )
                    v_g = v_r
                    if p.lag_distance_m > 0.0:
                        slid_m = math.fabs(v_r) * dt
                        v_lag += (1.0 - math.exp(-slid_m / p.lag_distance_m)) * (math.fabs(v_r) - v_lag)
                    elif p.lag_s > 0.0:
                        v_lag += lag_share * (v_r - v_lag)
                        v_g = v_lag
                    elif p.lag_dead_s > 0.0:
                        v_lag = late_mps(p, s, t_s, math.fabs(v_r))
                    age_s = (age_s + dt) / (1.0 + math.fabs(v_r) / p.age_length_m * dt)
                    F_c_now = F_c * friction * (1.0 + (p.kinetic_backward_ratio if v_r < 0.0 else 0.0))
                    F_s_now = F_s * friction
                    if p.age_growth_N != 0.0:
                        F_s_now += ageing_N(p, age_s) * friction
                    damping = h_v + p.quadratic_Ns2_per_m2 * math.fabs(v_r)
                else:
                    damping = h_v
                fall = _stribeck_share(v_g * per_v_s, tail)
                if disturbed and p.late_share > 0.0:
                    fall += p.late_share * (_stribeck_share(v_lag * per_v_s, tail) - fall)
                g = F_c_now + (F_s_now - F_c_now) * fall
                if disturbed:
                    least_N = least_N_per_m * math.fabs(z)
                    g = max(g, least_N)
                    g_before = min(g_before, 3.0 * g - 2.0 * max(least_N, 0.5 * g))  # in mid-step g is above both
                if disturbed and p.elasto_plastic:
                    sliding_share = elasto_plastic_share(z, v_r, g, k_t, p.elastic_ratio)
                v, v_mid, z = contact_step(
                    dt, z_dt, ahead, m, h_d_step, k_t, h_t, damping, g, sliding_share, gives, disturbed,
                    pull_N, anchor_mps, base_mid_mps, v, v_r, z, v_r_before, g_before,
                )  # fmt: skip
                if disturbed:
                    z_dt = dt
                x += dt * v_mid
                s_d += dt * drive_velocity_mps
                accel = (v - v_before) / dt
                # the sensors' analogue filters, each driven by its signal at the end of the step
                if disturbed:
                    t_s += dt
                    if p.base_m_per_N != 0.0:
                        base_gain_mps = gives * (pull_N + h_d_step * (anchor_mps - v_mid) - m * accel)
                        base_mean_mps = free_mps + base_gain_mps
                        base_m += dt * base_mean_mps
                        yield_mps2 = 2.0 * (base_mean_mps - base_mps) / dt
                        base_mps = 2.0 * base_mean_mps - base_mps
                    frame_m += dt * frame_mps  # a leapfrog: frame_mps is the velocity in the middle of the step
                    spring_force_N = spring_N(p, s_d - frame_m - x) + h_d_now * (anchor_mps - v)
                    if p.relaxing_Ns_per_m > 0.0:
                        arm_keep = arm_keep_half * arm_keep_half
                        arm_N = arm_keep * arm_N
                        if not slack:
                            arm_N += p.relaxing_Ns_per_m * (1.0 - arm_keep) * (anchor_mps - v_mid)
                        spring_force_N += arm_N
                    force_N = drive if p.force_driven else spring_force_N
                    if p.frame_m_per_N != 0.0:
                        frame_mps += frame_gain_mps(
                            dt, frame_omega, frame_loss, p.frame_m_per_N, h_d_now, force_N, frame_m, frame_mps
                        )
                else:
                    force_N = k_d * (s_d - x) + h_d * (drive_velocity_mps - v)
                force_f += force_share * (force_N - force_f)
                position_f += position_share * (x - position_f)
                drive_f += position_share * (s_d - drive_f)
                mass_f += accel_share * (accel - mass_f)
                base_f += accel_share * (base_accel + yield_mps2 - base_f)
                mass_slow_f += slow_share * (mass_f - mass_slow_f)
                base_slow_f += slow_share * (base_f - base_slow_f)
            if disturbed:
                analogue[0, sample] = force_reading_N(p, s, force_f, t_s)
                analogue[1, sample] = (1.0 + p.mass_accel_ratio) * (mass_f - mass_slow_f)
                analogue[2, sample] = (1.0 + p.base_accel_ratio) * (base_f - base_slow_f)
            else:
                analogue[0, sample] = force_f
                analogue[1, sample] = mass_f - mass_slow_f
                analogue[2, sample] = base_f - base_slow_f
            analogue[3, sample] = position_f
            analogue[4, sample] = drive_f
            truth[0, sample] = force_N
            truth[1, sample] = truth[0, sample] - m * accel
            truth[2, sample] = v
            truth[3, sample] = z
            truth[4, sample] = x
            truth[5, sample] = s_d

        s.dt_s, s.sticks = dt, 1 if sticks else 0
        s.x, s.v, s.z, s.v_r, s.g, s.s_d, s.even_m = x, v, z, v_r, g, s_d, even_m
        s.amplitude_m = u0
        s.phi = (s.phi + omega * fine_dt * (samples * steps_per_sample)) % TWO_PI if vibrating else 0.0
        s.force_f, s.mass_position_f, s.drive_position_f = force_f, position_f, drive_f
        s.mass_accel_f, s.mass_accel_slow_f = mass_f, mass_slow_f
        s.base_accel_f, s.base_accel_slow_f = base_f, base_slow_f
        if disturbed:
            s.frame_m, s.frame_mps, s.base_m, s.base_mps = frame_m, frame_mps, base_m, base_mps
            s.t_s, s.age_s, s.v_lag, s.drive_N, s.arm_N = t_s, age_s, v_lag, force_N, arm_N
            s.vibrating_s = vibrating_s + block_s if vibrating else 0.0

    # `shared_kernel` looks the function up in the module by this name
    advance.__name__ = advance.__qualname__ = "advance_disturbed" if disturbed else "advance"
    return shared_kernel(advance)


advance = _compiled(disturbed=False)
advance_disturbed = _compiled(disturbed=True)
