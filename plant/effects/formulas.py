"""The formulas of the effects that run inside the kernel. Symbols as in the package note; `p` is the record PARAMS."""

import math

from bridge.kernel import Record, kernel

TWO_PI = 2.0 * math.pi
_EVENED = 200  # rounds, of half a step each: whole ones swing ever wider where the speed more than doubles
_HALVINGS = 44
LAG_CELL_S = 2e-5  # of the line that remembers the speed: 11 of them in a period at 4.5 kHz


@kernel
def _value(index: float, seed: float) -> float:
    """A number of unit variance that belongs to a lattice point: the same on every machine, no generator needed."""
    mixed = math.sin(index * 12.9898 + seed * 78.233) * 43758.5453
    return (mixed - math.floor(mixed) - 0.5) * math.sqrt(12.0)


@kernel
def smooth_noise(at: float, seed: float) -> float:
    """Noise with mean 0 and variance 1, smooth, with a new value at every whole number."""
    index = math.floor(at)
    share = at - index
    share = share * share * (3.0 - 2.0 * share)
    # the mean of (1 - share)^2 + share^2 over a cell is 26/35
    return (_value(index, seed) * (1.0 - share) + _value(index + 1.0, seed) * share) / math.sqrt(26.0 / 35.0)


@kernel
def wave(angle_rad: float, second_sin: float, second_cos: float) -> float:
    """A sine with its second harmonic."""
    return with_second(math.sin(angle_rad), math.cos(angle_rad), second_sin, second_cos)


@kernel
def with_second(sin: float, cos: float, second_sin: float, second_cos: float) -> float:
    """A sine with its second harmonic, from the sine and the cosine of its angle."""
    return sin + second_sin * 2.0 * sin * cos + second_cos * (1.0 - 2.0 * sin * sin)


@kernel
def even_m(p: Record, drive_m: float) -> float:
    """Where an even drive would be when one with a screw's lead errors is at `drive_m`.

    The errors are the integral of the velocity's ripple over the even position, without a mean.
    """
    found_m = drive_m
    if p.ripple_wavelength_m > 0.0:
        per_rad_m = p.ripple_wavelength_m / TWO_PI
        for _ in range(_EVENED):
            sin = math.sin(found_m / per_rad_m + p.ripple_phase_rad)
            cos = math.cos(found_m / per_rad_m + p.ripple_phase_rad)
            error = p.ripple_cos_2 * sin * cos - cos - 0.5 * p.ripple_sin_2 * (2.0 * cos * cos - 1.0)
            found_m += 0.5 * (drive_m - p.ripple_ratio * per_rad_m * error - found_m)
    return found_m


@kernel
def level(p: Record, t_s: float, x: float, v_r: float, load_sin: float, load_cos: float) -> float:
    """What the friction is multiplied by, here and now; the load's wave has come to the angle of this sine and cosine."""
    result = 1.0 + p.drift_per_s * t_s
    if p.drift_settling_s > 0.0:
        result += p.drift_ratio * (1.0 - math.exp(-(p.drift_before_s + t_s) / p.drift_settling_s))
    result = max(result, 0.0)
    if p.position_ratio != 0.0:
        if p.position_seed < 0.0:
            angle_rad = TWO_PI * x / p.position_wavelength_m + p.position_phase_rad
            if p.position_width > 0.0:
                apart = angle_rad / TWO_PI - math.floor(angle_rad / TWO_PI + 0.5)
                along = math.exp(-0.5 * (apart / p.position_width) ** 2)
            else:
                along = wave(angle_rad, p.position_sin_2, p.position_cos_2)
            if p.position_other_share != 0.0:
                other_rad = TWO_PI * x / p.position_other_wavelength_m + p.position_other_phase_rad
                along += p.position_other_share * math.sin(other_rad)
        else:
            along = smooth_noise(2.0 * x / p.position_wavelength_m, p.position_seed)
        result *= max(1.0 + p.position_ratio * along, 0.0)
    if p.load_ratio != 0.0:
        if p.load_seed < 0.0:
            load = with_second(load_sin, load_cos, p.load_sin_2, p.load_cos_2)
        else:
            load = smooth_noise(2.0 * p.load_frequency_Hz * t_s, p.load_seed)
        result *= max(1.0 + p.load_ratio * load, 0.0)
    if p.roughness_ratio != 0.0:
        result *= max(1.0 + p.roughness_ratio * smooth_noise(x / p.roughness_length_m, p.roughness_seed), 0.0)
    # a slide that lifts off is not this model's; nor do two factors below 0 make friction
    return max(result * (1.0 + (p.forward_ratio if v_r >= 0.0 else p.backward_ratio)), 0.01)


