"""Force and positions against the law of the drive's spring: F' = k_d (v_d - v_s).

The law holds while the slide sticks, slips, slides and vibrates. It is broken if the spring winds up and the force is dead,
frozen or has another gain or sign, and if a position has another unit. It is checked in the shortest window in which half of v_d
exceeds the noise, and trips once it is broken for longer than a jump stays in a window. The drive position is doubted if v_d
changed, the slide position if it is faster than drive and spring explain, else the force. Until the trip v_d keeps its value
before the break, and slips do not count.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import DRIVE_DOUBTED, FORCE_DOUBTED, SLIDE_DOUBTED
from controller.estimate.windows import BINS, DRIVE, FORCE, SLIDE, WELL_KNOWN
from controller.trips.delivered import SOME
from controller.trips.doubts import CONTACT, trip
from controller.trips.doubts import DRIVE as DRIVE_DOUBT

SHORTEST_S = 0.01  # shortest window; in a shorter one a force with a delay of 2 ms breaks the law in every slip
HOLD_S, _WINDOWS = 0.05, 2.0  # time for which the law is broken until a trip; number of windows added to it
FIRST_S = 0.015  # first part of HOLD_S, whose changes of v_d and v_s decide which signal is doubted
_OF_COMPLIANCE = 3.0  # sigmas of c that a broken law must exceed: an axis of unknown stiffness breaks no law
_SIGMAS = 8.0  # least ratio of half of v_d to the noise in a window
# Largest difference of the law's two sides, over the larger: for a spring that is softer or stiffer by a factor of 5; by a factor
# of 20 while k_d is configured and not learnt yet.
_OFF, _TOLD_OFF = 0.8, 0.95
_SURE = 0.06  # largest relative sigma of a learnt stiffness that replaces the stiffness used here
_HALF = 0.5  # smallest difference of the law's two sides that counts, over v_d
_TWICE = 2.0  # change of v_d over change of v_s to doubt the drive; v_s over v_d or F' / k_d to doubt the slide


@kernel
def watch_spring(p: ControllerParams, s: ControllerMemory) -> None:
    """Check a window; trip if the law is broken for too long. Called every SOME steps."""
    level = _level(p, s)
    if level < 0:
        return
    unsure = s.kept_m_per_N > 0.0 and s.stiffness_learnt == 1 and s.compliance_sigma > _SURE * s.compliance_m_per_N
    if s.broken_steps == 0 and not unsure:  # during a fault, or by noise if no spring winds up, c is learnt wrongly
        s.kept_m_per_N = s.compliance_m_per_N
    by_force_mps = s.slope[FORCE, level] * s.kept_m_per_N
    drive_mps, slide_mps = s.slope[DRIVE, level], s.slope[SLIDE, level]
    apart_mps = drive_mps - slide_mps
    off_mps = math.fabs(apart_mps - by_force_mps)
    larger_mps = max(math.fabs(apart_mps), math.fabs(by_force_mps))
    counts_mps = _HALF * _largest_mps(p, s) + _OF_COMPLIANCE * s.compliance_sigma * math.fabs(s.slope[FORCE, level])
    most_off = _OFF if s.stiffness_learnt == 1 else _TOLD_OFF
    if off_mps <= most_off * larger_mps or off_mps <= counts_mps:
        s.broken_steps = max(s.broken_steps - (SOME if larger_mps > counts_mps else SOME // 2), 0)
        if s.broken_steps == 0:
            s.kept_mps[DRIVE], s.kept_mps[SLIDE] = drive_mps, slide_mps
        return
    drive_by_mps, slide_by_mps = math.fabs(drive_mps - s.kept_mps[DRIVE]), math.fabs(slide_mps - s.kept_mps[SLIDE])
    if s.broken_steps == 0:
        s.broken_drive, s.broken_slide = 0, 0
    s.broken_steps += SOME
    if s.broken_steps <= p.first_steps:  # after that the slide changes, too, as the vibration follows v_d
        s.broken_drive += 1 if drive_by_mps > _TWICE * slide_by_mps else -1
    fastest_mps = max(math.fabs(drive_mps), math.fabs(s.kept_mps[DRIVE]), math.fabs(by_force_mps))
    s.broken_slide += 1 if math.fabs(slide_mps) > _TWICE * fastest_mps else -1  # a slip is over before it trips
    if s.broken_steps > p.broken_steps + _WINDOWS * p.window_s[level] / p.block_s:
        if s.broken_drive > 0:
            trip(s, DRIVE_DOUBTED, DRIVE_DOUBT)
        elif s.broken_slide > 0:
            trip(s, SLIDE_DOUBTED, CONTACT)
        else:
            trip(s, FORCE_DOUBTED, CONTACT)


@kernel
def _largest_mps(p: ControllerParams, s: ControllerMemory) -> float:
    return max(math.fabs(s.kept_mps[DRIVE]), _HALF * math.fabs(s.drive_velocity_mps), p.least_feed_mps)


@kernel
def _level(p: ControllerParams, s: ControllerMemory) -> int:
    """Level of the shortest windows in which half of v_d exceeds the noise; -1: no level. Constant while the law is broken."""
    if s.broken_steps > 0:
        return s.spring_level
    if not math.isfinite(s.compliance_sigma):
        return -1
    counts_mps = _HALF * _largest_mps(p, s)
    for level in range(p.spring_level, p.levels):
        if s.pushed[level] < 2 * BINS or s.differences[level] < WELL_KNOWN:
            return -1
        by_noise_mps = s.noise[FORCE, level] * s.compliance_m_per_N
        noise_slide, noise_drive = s.noise[SLIDE, level], s.noise[DRIVE, level]
        square = by_noise_mps * by_noise_mps + noise_slide * noise_slide + noise_drive * noise_drive
        if _SIGMAS * _SIGMAS * square < counts_mps * counts_mps:
            s.spring_level = level
            return level
    return -1


@kernel
def is_drive_off(s: ControllerMemory) -> bool:
    """Whether the law is presently broken by a change of the drive position."""
    return s.broken_steps > 0 and s.broken_drive > 0
