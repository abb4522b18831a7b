"""Learnt values of the axis: the drive's stiffness, and the breakaway and sliding force of each direction."""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import SMOOTH, STICK
from controller.estimate.windows import BINS, DRIVE, FEWEST, FORCE, SLIDE

# Least elongation rate over its noise in a window from which k_d is learnt. Smaller: the noise of the positions makes k_d too
# small; at 6 by 1 / 6^2 = 3 % at most.
_SIGMAS = 6.0
_KEPT = 0.9983  # factor of the weight of earlier windows at each new window: a half after 400 windows
_FEWEST = 5.0  # fewest windows until the learnt stiffness replaces the configured stiffness
_TOLD_SIGMA = 0.5  # relative sigma of a configured stiffness; a learnt one must be below it
_STEADY_S = 0.05  # duration of constant v_d until a climbing force bounds the stiffness
_MOST_OFF = 100.0  # largest factor between configured and learnt stiffness: a larger factor means wrong channels
_SLIP_SHARE = 0.3  # weight of a new slip in the learnt breakaway force and in the learnt fall of the force
_SLIDING_S = 0.3  # time constant of the learnt sliding force


@kernel
def stiffness(p: ControllerParams, s: ControllerMemory) -> None:
    """Learn k_d, the force over the elongation of the drive: from rates, so that offsets cancel.

    The window with the highest signal-to-noise ratio of the elongation is used. Without such a window, a climbing force bounds
    the configured stiffness from below: no force climbs faster than k_d v_d.
    """
    if p.use_force == 0:
        return
    best, best_level = _SIGMAS * _SIGMAS, -1
    for level in range(p.levels if p.use_slide_position == 1 else 0):
        # over seconds the positions drift by more than the extrapolated white noise, which looks like a stick
        if s.pushed[level] < 2 * BINS or (s.stiffness_learnt == 1 and s.differences[level] < FEWEST):
            break
        variance = s.noise[SLIDE, level] * s.noise[SLIDE, level] + s.noise[DRIVE, level] * s.noise[DRIVE, level]
        rate_mps = s.slope[DRIVE, level] - s.slope[SLIDE, level]
        # a slide position that never changes by a step is not connected, and would make every spring soft
        if rate_mps * rate_mps > best * variance and s.noise[SLIDE, level] > 0.0:
            best, best_level = rate_mps * rate_mps / variance, level
    if best_level >= 0:
        rate_mps = s.slope[DRIVE, best_level] - s.slope[SLIDE, best_level]
        s.taught = _KEPT * s.taught + 1.0
        # the mean of ratios, so that a fast slip does not outweigh a hundred sticks
        s.taught_ratio = _KEPT * s.taught_ratio + s.slope[FORCE, best_level] / rate_mps
        s.taught_square = _KEPT * s.taught_square + (s.slope[FORCE, best_level] / rate_mps) ** 2
        mean = s.taught_ratio / s.taught
        scatter = math.sqrt(max(s.taught_square / s.taught - mean * mean, 0.0))
        if s.taught >= _FEWEST and mean > 0.0:
            sigma = scatter / mean / math.sqrt(s.taught)
            if sigma < _TOLD_SIGMA or s.stiffness_learnt == 1:
                s.stiffness_N_per_m, s.stiffness_learnt = _bounded(p, mean), 1
                s.stiffness_sigma = min(max(sigma, 0.01), 1.0)
    elif s.stiffness_learnt == 0 and s.moving == 1 and s.level >= 0 and s.steady_s > _STEADY_S:
        climbing_N_per_m = s.direction * s.slope[FORCE, s.level] / math.fabs(s.drive_velocity_mps)
        sure_N_per_m = _SIGMAS * s.sigma[FORCE, s.level] / math.fabs(s.drive_velocity_mps)
        if climbing_N_per_m - sure_N_per_m > s.stiffness_N_per_m:
            s.stiffness_N_per_m = _bounded(p, climbing_N_per_m)


@kernel
def _bounded(p: ControllerParams, stiffness_N_per_m: float) -> float:
    configured_N_per_m = p.drive_stiffness_N_per_m
    return min(max(stiffness_N_per_m, configured_N_per_m / _MOST_OFF), configured_N_per_m * _MOST_OFF)


@kernel
def begin(p: ControllerParams, s: ControllerMemory) -> None:
    """Start from the configured stiffness."""
    s.stiffness_N_per_m = p.drive_stiffness_N_per_m
    s.stiffness_sigma = _TOLD_SIGMA
    s.direction = 1


@kernel
def spring(s: ControllerMemory, elongation_m: float) -> float:
    """Force of the drive's spring from both positions [N], for a rig without a force sensor.

    The spring is assumed to be relaxed at the start; once the slide was dragged both ways, half-way between the largest
    elongations of both directions, as friction is alike in both.
    """
    if s.stretched == 0:
        s.shortest_m, s.longest_m, s.stretched = elongation_m, elongation_m, 1
        s.relaxed_m = elongation_m
    s.shortest_m, s.longest_m = min(s.shortest_m, elongation_m), max(s.longest_m, elongation_m)
    if s.dragged[0] == 1 and s.dragged[1] == 1:
        s.relaxed_m = 0.5 * (s.shortest_m + s.longest_m)
    return s.stiffness_N_per_m * (elongation_m - s.relaxed_m)


@kernel
def forces(s: ControllerMemory, force_N: float, tick_s: float) -> None:
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
    if s.contact == SMOOTH or s.slipping == 1:
        s.dragged[way] = 1