@kernel
def late_mps(p: Record, s: Record, t_s: float, speed_mps: float) -> float:
    """The speed as it was `lag_dead_s` ago; 0 before t = 0.

    Cell k of a line holds the speed at k cells: from the last one that is filled to now the speed is taken for straight, however
    many cells a step is long.
    """
    length = len(s.lag_line)
    now = t_s / LAG_CELL_S
    last = s.lag_at
    speed_then_mps = s.lag_line[last % length]
    while s.lag_at + 1 <= now:
        s.lag_at += 1
        s.lag_line[s.lag_at % length] = speed_then_mps + (speed_mps - speed_then_mps) * (s.lag_at - last) / (now - last)
    back = now - p.lag_dead_s / LAG_CELL_S
    whole = math.floor(back)
    older = s.lag_line[whole % length]
    if whole >= s.lag_at:  # less than a cell ago
        return older + (back - whole) / max(now - whole, 1e-9) * (speed_mps - older)
    return older + (back - whole) * (s.lag_line[(whole + 1) % length] - older)


@kernel
def ageing_N(p: Record, age_s: float) -> float:
    """By how much the static friction at this age of the contact is above F_s."""
    if p.age_exponent > 0.0:
        return p.age_growth_N * age_s**p.age_exponent - p.age_rested_N
    if p.age_settling_s > 0.0:
        return p.age_growth_N * (1.0 - math.exp(-age_s / p.age_settling_s)) - p.age_rested_N
    return p.age_growth_N * math.log(1.0 + age_s / p.age_scale_s) - p.age_rested_N


@kernel
def spring_N(p: Record, extension_m: float) -> float:
    """Force of the drive's spring with backlash, hardening and a knee."""
    slack = 0.5 * p.gap_m
    e = extension_m - min(max(extension_m, -slack), slack)
    if p.hardening_per_m2 < 0.0:
        # beyond its largest force a softening spring would push instead of pull, the further the harder
        yield_m = math.sqrt(-1.0 / (3.0 * p.hardening_per_m2))
        e = min(max(e, -yield_m), yield_m)
    force_N = p.k_d * e * (1.0 + p.hardening_per_m2 * e * e)
    if p.knee_ratio != 0.0:
        force_N += p.knee_ratio * p.k_d * (e - min(max(e, -p.knee_m), p.knee_m))
    return force_N


@kernel
def extension_m(p: Record, force_N: float) -> float:
    """Of the drive's spring, where it has this force: by halving, to 1e-12 of that of a linear spring.

    The softest spring, bilinear with a ratio of -0.9, is extended ten times as far.
    """
    found_m = 0.0
    step_m = 10.0 * force_N / p.k_d + math.copysign(0.5 * p.gap_m, force_N)
    for _ in range(_HALVINGS):
        step_m *= 0.5
        if math.fabs(spring_N(p, found_m + step_m)) < math.fabs(force_N):
            found_m += step_m
    return found_m


@kernel
def elasto_plastic_share(z: float, v_r: float, g: float, k_t: float, breakaway_ratio: float) -> float:
    """Share alpha of sliding in the bristle's motion: elastic, then a sine, 1 as in LuGre (Dupont et al. 2002, eq. 14)."""
    elastic = 1e-6  # of 0, which the contact divides by
    if z * v_r <= 0.0:
        return elastic
    reach = math.fabs(z) * k_t / g  # 1 in steady sliding
    if reach <= breakaway_ratio:
        return elastic
    if reach >= 1.0:
        return 1.0
    return elastic + (1.0 - elastic) * (
        0.5 + 0.5 * math.sin(math.pi * (reach - 0.5 * (1.0 + breakaway_ratio)) / (1.0 - breakaway_ratio))
    )
