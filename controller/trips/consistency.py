"""Drive, slide and force against the law of the drive's spring, x_d' - x_s' = c F'.

The law holds while the slide sticks, slips, slides and vibrates. It breaks if a channel is dead, frozen, scaled or drifts. The
evidence is the integral of the law's relative error beyond its limit, so a larger error trips sooner. While there is evidence,
v_a follows at most the last agreed v_d or the v_d by slide and force: the drive position alone raises no vibration.
"""

import math

from bridge.kernel import hypot, kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import DRIVE_DOUBTED, FORCE_DOUBTED, POSITIONS_APART, SLIDE_DOUBTED
from controller.estimate.windows import DRIVE, FEWEST, FORCE, SLIDE, WHITE
from controller.trips.doubts import CONTACT, SOME, trip
from controller.trips.doubts import DRIVE as DRIVE_DOUBT

SHORTEST_S = 0.01  # shortest window; in a shorter one a force with a delay of 2 ms breaks the law in every slip
_SIGMAS = 3.0  # sigmas of the law that do not count as an error; several windows in a row must exceed them
# Largest error of the law, and largest noise of a window that shows it, over the fastest side of the law.
_OFF = 0.1
_TRIP_S = 0.04  # evidence until a trip, plus the window: a total error of 0.06 s, or half of v_d for 0.2 s
# Ratio of two changes from which only the larger counts as a change, and largest ratio of v_d to the v_s of a slide that moves.
_TIMES = 4.0


@kernel
def watch_law(p: ControllerParams, s: ControllerMemory) -> None:
    """Integrate the evidence; trip if it suffices. Called every SOME steps.

    Without evidence keep the velocities. A stuck slide agrees with any scale of the positions.
    """
    some_s = SOME * p.block_s
    level = _level(p, s)
    if level < 0:
        s.agreed_mps = 0.0 if s.moving == 0 else s.agreed_mps  # the next move may be slower
        s.most_drive_mps = s.agreed_mps
        s.evidence_s = max(s.evidence_s - _OFF * some_s, 0.0)
        return
    drive_mps, slide_mps, wound_mps, noise_mps = _sides(s, level)
    fastest_mps = max(math.fabs(drive_mps), math.fabs(slide_mps), math.fabs(wound_mps))
    off_mps = math.fabs(drive_mps - slide_mps - wound_mps)
    sigma_mps = hypot(noise_mps, s.compliance_sigma * s.slope[FORCE, level])
    more_s = some_s * ((off_mps - _SIGMAS * sigma_mps) / fastest_mps - _OFF)
    s.most_drive_mps = max(s.agreed_mps, math.fabs(slide_mps + wound_mps))
    if s.evidence_s == 0.0:
        if more_s <= 0.0:
            s.kept_mps[DRIVE], s.kept_mps[SLIDE], s.kept_mps[FORCE] = drive_mps, slide_mps, wound_mps
            if off_mps < _OFF * math.fabs(drive_mps) < _OFF * _TIMES * math.fabs(slide_mps):
                s.agreed_mps, s.agreed = math.fabs(drive_mps), 1
            return
        s.changed = 0
    # a stopped drive shows at once; a faster drive shows once v_a and with it the slide are as before
    if s.changed != DRIVE_DOUBTED:
        s.changed = _doubt(s, drive_mps, slide_mps, wound_mps)
    s.evidence_s = max(s.evidence_s + more_s, 0.0)
    if s.evidence_s > _TRIP_S + p.window_s[level]:
        trip(s, s.changed, DRIVE_DOUBT if s.changed == DRIVE_DOUBTED else CONTACT)


@kernel
def _level(p: ControllerParams, s: ControllerMemory) -> int:
    """Level of the shortest windows with little noise; -1: no level, or an unknown compliance."""
    for level in range(p.spring_level, p.levels):
        if s.differences[level] < FEWEST or s.noise[FORCE, level] == 0.0 or not math.isfinite(s.compliance_sigma):
            return -1
        drive_mps, slide_mps, wound_mps, noise_mps = _sides(s, level)
        if _SIGMAS * noise_mps < _OFF * max(math.fabs(drive_mps), math.fabs(slide_mps), math.fabs(wound_mps)):
            return level
    return -1


@kernel
def _sides(s: ControllerMemory, level: int) -> tuple[float, float, float, float]:
    """x_d', x_s' and c F' of a window, and the noise of the law [m/s]."""
    # hum that is alike in successive windows of a length shows in windows of half the length
    noise_mps = max(_noise_mps(s, level), WHITE * _noise_mps(s, max(level - 1, 0)))
    return s.slope[DRIVE, level], s.slope[SLIDE, level], s.compliance_m_per_N * s.slope[FORCE, level], noise_mps


@kernel
def _noise_mps(s: ControllerMemory, level: int) -> float:
    positions_mps = hypot(s.noise[DRIVE, level], s.noise[SLIDE, level])
    return hypot(positions_mps, s.compliance_m_per_N * s.noise[FORCE, level])


@kernel
def _doubt(s: ControllerMemory, drive_mps: float, slide_mps: float, wound_mps: float) -> int:
    """The report for the channel that alone changed since the law held; a slide that only became slower shows a dead force."""
    if s.agreed == 0:
        return POSITIONS_APART
    drive_by_mps, slide_by_mps = math.fabs(drive_mps - s.kept_mps[DRIVE]), math.fabs(slide_mps - s.kept_mps[SLIDE])
    wound_by_mps = math.fabs(wound_mps - s.kept_mps[FORCE])
    if s.agreed_mps > 0.0 and drive_by_mps > _TIMES * max(slide_by_mps, wound_by_mps):
        return DRIVE_DOUBTED
    faster = math.fabs(slide_mps) > math.fabs(drive_mps)
    return SLIDE_DOUBTED if faster and slide_by_mps > _TIMES * max(drive_by_mps, wound_by_mps) else FORCE_DOUBTED
