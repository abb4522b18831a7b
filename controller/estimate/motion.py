"""The drive's velocity, its direction and its standstill, from the drive position."""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from controller.estimate.compliance import least_compliance
from controller.estimate.windows import BINS, DRIVE, FORCE, SLIDE, WELL_KNOWN

_SIGMAS = 6.0  # least slope of a moving drive, in sigmas: error rate of 1e-9 a window at rest
_UNSURE_SIGMAS = 9.0  # the same limit while the noise is known from fewer than 40 differences
_AGREE_SIGMAS = 5.0  # largest difference of neighbouring windows of the same velocity, in sigmas of the shorter window
_AFTER_STOP_S = 0.01  # longest window just after a stop; later, windows begin after the stop
_EXACT = 0.005  # noise over v_d at which no longer window is needed
_SURE = 0.03  # largest noise over v_d at which `held_mps` rises: the first windows of a move are wrong by a third
_STEADY = 0.04  # smallest relative change of v_d that restarts the time of constant v_d
# Standstill after which the slide counts as at rest. Shorter: a slide that still slides counts as stuck when the drive only
# became too slow to be detected at once.
_RESTED_S = 0.2
_SURELY_SIGMAS = 3.3  # sigmas of v_d that are added to the v_d that vibration must exceed
_ROUGHLY = 0.1  # largest noise over velocity of a window that may show an acceleration of the drive
_MOST_AHEAD = 1.3  # largest extrapolation over a window's velocity: it overshoots at the end of an acceleration
_OF_TWO = 1.8  # sigma of (twice a slope minus the slope of the window twice as long), over the sigma of the slope
_RISE_SIGMAS = 5.0  # sigmas of a lower bound of v_d; with 3, v_a jumps once a second and the slide runs ahead
_HUM_S = 0.1  # five periods of mains hum, after which its noise is known
_EXCITER_PERIODS = 2.0  # least length of a window of the force, in periods of the exciter
_LONGEST_RISE = 3  # number of levels above the level of v_d that are searched for an acceleration
# First part of a move, and longest window, in which a climbing force shows motion: at 50 N/um breakaway follows after 6 ms.
_BY_FORCE_S = 0.02
_FORCE_SETTLES_S = 0.05  # time after a vibration in which the friction returns, and the force climbs with it
_HOLD_S = 0.1  # time constant of the held velocity, as a slide still moves after a step of the drive


@kernel
def drive_velocity(p: ControllerParams, s: ControllerMemory, tick_s: float) -> None:
    """Measure v_d [m/s], positive and negative, and whether the drive moves.

    The drive moves if a window shows motion and no shorter window with enough resolution contradicts, as after a stop. From that
    window on, longer windows are used while each agrees with the window before (Lepski's rule), until the noise is small.
    """
    velocity_mps, sigma_mps = 0.0, 0.0
    first, taken = -1, 0
    for level in range(p.levels):
        if s.pushed[level] < BINS:
            break
        # windows that reach back before a stop contain the move; they end up to one bin ago
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
        velocity_mps, sigma_mps, taken = slope, sigma, level
        if first < 0 or not agrees:  # motion that the next window does not confirm was noise
            sure = _SIGMAS if s.differences[level] >= WELL_KNOWN else _UNSURE_SIGMAS
            first = level if math.fabs(slope) > max(sure * sigma, p.least_feed_mps) else -1
    moving = first >= 0 and not _stopped(s, first)
    unsure = moving and s.moving == 0 and s.pushed[0] * p.bin_s < _HUM_S and p.use_slide_position == 1
    unsure = unsure and not _winds_up(s, first)
    moving = moving and not unsure
    quiet = s.allowed_m == 0.0 and s.silent_steps * p.block_s > _FORCE_SETTLES_S
    if p.use_force == 1 and s.moved_s < _BY_FORCE_S and not moving and quiet:
        by_force_mps = _climbing(p, s)
        if by_force_mps != 0.0:
            velocity_mps, moving = by_force_mps, True
    if not moving and s.moving == 1 and not _stands(p, s):
        velocity_mps, moving = s.drive_velocity_mps, True
    s.measured = 1 if sigma_mps > 0.0 and not unsure else 0
    s.moving = 1 if moving else 0
    s.drive_velocity_mps, s.drive_velocity_sigma_mps = velocity_mps if moving else 0.0, sigma_mps
    speed_mps = math.fabs(velocity_mps) if moving else 0.0
    if math.fabs(speed_mps - s.steady_mps) > _STEADY * s.steady_mps:
        s.steady_mps, s.steady_s = speed_mps, 0.0
    s.steady_s += tick_s
    if moving:
        direction = 1 if velocity_mps > 0.0 else -1
        turned = direction != s.direction
        if turned:
            s.direction = direction
            s.moved_s = 0.0
        if s.moved_s == 0.0:
            s.rested = 1 if turned or s.stood_s > _RESTED_S else 0
        s.moved_s += tick_s
        s.stood_s = 0.0
    else:
        s.moved_s = 0.0
        s.stood_s = s.stood_s + tick_s if not unsure else 0.0
    # v_a at the least ratio is then above v_d except with a probability of 5e-4
    surely_mps = (speed_mps + _SURELY_SIGMAS * sigma_mps) / p.least_ratio
    s.rising_mps = max(_rising(p, s, speed_mps, taken), surely_mps) if moving else 0.0
    s.held_mps *= 1.0 - min(tick_s / _HOLD_S, 1.0)
    if moving and sigma_mps < _SURE * speed_mps:
        s.held_mps = max(s.held_mps, speed_mps)


