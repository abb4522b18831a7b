"""When to vibrate, and how strongly. A wrong policy does no harm, as `limits` bounds the vibration.

WATCH   no vibration; a stick or a slip leads to EXCITE at once: an early release is a small slip, a late release a large slip
EXCITE  hold v_a at a ratio to v_d that follows the swing of friction, and rises at every slip or surge
PROBE   a trial without vibration: `controller.policy.trial`
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire import stickslip_pb2 as wire
from controller.announced import announced_ahead
from controller.config import MODES
from controller.exciter import accept_weaker
from controller.in_force import is_settled
from controller.policy.need import is_needed, is_needless, note_needed, note_needless, way_of
from controller.policy.ratio import follow_swing, note_swing, raise_ratio, settling_s, swing_held
from controller.policy.trial import (
    AT_END,
    HELPLESS,
    STEADY_S,
    WINDOW_S,
    begin_trial,
    calm_s,
    follow_trial,
    has_fallen,
    is_due,
    length_s,
)
from controller.trips.doubts import CONTACT

WHILE_MOVING = MODES.index("moving")

_STEP = 0.4  # rise of the ratio at a slip or a surge
# Factor on `v_ratio` until the slide follows a v_d that changes, as at a reversal: the measured v_d lags, and v_a must exceed v_d
# at the breakaway. 1.0: slips at three of four starts of a stiff axis. For all of each start: surges of a wound-up spring.
_AHEAD = 1.25
_TURNING_S = 0.05  # longest rest of a drive at a reversal
# Loop delays that are added to STEADY_S after the vibration began, and after each rise of the ratio: slips in this time do not
# count, as they release force that was stored before.
_DELAYS = 12.0
_REMEMBERED_S = 30.0  # time constant with which the count of slips under vibration decays


@kernel
def decide(p: ControllerParams, s: ControllerMemory, t_ns: int, force_N: float, block_s: float) -> None:
    """Set the mode, and the wanted vibration velocity amplitude [m/s]."""
    speed_mps = math.fabs(s.drive_velocity_mps)
    ahead_mps = announced_ahead(s, t_ns, t_ns + round(1e9 * _look_ahead_s(p, s)))
    s.wanted_speed_mps = max(speed_mps, s.rising_mps, math.fabs(ahead_mps))
    if s.moving == 0 and ahead_mps != 0.0:
        s.direction = 1 if ahead_mps > 0.0 else -1
    way, even = way_of(s), s.moving == 1 and s.steady_s > STEADY_S
    s.mode_s += block_s
    s.waiting_s = max(s.waiting_s - block_s, 0.0)
    if s.mode != wire.PROBE:  # a trial reads this count at its end
        s.failed *= 1.0 - block_s / _REMEMBERED_S
    for i in range(2):
        s.off_left_s[i] = max(s.off_left_s[i] - block_s, 0.0)
    if even and s.allowed_m == 0.0 and has_fallen(p, s):
        note_needed(s, speed_mps)
    rests = s.moving == 0 and s.stood_s > _TURNING_S and ahead_mps == 0.0
    if s.stopped == 1:
        enter(p, s, wire.STOPPED)
    elif s.guard_state not in (wire.NO_GUARD, wire.ARMED, wire.ACTIVE) or t_ns < p.enabled_from_ns:
        enter(p, s, wire.DISABLED)
    elif s.mode in (wire.DISABLED, wire.STOPPED) or rests:
        enter(p, s, wire.WATCH)

    if s.mode == wire.WATCH:
        why = _why(p, s, way, even, speed_mps if s.moving == 1 else math.fabs(ahead_mps))
        if why != wire.NO_REASON:
            s.why = why
            if p.mode == WHILE_MOVING or not is_due(p, s, speed_mps):
                enter(p, s, wire.EXCITE)
            elif s.moving == 1:
                begin_trial(p, s, force_N, speed_mps)
    elif s.mode == wire.EXCITE:
        _hold(p, s, way, even, force_N, speed_mps, block_s)
    elif s.mode == wire.PROBE and s.moving == 1:
        enter(p, s, follow_trial(p, s, force_N, speed_mps))
    s.ratio_now = 0.0
    if s.mode == wire.EXCITE:
        least = 1.0 if even else p.v_ratio * _AHEAD if s.contact != wire.SMOOTH else p.v_ratio
        s.ratio_now = max(s.ratio[way], least)
    elif s.mode == wire.PROBE:
        s.ratio_now = s.fade
    s.wanted_velocity_mps = s.ratio_now * s.wanted_speed_mps


@kernel
def enter(p: ControllerParams, s: ControllerMemory, mode: int) -> None:
    """Set the mode; a change restarts its times, and a vibration holds the swing of friction that its ratio holds."""
    if s.mode == mode:
        return
    s.mode, s.mode_s = mode, 0.0
    s.even_s, s.top = 0.0, -1.0
    if mode == wire.EXCITE:
        s.swing = max(s.swing, swing_held(s.ratio[way_of(s)]))
        s.waiting_s = _releases_s(p, s)


@kernel
def _releases_s(p: ControllerParams, s: ControllerMemory) -> float:
    return STEADY_S + _DELAYS * s.loop_delay_steps * p.block_s


@kernel
def _look_ahead_s(p: ControllerParams, s: ControllerMemory) -> float:
    """Time from a command to v_a: loop delay, and for a drive at rest also the slew to the largest amplitude.

    For a moving drive it is the loop delay alone, as an early v_a would release a slide that a smaller v_a holds.
    """
    delay_s = (s.loop_delay_steps + 1) * p.block_s
    if s.moving == 1:
        return delay_s
    largest_m = min(p.amplitude_max_m, p.velocity_max_mps / (math.tau * p.frequency_Hz))
    return delay_s + largest_m / p.slew_m_per_step * p.block_s


@kernel
def _why(p: ControllerParams, s: ControllerMemory, way: int, even: bool, speed_mps: float) -> int:
    """The reason for which a vibration begins at a |v_d|, present or announced; NO_REASON: none begins."""
    if s.moving == 0:
        needed = speed_mps > 0.0 and (p.mode == WHILE_MOVING or is_needed(s, speed_mps))
        return wire.NEEDED_BEFORE if needed else wire.NO_REASON
    if s.off_left_s[way] > 0.0:
        return wire.NO_REASON
    if p.mode == WHILE_MOVING:
        return wire.MOVING
    if s.doubted & CONTACT:
        return wire.BLIND
    if is_needed(s, speed_mps):
        return wire.NEEDED_BEFORE
    # a pair that needs no vibration may stick while v_d changes; a fall of the force ends this result
    if is_needless(s, speed_mps if even else math.inf):
        return wire.NO_REASON
    if s.blind == 1:
        return wire.BLIND
    return wire.STICK_SEEN if s.slip_began == 1 or s.contact == wire.STICK else wire.NO_REASON


@kernel
def _hold(
    p: ControllerParams, s: ControllerMemory, way: int, even: bool, force_N: float, speed_mps: float, block_s: float
) -> None:
    """Adapt the ratio of a vibration, and begin its trials."""
    judged = is_settled(s, 0.0)
    begun = s.slip_began == 1 or s.stick_began == 1
    if judged and begun and s.banded == 1 and s.vibration_velocity_mps < p.least_ratio * speed_mps:
        accept_weaker(p, s)
    if judged and s.slip_began == 1 and even and s.waiting_s == 0.0:
        note_needed(s, speed_mps)
        s.failed += 1.0
        s.waiting_s = _releases_s(p, s)
        if s.at_limit == 0:
            raise_ratio(p, s, _STEP)
    if not even:
        s.swing = max(s.swing, swing_held(p.v_ratio))  # at a new speed the ratio falls from the set point
        s.even_s, s.top = 0.0, -1.0
    settle_s = settling_s(p, s, force_N, speed_mps)
    if even and s.waiting_s == 0.0 and is_settled(s, settle_s):
        if s.level >= 0:
            note_swing(p, s, speed_mps, block_s, settle_s)
        if s.contact == wire.SMOOTH and s.at_limit == 0:
            follow_swing(p, s, block_s, settle_s)
    if p.mode == WHILE_MOVING or s.moving == 0:
        return
    s.untried_s[way] += block_s
    follows = even and (s.contact == wire.SMOOTH or s.blind == 1)
    helpless = even and s.failed > HELPLESS and s.untried_s[way] > s.off_s[way]
    if helpless or (follows and calm_s(s) > 2.0 * WINDOW_S and is_due(p, s, speed_mps)):
        begin_trial(p, s, force_N, speed_mps)
    # below v_d a vibration does not reduce friction that is the same at every speed, and the slide slides; at first it did, where
    # v_a reached v_d
    elif (
        follows
        and min(calm_s(s), s.weak_s) > length_s(s)
        and s.vibration_velocity_mps < speed_mps
        and min(s.mode_s, s.steady_s) < s.weak_s + WINDOW_S
        and s.doubted & CONTACT == 0
        and not is_needed(s, speed_mps)
    ):
        note_needless(s, speed_mps)
        enter(p, s, wire.WATCH)


@kernel
def slips_at_end(s: ControllerMemory) -> bool:
    """Whether slips or surges repeat under vibration."""
    return s.failed > AT_END
