"""The drive's velocity, its direction and its standstill, from the drive position."""

import math

from bridge.kernel import Record, kernel
from controller.estimate.windows import BINS, DRIVE, FORCE

_SIGMAS = 6.0  # 1e-9 a window that a standing drive is called moving
_UNSURE_SIGMAS, _WELL_KNOWN = 9.0, 40  # the same while the noise of the window is known from fewer differences
_AGREE_SIGMAS = 5.0  # of the shorter of two neighbours, within which their slopes are of one velocity
_AFTER_STOP_S = 0.01  # shortest of the longest windows after a stop
_EXACT = 0.005  # of v_d: noise at which no longer window is asked
_SURE = 0.03  # noise of v_d, over it, up to which it is held: the first windows of a move are off by a third
_STEADY = 0.04  # change of v_d, over it, from which the drive is not steady
# Of a move, in which a force that climbs may say so before the position does: at 50 N/um breakaway comes after 6 ms.
_BY_FORCE_S = 0.02
_HOLD_S = 0.1  # in which the held velocity falls to a third: what a slide still does after a step of the drive


@kernel
def drive_velocity(p: Record, s: Record, tick_s: float) -> None:
    """Measure v_d [m/s], positive and negative, and whether the drive moves.

    It moves if the shortest window that says so is not contradicted by a shorter one that would have seen it, as after a stop.
    From there on, ever longer windows as long as each agrees with the one before (Lepski's rule), until the noise is small.
    """
    velocity_mps, sigma_mps = 0.0, 0.0
    first = -1
    for level in range(p.levels):
        if s.pushed[level] < BINS:
            break
        # windows that reach back before a stop hold the move; they end up to one bin ago
        if s.moving == 0 and p.window_s[level] * (1.0 + 1.0 / BINS) > max(s.stood_s, _AFTER_STOP_S):
            break
        sigma = s.noise[DRIVE, level]
        if sigma == 0.0:
            continue
        slope = s.slope[DRIVE, level]
        if first >= 0 and (sigma_mps < _EXACT * math.fabs(slope)):
            break
        agrees = math.fabs(slope - velocity_mps) <= _AGREE_SIGMAS * sigma_mps
        if first >= 0 and not agrees and level > first + 1:
            break
        velocity_mps, sigma_mps = slope, sigma
        if first < 0 or not agrees:  # what the next window does not confirm was noise
            sure = _SIGMAS if s.differences[level] >= _WELL_KNOWN else _UNSURE_SIGMAS
            first = level if math.fabs(slope) > max(sure * sigma, p.least_feed_mps) else -1
    moving = first >= 0 and not _stopped(s, first)
    if p.use_force == 1 and s.moved_s < _BY_FORCE_S and not moving:
        by_force_mps = _climbing(p, s)
        if by_force_mps != 0.0:
            velocity_mps, moving = by_force_mps, True
    s.measured = 1 if sigma_mps > 0.0 else 0
    s.moving = 1 if moving else 0
    s.drive_velocity_mps, s.drive_velocity_sigma_mps = velocity_mps if moving else 0.0, sigma_mps
    speed_mps = math.fabs(velocity_mps) if moving else 0.0
    if math.fabs(speed_mps - s.steady_mps) > _STEADY * s.steady_mps:
        s.steady_mps, s.steady_s = speed_mps, 0.0
    s.steady_s += tick_s
    if moving:
        direction = 1 if velocity_mps > 0.0 else -1
        if direction != s.direction:
            s.direction = direction
            s.moved_s = 0.0
        s.moved_s += tick_s
        s.stood_s = 0.0
    else:
        s.moved_s = 0.0
        s.stood_s += tick_s
    s.held_mps *= 1.0 - min(tick_s / _HOLD_S, 1.0)
    if moving and sigma_mps < _SURE * speed_mps:
        s.held_mps = max(s.held_mps, speed_mps)


@kernel
def _stopped(s: Record, level: int) -> bool:
    """Whether a window shorter than that of `level` would have seen its velocity, and did not: it is the tail of a stop."""
    for i in range(level):
        sigma = s.noise[DRIVE, i]
        slope = s.slope[DRIVE, level]
        if (
            sigma > 0.0
            and 2.0 * _SIGMAS * sigma <= math.fabs(slope)
            and s.slope[DRIVE, i] * slope < 0.5 * slope * slope
        ):
            return True
    return False


@kernel
def _climbing(p: Record, s: Record) -> float:
    """Velocity of a drive that winds up its spring against a slide that sticks [m/s]; 0 where the positions exclude it."""
    for level in range(p.levels):
        if s.pushed[level] < BINS or p.window_s[level] > _BY_FORCE_S:
            break
        noise_N_per_s, noise_mps = s.noise[FORCE, level], s.noise[DRIVE, level]
        velocity_mps = s.slope[FORCE, level] / s.stiffness_N_per_m
        if s.differences[level] >= _WELL_KNOWN and math.fabs(s.slope[FORCE, level]) > _SIGMAS * noise_N_per_s:
            seen = math.fabs(velocity_mps - s.slope[DRIVE, level]) < _SIGMAS * noise_mps
            return velocity_mps if seen and math.fabs(velocity_mps) > p.least_feed_mps else 0.0
    return 0.0
