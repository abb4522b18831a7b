"""What the controller learns of the axis: the drive's stiffness, and the breakaway and sliding force of each direction."""

import math

from bridge.kernel import Record, kernel
from controller.codes import SMOOTH, STICK
from controller.estimate.windows import BINS, DRIVE, FORCE, SLIDE

# Elongation rate over its noise from which a window teaches. Smaller: the noise of the positions makes k_d too small, by
# 1 / 6^2 = 3 % at most here.
_SIGMAS = 6.0
_KEPT = 0.9983  # of what was learnt of the stiffness, at each window that teaches: half of it over 400 of them
_FEWEST = 5.0  # windows until the told stiffness gives way to the learnt one
_TOLD_SIGMA = 0.5  # of a told stiffness, over itself
_STEADY_S = 0.05  # of constant v_d until a climbing force says something of the stiffness
_SLIP_SHARE = 0.3  # of one more slip in the learnt breakaway and swing
_SLIDING_S = 0.3  # time constant of the learnt sliding force


@kernel
def stiffness(p: Record, s: Record) -> None:
    """Learn k_d, the force over the elongation of the drive: from rates, so that no offset matters.

    The window that shows the elongation best teaches. Where none does, a told stiffness is at least what a climbing force says:
    no force climbs faster than k_d v_d.
    """
    if p.use_force == 0:
        return
    best, best_level = _SIGMAS * _SIGMAS, -1
    for level in range(p.levels if p.use_slide_position == 1 else 0):
        if s.pushed[level] < 2 * BINS:
            break
        variance = s.noise[SLIDE, level] * s.noise[SLIDE, level] + s.noise[DRIVE, level] * s.noise[DRIVE, level]
        rate_mps = s.slope[DRIVE, level] - s.slope[SLIDE, level]
        if rate_mps * rate_mps > best * variance and variance > 0.0:
            best, best_level = rate_mps * rate_mps / variance, level
    if best_level >= 0:
        rate_mps = s.slope[DRIVE, best_level] - s.slope[SLIDE, best_level]
        s.taught = _KEPT * s.taught + 1.0
        # each window by its own scale, so that one fast slip does not outweigh a hundred sticks
        s.taught_ratio = _KEPT * s.taught_ratio + s.slope[FORCE, best_level] / rate_mps
        s.taught_square = _KEPT * s.taught_square + (s.slope[FORCE, best_level] / rate_mps) ** 2
        mean = s.taught_ratio / s.taught
        scatter = math.sqrt(max(s.taught_square / s.taught - mean * mean, 0.0))
        if s.taught >= _FEWEST and mean > 0.0:
            sigma = scatter / mean / math.sqrt(s.taught)
            if sigma < _TOLD_SIGMA or s.stiffness_learnt == 1:
                s.stiffness_N_per_m, s.stiffness_sigma, s.stiffness_learnt = mean, min(max(sigma, 0.01), 1.0), 1
    elif s.stiffness_learnt == 0 and s.moving == 1 and s.level >= 0 and s.steady_s > _STEADY_S:
        climbing_N_per_m = s.direction * s.slope[FORCE, s.level] / math.fabs(s.drive_velocity_mps)
        sure_N_per_m = _SIGMAS * s.sigma[FORCE, s.level] / math.fabs(s.drive_velocity_mps)
        if climbing_N_per_m - sure_N_per_m > s.stiffness_N_per_m:
            s.stiffness_N_per_m = climbing_N_per_m


@kernel
def begin(p: Record, s: Record) -> None:
    """Start from the told stiffness."""
    s.stiffness_N_per_m = p.drive_stiffness_N_per_m
    s.stiffness_sigma = _TOLD_SIGMA
    s.direction = 1


@kernel
def forces(s: Record, force_N: float, tick_s: float) -> None:
    """Learn the breakaway force at slips, and the sliding force in smooth sliding, both without vibration."""
    way = 0 if s.direction > 0 else 1
    along_N = s.direction * force_N
    s.peak_N = max(s.peak_N, along_N)
    if s.allowed_m == 0.0:
        if s.slip_began == 1 and s.peak_N > 0.0:
            known_N = s.breakaway_N[way]
            s.breakaway_N[way] = s.peak_N if known_N == 0.0 else known_N + _SLIP_SHARE * (s.peak_N - known_N)
            s.slip_from_N = s.peak_N
        if s.slipping == 0 and s.slip_from_N > 0.0:
            fell_N, known_N = s.slip_from_N - along_N, s.swing_N[way]
            s.swing_N[way] = fell_N if known_N == 0.0 else known_N + _SLIP_SHARE * (fell_N - known_N)
            s.slip_from_N = 0.0
        if s.contact == SMOOTH and s.smooth_s > s.window_s:
            known_N = s.sliding_N[way]
            s.sliding_N[way] = along_N if known_N == 0.0 else known_N + tick_s / _SLIDING_S * (along_N - known_N)
    if s.slipping == 0 and s.contact != STICK:
        s.peak_N = along_N
