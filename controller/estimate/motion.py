"""The drive's velocity, its direction and its standstill, from the drive position."""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from controller.estimate.windows import BINS, DRIVE, SIGMAS, SLIDE

_EXACT = 0.005  # noise over v_d at which no longer window is needed
_STEADY = 0.04  # smallest relative change of v_d that restarts the time of constant v_d
# Sigmas from an extrapolated v_d down to the v_d that v_a is for, while v_d changes. Larger: at 5 an axis of 10 N/um slips at two
# of five reversals. Smaller: noise raises v_a, which releases a wound-up spring.
_RISES = 4.0
# Longer windows that are extrapolated, too. Larger: at 3 `stops-moves` has 5 slips. Smaller: at 1 `stops-stiff` has 3 (1).
_LEVELS = 2
_HUM_S = 0.1  # five periods of mains hum, after which its noise is known
_HOLD_S = 0.1  # time constant of the held velocity, as a slide still moves after a step of the drive


@kernel
def drive_velocity(p: ControllerParams, s: ControllerMemory, tick_s: float) -> None:
    """Measure v_d [m/s], positive and negative, and whether the drive moves.

    The shortest window that shows motion begins it. From it on, longer windows are used while each agrees with the window before
    (Lepski's rule), until the noise is small. Without such a window a moving drive keeps its velocity until it stops.
    """
    velocity_mps, sigma_mps, first, sign, rising_mps = 0.0, 0.0, -1, 1.0, 0.0
    # as the run begins, hum on both positions looks like motion: only a drive that moves against its slide starts
    hums = p.use_slide_position == 1 and s.moving == 0 and s.pushed[0] * p.bin_s < _HUM_S
    for level in range(p.levels):
        # windows that reach back before a stop contain the move; they end up to one bin ago
        if s.pushed[level] < BINS or (s.moving == 0 and p.window_s[level] * (1.0 + 1.0 / BINS) > s.stood_s):
            break
        slope_mps, noise_mps = s.slope[DRIVE, level], s.noise[DRIVE, level]
        if noise_mps == 0.0:
            continue
        if first < 0:
            against_mps = slope_mps - s.slope[SLIDE, level] if hums else slope_mps
            if min(math.fabs(slope_mps), math.fabs(against_mps)) <= max(SIGMAS * noise_mps, p.least_feed_mps):
                continue
            first, sign = level, 1.0 if slope_mps > 0.0 else -1.0
        elif sigma_mps < _EXACT * math.fabs(velocity_mps) or math.fabs(slope_mps - velocity_mps) > SIGMAS * sigma_mps:
            break
        velocity_mps, sigma_mps = slope_mps, noise_mps
        along_mps, sigmas = slope_mps * sign, SIGMAS
        # a drive that accelerates evenly is faster now by the difference from the window of twice the length
        if s.steady_s < _HOLD_S and level <= first + _LEVELS and level + 1 < p.levels and s.pushed[level + 1] >= BINS:
            along_mps += max(along_mps - max(s.slope[DRIVE, level + 1] * sign, 0.0), 0.0)
            sigmas = _RISES
        rising_mps = max(rising_mps, along_mps - sigmas * noise_mps)
    if first < 0 and s.moving == 1:
        velocity_mps, sigma_mps = s.drive_velocity_mps, s.drive_velocity_sigma_mps
    if _stopped(p, s, velocity_mps, first):
        velocity_mps = 0.0
    s.moving = 1 if velocity_mps != 0.0 else 0
    s.drive_velocity_mps, s.drive_velocity_sigma_mps = velocity_mps, sigma_mps
    speed_mps = math.fabs(velocity_mps)
    s.rising_mps = rising_mps if s.moving == 1 else 0.0
    if math.fabs(speed_mps - s.steady_mps) > _STEADY * s.steady_mps:
        s.steady_mps, s.steady_s = speed_mps, 0.0
    s.steady_s += tick_s
    if s.moving == 1:
        direction = 1 if velocity_mps > 0.0 else -1
        s.moved_s = tick_s if direction != s.direction else s.moved_s + tick_s
        s.direction, s.stood_s = direction, 0.0
    else:
        s.moved_s, s.stood_s = 0.0, s.stood_s + tick_s
    s.held_mps = max(s.held_mps * (1.0 - min(tick_s / _HOLD_S, 1.0)), speed_mps)


@kernel
def _stopped(p: ControllerParams, s: ControllerMemory, velocity_mps: float, first: int) -> bool:
    """Whether a drive of this velocity stopped: the shortest window of the move that resolves half of it shows less.

    `first` is the level of the shortest window that shows motion; longer windows may reach back before a change. -1: no level.
    """
    for level in range(first if first >= 0 else p.levels):
        if s.pushed[level] < BINS or p.window_s[level] > s.moved_s:
            return False
        noise_mps = s.noise[DRIVE, level]
        if noise_mps > 0.0 and SIGMAS * noise_mps <= 0.5 * math.fabs(velocity_mps):
            return s.slope[DRIVE, level] * velocity_mps < 0.5 * velocity_mps * velocity_mps
    return first < 0 and s.noise[DRIVE, 0] > 0.0
