"""Cross-check of v_d: the drive position alone must not raise the vibration.

Under vibration the slide moves at v_d minus the rate of the spring's elongation: v_s + F' / k_d = v_d. If the drive position
is faster than slide and force together, v_a follows these two. The law does not show which of its three signals is wrong: if only
one signal changed, it is doubted (DRIVE_DOUBTED, SLIDE_DOUBTED, FORCE_DOUBTED), else POSITIONS_APART names both positions. k_d is
the largest learnt value, as diverging positions look like an increasingly soft spring.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import DRIVE_DOUBTED, FORCE_DOUBTED, POSITIONS_APART, SLIDE_DOUBTED
from controller.estimate.windows import BINS, DRIVE, FORCE, SLIDE
from controller.trips.delivered import SOME
from controller.trips.doubts import CONTACT, trip
from controller.trips.doubts import DRIVE as DRIVE_DOUBT

WINDOW_S = 0.05  # shortest window; v_a cannot change faster
_LONGER = 4  # number of window lengths to try, each twice the one before: slow feeds need longer windows
_EXACT = 0.05  # largest noise of both positions together in a used window, over v_d
_APART = 1.2  # ratio of v_d to the v_d by slide and force from which they disagree; errors of scale are smaller
_MARGIN = 1.1  # factor on the confirmed v_d while drive, slide and force disagree
_RISES_S = 1.0  # time constant of a rise of the confirmed share during a disagreement: v_a itself moves slide and force
_WINDOWS = 5.0  # fewest independent windows of a learnt stiffness
_SURE = 0.03  # largest relative sigma of a learnt stiffness; the first values are a third too large
# Share of v_d below which the slide sticks, and the share that counts as confirmed then: the rest depends on the stiffness.
_STICKS, _STUCK = 0.25, 0.4
_SOFTER = 2.0  # factor by which the spring may have become softer than the stiffest
_TWICE = 2.0  # ratio of two changes from which only the larger counts as a change
_SAME = 0.08  # smallest change of a velocity that counts, over v_d: less than half of the difference at a trip
_NONE = -1  # in place of a row: no single signal changed, or it is unknown
TRIP_S = 0.3  # time of disagreement until a trip; longer than a reversing drive needs to cross its backlash


@kernel
def watch_confirmed(p: ControllerParams, s: ControllerMemory) -> None:
    """Update the confirmed share of v_d; trip if v_d stays unconfirmed. Called every SOME steps."""
    some_s = SOME * p.block_s
    vibrates = s.moving == 1 and (s.allowed_m > 0.0 or s.confirmed < 1.0)
    s.shaken_s = s.shaken_s + some_s if vibrates else 0.0
    c = s.compliance_m_per_N
    if s.stiffness_learnt == 1 and s.compliance_sigma < _SURE * c and s.shown_windows >= _WINDOWS:
        s.stiffest_m_per_N = c if s.stiffest_m_per_N == 0.0 else min(s.stiffest_m_per_N, c)
    level = _level(p, s)
    if s.doubted & CONTACT and s.trip != POSITIONS_APART:  # a doubted force or slide position cannot confirm v_d
        s.apart_s, s.confirmed = 0.0, 1.0
        return
    if s.moving == 0:
        s.apart_s = 0.0
    if level < 0 or s.stiffest_m_per_N == 0.0:
        return
    drive_mps, slide_mps = s.direction * s.slope[DRIVE, level], s.direction * s.slope[SLIDE, level]
    winds_mps = s.direction * s.slope[FORCE, level] * s.stiffest_m_per_N
    share = (slide_mps + winds_mps) / drive_mps
    sticks = slide_mps < _STICKS * drive_mps
    if (_STUCK if sticks else 1.0 / _APART) < share < _APART:
        s.apart_s, s.confirmed = 0.0, 1.0
        if not sticks:  # a stuck slide gives no information on the scale of its position
            s.agreed_mps[DRIVE], s.agreed_mps[SLIDE] = drive_mps, slide_mps
        return
    if s.apart_s == 0.0:
        s.apart_by = _changed(s, drive_mps, slide_mps)
    s.apart_s += some_s
    if s.apart_by in (SLIDE, FORCE) or share >= 1.0:
        s.confirmed = 1.0
    else:
        now = max(share, 0.0) * _MARGIN
        s.confirmed = min(now, s.confirmed + some_s / _RISES_S * max(now - s.confirmed, 0.0))
    explained = s.apart_by == _NONE and slide_mps + _SOFTER * winds_mps > drive_mps / _APART and share < 1.0
    if s.apart_s > TRIP_S and not explained:
        if s.apart_by == DRIVE:
            trip(s, DRIVE_DOUBTED, DRIVE_DOUBT)
        else:
            # a slide may really become slower: then the force is wrong, as it does not follow
            by_change = SLIDE_DOUBTED if share > 1.0 else FORCE_DOUBTED
            trip(s, POSITIONS_APART if s.apart_by == _NONE else by_change, CONTACT)


@kernel
def _changed(s: ControllerMemory, drive_mps: float, slide_mps: float) -> int:
    """The row of the signal that alone changed since all three agreed; _NONE if two changed, or they never agreed."""
    if s.agreed_mps[DRIVE] == 0.0:
        return _NONE
    drive_by_mps = math.fabs(drive_mps - s.agreed_mps[DRIVE])
    slide_by_mps = math.fabs(slide_mps - s.agreed_mps[SLIDE])
    if max(drive_by_mps, slide_by_mps) < _SAME * s.agreed_mps[DRIVE]:
        return FORCE
    if drive_by_mps > _TWICE * slide_by_mps:
        return DRIVE
    return SLIDE if slide_by_mps > _TWICE * drive_by_mps else _NONE


@kernel
def _level(p: ControllerParams, s: ControllerMemory) -> int:
    """Level of the shortest windows under vibration in which the motion exceeds the noise; -1: no level."""
    for level in range(p.confirm_level, min(p.confirm_level + _LONGER, p.levels)):
        window_s = p.window_s[level]
        if s.pushed[level] < 2 * BINS or s.shaken_s < 2.0 * window_s or s.moved_s < 2.0 * window_s:
            return -1
        noise_mps = math.hypot(s.noise[DRIVE, level], s.noise[SLIDE, level])
        if s.noise[DRIVE, level] > 0.0 and noise_mps < _EXACT * s.direction * s.slope[DRIVE, level]:
            return level
    return -1