@kernel
def _rising(p: ControllerParams, s: ControllerMemory, speed_mps: float, taken: int) -> float:
    """Lower bound of |v_d| at the end of the windows [m/s]; `speed_mps` holds for the middle of level `taken`.

    At a constant acceleration v_d now = 2 slope - slope of the window twice as long. Short windows are noisy, long windows lag:
    the highest lower bound counts, up to the upper bounds of the shorter windows.
    """
    rising_mps, most_mps = speed_mps, math.inf
    for level in range(min(taken + _LONGEST_RISE, p.levels - 1)):
        if s.pushed[level + 1] < BINS:
            break
        sigma, slope = s.noise[DRIVE, level], s.direction * s.slope[DRIVE, level]
        if sigma == 0.0 or s.differences[level] < WELL_KNOWN or sigma > _ROUGHLY * slope:
            continue
        now_mps = min(2.0 * slope - s.direction * s.slope[DRIVE, level + 1], _MOST_AHEAD * slope)
        least_mps = max(now_mps - _RISE_SIGMAS * _OF_TWO * sigma, slope - _RISE_SIGMAS * sigma)
        rising_mps = max(rising_mps, min(least_mps, most_mps))
        most_mps = min(most_mps, max(now_mps, slope) + _RISE_SIGMAS * _OF_TWO * sigma)
    return max(rising_mps, min(_pulling(p, s), most_mps))


@kernel
def _pulling(p: ControllerParams, s: ControllerMemory) -> float:
    """Lower bound of |v_d| by the spring [m/s]: v_s of a longer window plus F' / k_d of a shorter window, while it pulls.

    A slide under vibration continues at its v_s when the drive speeds up, and the spring winds up by the difference.
    """
    least_mps = 0.0
    if p.use_force == 0 or s.stiffness_learnt == 0 or s.slipping == 1 or s.direction * s.bins[FORCE, 0, 0] <= 0.0:
        return least_mps
    for level in range(p.levels):
        if s.pushed[level] < BINS or p.window_s[level] > _BY_FORCE_S:
            break
        if p.window_s[level] * s.allowed_Hz >= _EXCITER_PERIODS or s.allowed_m == 0.0:
            surely_N_per_s = s.direction * s.slope[FORCE, level] - _RISE_SIGMAS * s.noise[FORCE, level]
            least_mps = max(least_mps, surely_N_per_s * least_compliance(s))
    return least_mps + min(s.fine_mps, math.fabs(s.drive_velocity_mps)) if least_mps > 0.0 else 0.0


@kernel
def _stopped(s: ControllerMemory, level: int) -> bool:
    """Whether the drive stopped: a window shorter than `level` resolves half of its velocity and shows less."""
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
def _winds_up(s: ControllerMemory, level: int) -> bool:
    """Whether the drive moves relative to the slide: true at a start, false for hum on both positions.

    Used only at the start of the run, until some periods of the hum are in the measured noise.
    """
    slope = s.slope[DRIVE, level]
    return (slope - s.slope[SLIDE, level]) * slope > 0.5 * slope * slope


@kernel
def _stands(p: ControllerParams, s: ControllerMemory) -> bool:
    """Whether the drive stopped: the first window of the move that resolves half of its last velocity shows less.

    Without this test a drive that starts is detected and lost in turns, as windows that reach back before the start disagree.
    """
    half_mps = 0.5 * s.drive_velocity_mps
    for level in range(p.levels):
        sigma = s.noise[DRIVE, level]
        if s.pushed[level] < BINS or p.window_s[level] > s.moved_s:
            return False
        if sigma > 0.0 and _SIGMAS * sigma <= math.fabs(half_mps):
            return s.slope[DRIVE, level] * half_mps < half_mps * half_mps
    return True


@kernel
def _climbing(p: ControllerParams, s: ControllerMemory) -> float:
    """Velocity of a drive that winds up its spring against a stuck slide [m/s]; 0 where the positions exclude it."""
    if least_compliance(s) == 0.0:
        return 0.0
    for level in range(p.levels):
        if s.pushed[level] < BINS or p.window_s[level] > _BY_FORCE_S:
            break
        noise_N_per_s, noise_mps = s.noise[FORCE, level], s.noise[DRIVE, level]
        velocity_mps = s.slope[FORCE, level] * s.compliance_m_per_N
        if s.differences[level] >= WELL_KNOWN and math.fabs(s.slope[FORCE, level]) > _SIGMAS * noise_N_per_s:
            seen = math.fabs(velocity_mps - s.slope[DRIVE, level]) < _SIGMAS * noise_mps
            return velocity_mps if seen and math.fabs(velocity_mps) > p.least_feed_mps else 0.0
    return 0.0
