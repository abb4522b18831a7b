"""Stick, slip, surge or smooth sliding, from the slide's velocity relative to the drive's.

The slide's velocity v_s comes from two sources: the slide's position, and the drive's spring, v_d - F' / k_d. Each is weighted
by its measured noise, so that either may be missing. A stick is v_s below 0.35 v_d, a slip is v_s beyond 1.5 v_d.

The window is the shortest in which a stick exceeds the noise. If no window is long enough, or the window exceeds the expected
stick, the controller is blind and reports BLIND.
"""

import math

from bridge.kernel import hypot, kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import CHECKING, SLIP, SMOOTH, STANDSTILL, STICK, UNKNOWN
from controller.estimate.compliance import elongation_m, slide_mps
from controller.estimate.windows import BINS, DRIVE, OF_STEP, SIGMAS, SLIDE
from controller.trips import doubts

_HALF = 0.5  # difference of stick and sliding that a window must resolve, and of a slip and sliding, over v_d
# v_s / v_d below which the slide sticks. Larger: at 0.5 a slide that stops with its drive sticks, 9 times in 3 minutes with hum.
# Smaller: less noise is needed to miss a stick; 0.35 is 4.2 sigma from a stick in the noisiest used window.
_STICK = 0.35
_LONGEST_WINDOW_S = 1.0  # longest window: with a longer one a stick is detected too late to prevent the slip
_EXPECTED_SWING = 0.2  # fall of the force in a slip, over the force: as for F_s = 1.1 F_c
# Time without a window that resolves a stick until the controller is blind. Shorter: it is blind at every start of a move, while
# the windows fill. Longer: slips are missed without a report.
_BLIND_S = 0.3
EXCITER_PERIODS = 2.0  # least length of a window during vibration, in periods of the exciter
# Velocity of a slide at a drive that has been at rest for this time, from which its position is not to be trusted. Smaller: a
# slide that the spring relaxes.
_UNSEEN_MPS, _STANDS_S = 1e-4, 0.2
_LONGEST_STICK_S = 60.0  # longest expected stick, and the expected stick of an axis of unknown stiffness


@kernel
def contact(p: ControllerParams, s: ControllerMemory, force_N: float, tick_s: float) -> None:
    """Judge the contact after `tick_s` more seconds; `force_N` is the mean force over them."""
    speed_mps = math.fabs(s.drive_velocity_mps)
    least_s = EXCITER_PERIODS / s.allowed_Hz if s.allowed_m > 0.0 else 0.0
    fast_mps, is_fast = (1.0 + _HALF) * s.held_mps, False
    s.level, s.window_s, s.sliding_mps = -1, 0.0, 0.0
    for level in range(p.levels):
        if s.moving == 0 or s.level >= 0 or s.pushed[level] < BINS or p.window_s[level] > _LONGEST_WINDOW_S:
            break
        if p.window_s[level] < least_s:
            continue
        sliding_mps, sigma_mps = slide_mps(p, s, level, speed_mps)
        # a window that still contains the last slip begins no other
        if s.slipping == 1 or p.window_s[level] * (1.0 + 1.0 / BINS) < s.slipped_s:
            is_fast = is_fast or sliding_mps > fast_mps + SIGMAS * sigma_mps
        if SIGMAS * sigma_mps <= _HALF * speed_mps:
            s.level, s.window_s, s.sliding_mps = level, p.window_s[level], sliding_mps
    s.force_rate = 1.0 - s.sliding_mps / speed_mps if s.level >= 0 else 0.0
    _note_slip(s, tick_s, is_fast, is_fast or s.sliding_mps > s.held_mps)
    before = s.contact
    if s.slipping == 1:
        s.contact = SLIP
    elif s.level >= 0:
        s.contact = STICK if s.sliding_mps < _STICK * speed_mps else SMOOTH
    else:
        s.contact = STANDSTILL if s.moving == 0 and s.blind == 0 and s.noise[DRIVE, 0] > 0.0 else UNKNOWN
    s.stick_began = 1 if s.contact == STICK and before != STICK else 0
    s.since_stick_s = 0.0 if s.contact == STICK else s.since_stick_s + tick_s
    _expect(p, s, force_N, tick_s, speed_mps)


@kernel
def _note_slip(s: ControllerMemory, tick_s: float, begins: bool, lasts: bool) -> None:
    """Begin or end a slip, and count slips and surges: a surge is a slip under vibration without a stick before."""
    s.slip_began = 1 if begins and s.slipping == 0 else 0
    s.slipped_s = 0.0 if s.slipping == 1 else s.slipped_s + tick_s
    s.slipping = 1 if begins or (lasts and s.slipping == 1) else 0
    if s.slip_began == 0 or s.doubted & (doubts.CONTACT | doubts.DRIVE):
        return  # a doubted signal shows no slip
    if s.allowed_m == 0.0 or s.since_stick_s <= 2.0 * s.window_s:
        s.slips += 1
    else:
        s.surges += 1


@kernel
def _expect(p: ControllerParams, s: ControllerMemory, force_N: float, tick_s: float, speed_mps: float) -> None:
    """Estimate the length of a stick and the time to the slip, and whether a stick can be detected in time."""
    way = 0 if s.direction > 0 else 1
    along_N = s.direction * force_N
    s.time_to_slip_s, s.drive_unseen = -1.0, 0
    if s.moving == 0:
        limit_mps = max(SIGMAS * s.noise[SLIDE, p.spring_level], _UNSEEN_MPS)
        # vibration relaxes the spring
        rests = min(s.stood_s, s.silent_s) > _STANDS_S and s.guard_state != CHECKING
        s.drive_unseen = 1 if rests and math.fabs(s.slope[SLIDE, p.spring_level]) > limit_mps else 0
        s.unseen_s = 0.0
        # a feed that the noise over one second hides looks like a drive at rest; that noise is extrapolated from the shortest
        # windows as white noise, as a stop disturbs the long windows for seconds
        white_mps = s.noise[DRIVE, 0] * (p.window_s[0] / _LONGEST_WINDOW_S) ** 1.5
        seen_mps = SIGMAS * hypot(white_mps, OF_STEP * s.resolution[DRIVE] / _LONGEST_WINDOW_S)
        s.blind = 1 if white_mps > 0.0 and seen_mps > p.least_feed_mps else 0
        return
    if s.slip_began == 1 and s.allowed_m == 0.0:
        s.breakaway_N[way] = s.peak_N
    sticks = s.contact == STICK
    s.peak_N = max(s.peak_N, along_N) if sticks or s.slipping == 1 else along_N
    s.dragged[way] = 1 if s.contact in (SMOOTH, SLIP) else s.dragged[way]
    if sticks and s.breakaway_N[way] > 0.0 and math.isfinite(s.compliance_sigma):
        s.time_to_slip_s = max(s.breakaway_N[way] - along_N, 0.0) * s.compliance_m_per_N / speed_mps
    s.expected_stick_s = min(elongation_m(p, s, _EXPECTED_SWING * force_N) / speed_mps, _LONGEST_STICK_S)
    in_time = s.level >= 0 and (s.window_s < s.expected_stick_s or sticks or s.slipping == 1)
    s.unseen_s = 0.0 if in_time else s.unseen_s + tick_s
    s.blind = 1 if s.unseen_s > _BLIND_S else 0
