"""Stick, slip, surge or smooth sliding, from the slide's velocity relative to the drive's.

The slide's velocity v_s comes from two sources: the slide's position, and the drive's spring, v_d - F' / k_d. Each is weighted
by its measured noise, so that either may be missing. A stick is v_s near 0 while the drive moves; a slip is v_s beyond 1.5 v_d.

The window is the shortest in which a stick exceeds the noise. If no window is long enough, or the window exceeds the expected
stick, the controller is blind and reports BLIND.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import CHECKING, SLIP, SMOOTH, STANDSTILL, STICK, UNKNOWN
from controller.estimate.compliance import elongation_m, slide_mps
from controller.estimate.windows import BINS, DRIVE, OF_STEP, WELL_KNOWN
from controller.trips import doubts

_SIGMAS = 6.0  # detection limit in sigmas: error rate of 1e-9 a window, one in 100 hours of windows of 1 ms at most
_UNSURE_SIGMAS = 9.0  # the same limit for a slip at rest while the noise is known from fewer than 40 differences
_HALF = 0.5  # difference of stick and sliding that a window must resolve, over v_d
_FINE = 0.06  # resolution of the longer window that separates a swing of v_s from noise, over v_d
# v_s / v_d below which the slide sticks. Larger: a slide that lags behind a step of the drive counts as stuck. Smaller: less
# noise is needed to miss a stick: 0.35 is 4.2 sigma from a stick, and 7.8 sigma from sliding, in the noisiest used window.
_STICK = 0.35
_STICK_ENDS = 0.65  # v_s / v_d at which a stick ends: as far from sliding as _STICK is from a stick
_SLIP = 1.5  # v_s / v_d at which a slip begins
_SLIP_ENDS = 1.2  # v_s / v_d at which a slip ends
_UNSEEN_MPS = 1e-5  # smallest slip velocity while the drive seems to be at rest
_STANDS_S = 0.1  # standstill at the start of the run after which a slide that moves alone counts as a slip
_AFTER_STOP_S = 0.01  # longest window just after a stop; later, windows begin after the stop
_LONGEST_WINDOW_S = 1.0  # longest window: with a longer one a stick is detected too late to prevent the slip
_EXPECTED_SWING = 0.2  # fall of the force in a slip, over the force, until the first slip: as for F_s = 1.1 F_c
# Time without a window that resolves a stick until the controller is blind. Shorter: it is blind at every start of a move, while
# the windows fill. Longer: slips are missed without a report.
_BLIND_S = 0.3
_EXCITER_PERIODS = 2.0  # least length of a window during vibration, in periods of the exciter
_LONGEST_STICK_S = 60.0  # longest expected stick, and the expected stick of an axis of unknown stiffness


@kernel
def contact(p: ControllerParams, s: ControllerMemory, force_N: float, tick_s: float) -> None:
    """Judge the contact after `tick_s` more seconds; `force_N` is the mean force over them."""
    speed_mps = math.fabs(s.drive_velocity_mps)
    least_s = _EXCITER_PERIODS / s.allowed_Hz if s.allowed_m > 0.0 else 0.0
    begins, lasts, fine, known = False, False, False, s.held_mps > 0.0 or s.stood_s > _STANDS_S
    s.level, s.window_s = -1, 0.0
    s.slipped_s += tick_s
    for level in range(p.levels):
        length_s = p.window_s[level]
        if s.pushed[level] < BINS or length_s > _LONGEST_WINDOW_S or fine:
            break
        if length_s < least_s:
            continue
        if s.moving == 0 and s.held_mps > 0.0 and length_s * (1.0 + 1.0 / BINS) > max(s.stood_s, _AFTER_STOP_S):
            break  # the window reaches back into the move
        sliding_mps, sigma_mps = slide_mps(p, s, level, speed_mps)
        if not math.isfinite(sigma_mps):
            continue
        sure = _SIGMAS if s.moving == 1 or s.differences[level] >= WELL_KNOWN else _UNSURE_SIGMAS
        fast_mps = max(_SLIP * max(s.held_mps, speed_mps), _UNSEEN_MPS) + sure * sigma_mps
        if known and sliding_mps > fast_mps:
            lasts = lasts or s.level < 0
            begins = begins or length_s <= s.slip_window_s or length_s * (1.0 + 1.0 / BINS) < s.slipped_s
        resolved_mps = _HALF * speed_mps / _SIGMAS if s.moving == 1 else max(s.held_mps, _UNSEEN_MPS)
        if s.level < 0 and sigma_mps <= resolved_mps:
            s.level, s.window_s, s.sliding_mps = level, length_s, sliding_mps
        if s.level >= 0:
            s.fine_mps, s.fine_sigma_mps = sliding_mps, sigma_mps
            fine = _SIGMAS * sigma_mps <= _FINE * speed_mps or s.moving == 0
    _follow(s, tick_s, begins, lasts, speed_mps)
    s.force_rate = 1.0 - s.sliding_mps / speed_mps if s.moving == 1 and s.level >= 0 else 0.0
    _expect(p, s, force_N, tick_s, speed_mps)


@kernel
def _follow(s: ControllerMemory, tick_s: float, begins: bool, lasts: bool, speed_mps: float) -> None:
    """Set the state of the contact, and count slips and surges.

    Any window `begins` a slip, and only the windows up to the shortest that resolves a stick show that it `lasts`: longer windows
    still hold the slip.
    """
    vibrated = s.allowed_m > 0.0
    before = s.contact
    s.slip_began, s.stick_began = 0, 0
    if s.slipping == 1:
        if not lasts and (s.level < 0 or s.sliding_mps < _SLIP_ENDS * max(speed_mps, s.held_mps)):
            s.slipping, s.slipped_s, s.slip_window_s = 0, 0.0, s.window_s
    elif begins:
        s.slipping = 1
        loosened = s.moving == 0 and s.guard_state == CHECKING  # the spring relaxes under the tones of the rig's check
        s.slip_began = 0 if loosened else 1
        if s.doubted & (doubts.CONTACT | doubts.DRIVE):
            pass  # a doubted signal shows no slip
        elif s.since_stick_s <= 2.0 * s.window_s or not vibrated:
            s.slips += s.slip_began
        else:
            s.surges += 1
    if s.slipping == 1:
        s.contact = SLIP
    elif s.measured == 0:
        s.contact = UNKNOWN
    elif s.moving == 0:
        s.contact = UNKNOWN if s.blind == 1 else STANDSTILL  # an unseen feed looks like a drive at rest
    elif s.level < 0 and s.unseen_s < _BLIND_S and _stood(s, before, tick_s):
        s.contact = STICK  # a slide at rest sticks until sliding is seen
    elif s.level < 0:
        s.contact = UNKNOWN
    elif s.sliding_mps < (_STICK_ENDS if before == STICK else _STICK) * speed_mps:
        s.contact = STICK
    else:
        s.contact = SMOOTH
    if s.contact == STICK:
        if before != STICK:
            s.stick_began = 1
            s.stick_s = 0.0
        s.stick_s += tick_s
        s.since_stick_s = 0.0
    else:
        s.since_stick_s += tick_s
    s.smooth_s = s.smooth_s + tick_s if s.contact == SMOOTH else 0.0


@kernel
def _stood(s: ControllerMemory, before: int, tick_s: float) -> bool:
    """Whether the slide has been at rest since the drive started or turned."""
    if s.moved_s > tick_s:
        return before == STICK
    return s.rested == 1 and (before in (STANDSTILL, STICK) or (before == UNKNOWN and s.blind == 1))


@kernel
def _expect(p: ControllerParams, s: ControllerMemory, force_N: float, tick_s: float, speed_mps: float) -> None:
    """Estimate the length of a stick and the time to the slip, and whether a stick can be detected in time."""
    way = 0 if s.direction > 0 else 1
    along_N = s.direction * force_N
    s.time_to_slip_s = -1.0
    if s.moving == 0 or speed_mps == 0.0:
        s.unseen_s = 0.0
        s.blind = 1 if s.moving == 0 and _feeds_unseen(p, s) else 0
        return
    swing_N = _EXPECTED_SWING * math.fabs(force_N)
    if s.swing_N[way] > 0.0:
        swing_N = max(s.swing_N[way], 0.5 * swing_N)
    s.expected_stick_s = min(elongation_m(p, s, swing_N) / speed_mps, _LONGEST_STICK_S)
    if s.contact == STICK and s.breakaway_N[way] > 0.0 and math.isfinite(s.compliance_sigma):
        s.time_to_slip_s = max(s.breakaway_N[way] - along_N, 0.0) * s.compliance_m_per_N / speed_mps
    in_time = s.level >= 0 and (s.window_s < s.expected_stick_s or s.contact == STICK or s.slipping == 1)
    s.unseen_s = 0.0 if in_time else s.unseen_s + tick_s
    s.blind = 1 if s.unseen_s > _BLIND_S else 0


@kernel
def _feeds_unseen(p: ControllerParams, s: ControllerMemory) -> bool:
    """Whether the noise of the drive's position over one second exceeds the least feed that counts as motion.

    The noise of the best windows is extrapolated to one second as white noise, as a stop disturbs the long windows for seconds.
    """
    least_mps = math.inf
    for level in range(p.levels):
        if s.differences[level] < WELL_KNOWN:
            break
        share = p.window_s[level] / _LONGEST_WINDOW_S
        least_mps = min(least_mps, s.sigma[DRIVE, level] * share * math.sqrt(share))
    step_mps = OF_STEP * s.resolution[DRIVE] / _LONGEST_WINDOW_S
    seen_mps = _SIGMAS * math.sqrt(least_mps * least_mps + step_mps * step_mps)
    return math.isfinite(seen_mps) and seen_mps > p.least_feed_mps
