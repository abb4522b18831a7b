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
from controller.in_force import is_settled
from controller.policy.ratio import follow_swing, note_swing, raise_ratio, settling_s, swing_held
from controller.policy.trial import (
    HELPLESS,
    REMEMBERED_S,
    STEADY_S,
    WINDOW_S,
    begin_trial,
    calm_s,
    follow_trial,
    is_due,
    is_needed,
    is_needless,
    note_needed,
    shows_need,
)
from controller.trips.doubts import CONTACT

WHILE_MOVING = MODES.index("moving")

_STEP = 0.4  # rise of the ratio at a slip or a surge
_TURNING_S = 0.05  # longest rest of a drive at a reversal


@kernel
def decide(p: ControllerParams, s: ControllerMemory, t_ns: int, force_N: float) -> None:
    """Set the mode, and the wanted vibration velocity amplitude [m/s]."""
    speed_mps = math.fabs(s.drive_velocity_mps)
    ahead_mps = announced_ahead(s, t_ns, t_ns + round(1e9 * (s.loop_delay_steps + 1) * p.block_s))
    s.wanted_speed_mps = max(speed_mps, s.rising_mps, math.fabs(ahead_mps))
    if s.moving == 0 and ahead_mps != 0.0:
        s.direction = 1 if ahead_mps > 0.0 else -1
    even = s.moving == 1 and s.steady_s > STEADY_S
    s.mode_s += p.block_s
    s.waiting_s = max(s.waiting_s - p.block_s, 0.0)
    s.off_left_s = max(s.off_left_s - p.block_s, 0.0)
    if s.mode != wire.PROBE:  # a trial judges at its end
        s.failed *= 1.0 - p.block_s / REMEMBERED_S
        if even and s.allowed_m == 0.0 and shows_need(p, s):
            note_needed(s, speed_mps)
    rests = s.moving == 0 and s.stood_s > _TURNING_S and ahead_mps == 0.0
    if s.stopped == 1:
        enter(s, wire.STOPPED)
    elif s.guard_state not in (wire.NO_GUARD, wire.ARMED, wire.ACTIVE) or t_ns < p.enabled_from_ns:
        enter(s, wire.DISABLED)
    elif s.mode in (wire.DISABLED, wire.STOPPED) or rests:
        enter(s, wire.WATCH)

    if s.mode == wire.WATCH:
        why = _why(p, s, even, speed_mps if s.moving == 1 else math.fabs(ahead_mps))
        if why != wire.NO_REASON:
            s.why = why
            if p.mode == WHILE_MOVING or not is_due(p, s, speed_mps):
                enter(s, wire.EXCITE)
            elif s.moving == 1:
                begin_trial(s)
    elif s.mode == wire.EXCITE:
        _hold(p, s, even, force_N, speed_mps)
    elif s.mode == wire.PROBE and s.moving == 1:
        enter(s, follow_trial(p, s, force_N, speed_mps))
    s.ratio_now = 0.0
    if s.mode == wire.EXCITE:
        s.ratio_now = s.ratio if even else max(s.ratio, p.v_ratio)
    elif s.mode == wire.PROBE:
        s.ratio_now = s.fade
    s.wanted_velocity_mps = s.ratio_now * s.wanted_speed_mps


@kernel
def enter(s: ControllerMemory, mode: int) -> None:
    """Set the mode; a change restarts its times, and a vibration holds the swing of friction that its ratio holds."""
    if s.mode == mode:
        return
    s.mode, s.mode_s = mode, 0.0
    s.even_s, s.top = 0.0, -1.0
    if mode == wire.EXCITE:
        s.swing = max(s.swing, swing_held(s.ratio))
        s.waiting_s = STEADY_S


@kernel
def _why(p: ControllerParams, s: ControllerMemory, even: bool, speed_mps: float) -> int:
    """The reason for which a vibration begins at a |v_d|, present or announced; NO_REASON: none begins."""
    if s.moving == 0:
        needed = speed_mps > 0.0 and (p.mode == WHILE_MOVING or is_needed(s, speed_mps))
        return wire.NEEDED_BEFORE if needed else wire.NO_REASON
    if s.off_left_s > 0.0:
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
def _hold(p: ControllerParams, s: ControllerMemory, even: bool, force_N: float, speed_mps: float) -> None:
    """Adapt the ratio of a vibration, and begin its trials."""
    if s.slip_began == 1 and even and s.waiting_s == 0.0 and is_settled(s, 0.0):
        note_needed(s, speed_mps)
        s.failed += 1.0
        s.waiting_s = STEADY_S
        if s.at_limit == 0:
            raise_ratio(p, s, _STEP)
    if not even:
        s.swing = max(s.swing, swing_held(p.v_ratio))  # at a new speed the ratio falls from the set point
        s.even_s, s.top = 0.0, -1.0
    settle_s = settling_s(p, s, force_N, speed_mps)
    if even and s.waiting_s == 0.0 and is_settled(s, settle_s):
        if s.level >= 0:
            note_swing(p, s, speed_mps, settle_s)
        if s.contact == wire.SMOOTH and s.at_limit == 0:
            follow_swing(p, s, settle_s)
    if p.mode == WHILE_MOVING or s.moving == 0:
        return
    s.untried_s += p.block_s
    follows = (s.contact == wire.SMOOTH or s.blind == 1) and calm_s(s) > 2.0 * WINDOW_S
    if even and (follows or s.failed > HELPLESS) and is_due(p, s, speed_mps):
        begin_trial(s)
