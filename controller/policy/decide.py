"""When to vibrate, and how strongly. A wrong policy does no harm, as `limits` bounds the vibration.

WATCH   no vibration; a stick or a slip leads to EXCITE at once: an early release is a small slip, a late release a large slip
EXCITE  hold v_a at a ratio to v_d that falls step by step to the least that is needed, and rises at every stick, slip or surge
PROBE   a trial without vibration: `controller.policy.trial`
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import (
    ACTIVE,
    ARMED,
    BLIND,
    DISABLED,
    EXCITE,
    MOVING,
    NEEDED_BEFORE,
    NO_GUARD,
    PROBE,
    SMOOTH,
    STICK,
    STICK_SEEN,
    STOPPED,
    WATCH,
)
from controller.announced import announced_ahead
from controller.config import MODES
from controller.estimate.compliance import slide_mps
from controller.estimate.windows import BINS
from controller.in_force import is_settled
from controller.policy.fall import WINDOW_S, has_fallen
from controller.policy.modes import enter, excite
from controller.policy.need import (
    STEADY_S,
    follow_swing,
    grows,
    is_needed,
    is_needless,
    is_wound_up,
    largest_ratio,
    needless_from_mps,
    note_needed,
    note_needless,
    raise_ratio,
    settling_s,
    swing_held,
    way_of,
)
from controller.policy.trial import begin_trial, follow_trial, is_due
from controller.trips.band import accept_weaker
from controller.trips.doubts import CONTACT

TWO_PI = 2.0 * math.pi
ON_DEMAND, WHILE_MOVING = range(len(MODES))

_STICK_STEP, _SLIP_STEP = 0.08, 0.4  # rise of the ratio at a stick, and at a slip or a surge
# Duration of the start of a move; force over sliding force from which the spring is wound up; factor on the ratio until then.
_STARTS_S, _WOUND, _AHEAD = 0.2, 0.5, 1.25
_BEGINS_S = 0.02  # first part of a move, in which the spring's force decides whether it is wound up
_RISING = 1.05  # `held_mps` over measured |v_d| above which the drive slows down
_ABOVE_SLIDE = 1.1  # least v_a over v_s of a slide that slows down after its drive
_TURNING_S = 0.05  # longest rest of a drive at a reversal
_STARTING_S = 0.15  # first part of a vibration, in which slips do not count: they release the force stored before
_LOOK_STEPS = 16  # steps between two selections of the windows in which the swing of v_s is measured
# Of these windows: largest noise of v_s over v_d, fewest periods of the exciter.
_OF_SWING, _EXCITER_PERIODS = 0.02, 2.0
_LEAST_SLIDING = 0.5  # least mean v_s over v_d; a slower slide gives no information on the swing of friction
_EVEN = 0.1  # largest deviation of v_s from v_d, over v_d, of a slide that follows
# Memory of a swing of friction: two periods of the slowest swing that the spring does not level out; 10 s at most, for energy.
_PERIODS, _SHORTEST_S, _LONGEST_S = 2.0, 0.5, 10.0
_REMEMBERED_S = 30.0  # time after a slip under vibration until their count restarts
_FEWEST = 3  # fewest slips or surges until they are reported: the first raise the ratio
_USELESS_S, _STICKS = 2.0, 4.0  # least time, and number of expected sticks, without a slip until a v_a below v_d ends
_AT_DRIVE = 1.1  # measured v_a over v_d up to which a stick shows a weak exciter
_HELPLESS = 8  # slips under vibration until a trial shows whether the vibration helps


@kernel
def decide(p: ControllerParams, s: ControllerMemory, t_ns: int, force_N: float, block_s: float) -> None:
    """Set the mode, and the wanted vibration velocity amplitude [m/s]."""
    s.mode_s += block_s
    way = way_of(s)
    for i in range(2):
        s.off_left_s[i] = max(s.off_left_s[i] - block_s, 0.0)
    s.failed_left_s = max(s.failed_left_s - block_s, 0.0)
    speed_mps = math.fabs(s.drive_velocity_mps)
    ahead_mps = announced_ahead(s, t_ns, t_ns + round(1e9 * _look_ahead_s(p, s)))
    s.wanted_speed_mps = max(speed_mps, s.rising_mps, math.fabs(ahead_mps))
    sliding_mps = _still_sliding_mps(s)
    if s.moving == 0 and ahead_mps != 0.0:
        s.direction = 1 if ahead_mps > 0.0 else -1
        way = way_of(s)
    if s.moving == 1 and s.steady_s > STEADY_S and s.allowed_m == 0.0 and has_fallen(p, s):
        note_needed(s, speed_mps)
    if s.stopped == 1:
        enter(s, STOPPED)
    elif s.guard_state not in (NO_GUARD, ARMED, ACTIVE) or t_ns < p.enabled_from_ns:
        enter(s, DISABLED)
    elif s.mode in (DISABLED, STOPPED) or (
        s.moving == 0 and s.measured == 1 and s.stood_s > _TURNING_S and ahead_mps == 0.0
    ):
        enter(s, WATCH)

    if s.mode == WATCH:
        _watch(p, s, way, force_N, speed_mps, ahead_mps)
    elif s.mode == EXCITE:
        _hold(p, s, way, force_N, speed_mps, block_s)
    elif s.mode == PROBE and s.moving == 1 and follow_trial(p, s, force_N, speed_mps):
        excite(p, s, s.why, p.v_ratio)
    s.ratio_now = 0.0
    if s.mode == EXCITE:
        s.ratio_now = _held_ratio(p, s, way, force_N, speed_mps)
    elif s.mode == PROBE:
        s.ratio_now = s.fade
    s.wanted_velocity_mps = s.ratio_now * s.wanted_speed_mps
    if s.mode == EXCITE:
        s.wanted_velocity_mps = max(s.wanted_velocity_mps, _ABOVE_SLIDE * sliding_mps)


@kernel
def _still_sliding_mps(s: ControllerMemory) -> float:
    """Velocity of a slide that still slows down after its drive: v_a must not fall below it, or the slide sticks.

    Only a decrease counts: the vibration releases a slide that speeds up, and more v_a would release it more.
    """
    if s.steady_s > STEADY_S or s.mode != EXCITE or s.mode_s < STEADY_S:
        s.late_mps = math.inf
        return 0.0
    s.late_mps = min(s.late_mps, s.held_mps if s.level < 0 else min(math.fabs(s.sliding_mps), s.held_mps))
    return s.late_mps


@kernel
def _held_ratio(p: ControllerParams, s: ControllerMemory, way: int, force_N: float, speed_mps: float) -> float:
    """The ratio in EXCITE. The measured v_d lags by a window, so a drive that speeds up needs a larger ratio."""
    if s.steady_s > STEADY_S or s.held_mps > _RISING * speed_mps:
        return s.ratio[way]
    # more v_a only until the spring is wound up; after that the slide would run ahead
    if s.moved_s <= _BEGINS_S:
        s.wound = 1 if s.direction * force_N >= _WOUND * s.slid_N[way] else 0
    starts = s.moved_s < _STARTS_S and s.wound == 0
    ahead = max(s.ratio[way], p.v_ratio) * (_AHEAD if starts else 1.0)
    return max(s.ratio[way], min(ahead, largest_ratio(p, s, way)))


@kernel
def _look_ahead_s(p: ControllerParams, s: ControllerMemory) -> float:
    """Time from a command to v_a: loop delay, and for a drive at rest also the slew to the largest amplitude.

    For a moving drive it is the loop delay alone, as an early v_a would release a slide that a smaller v_a holds.
    """
    delay_s = (max(s.loop_delay_steps, 0) + 1) * p.block_s
    if s.moving == 1:
        return delay_s
    largest_m = (
        min(p.amplitude_max_m, p.velocity_max_mps / (TWO_PI * s.wanted_Hz)) if s.tuned == 1 else p.amplitude_max_m
    )
    return delay_s + largest_m / p.slew_m_per_step * p.block_s


@kernel
def _watch(
    p: ControllerParams,
    s: ControllerMemory,
    way: int,
    force_N: float,
    speed_mps: float,
    ahead_mps: float,
) -> None:
    if s.moving == 0:
        if ahead_mps != 0.0 and (p.mode == WHILE_MOVING or is_needed(s, math.fabs(ahead_mps))):
            _begin(p, s, NEEDED_BEFORE, 0.0, force_N, math.fabs(ahead_mps))
        return
    steady = s.steady_s > STEADY_S
    if s.off_left_s[way] > 0.0:
        return
    if p.mode == WHILE_MOVING:
        excite(p, s, MOVING, p.v_ratio)
    elif s.doubted & CONTACT:
        excite(p, s, BLIND, p.v_ratio)
    elif is_needed(s, speed_mps):
        _begin(p, s, NEEDED_BEFORE, 0.0, force_N, speed_mps)
    elif needless_from_mps(s) > 0.0 and not steady:
        pass  # a pair that needs no vibration may stick while the drive speeds up or slows down
    elif is_needless(s, speed_mps):
        pass  # a fall of the force ends this result
    elif s.blind == 1:
        _begin(p, s, BLIND, p.v_ratio, force_N, speed_mps)
    elif s.slip_began == 1 or s.contact == STICK:
        _begin(p, s, STICK_SEEN, p.v_ratio, force_N, speed_mps)


@kernel
def _begin(p: ControllerParams, s: ControllerMemory, why: int, ratio: float, force_N: float, speed_mps: float) -> None:
    """Begin the vibration of a move, or its trial without vibration if one is due."""
    if p.mode == WHILE_MOVING or not is_due(p, s, speed_mps):
        excite(p, s, why, ratio)
    elif s.moving == 1:
        begin_trial(p, s, force_N, speed_mps, 0)


@kernel
def _hold(p: ControllerParams, s: ControllerMemory, way: int, force_N: float, speed_mps: float, block_s: float) -> None:
    starting_s = _STARTING_S + 12.0 * max(s.loop_delay_steps, 0) * block_s
    s.waiting_s = max(s.waiting_s - block_s, 0.0)
    changed = s.steady_s < STEADY_S  # the slide may still lag behind a change of the drive
    # before its first even sliding a slide may stick because its spring still winds up, except at the exciter's limit
    sticks = s.stick_began == 1 and (s.even_s > 0.0 or s.at_limit == 1)
    settled = is_settled(s, 0.0)
    begun = (s.slip_began == 1 or sticks) and not changed and settled
    late = s.vibration_velocity_mps < _AT_DRIVE * speed_mps
    if (s.slip_began == 1 or s.stick_began == 1) and s.banded == 1 and late and settled:
        accept_weaker(p, s)
    if s.mode_s > starting_s and begun and s.waiting_s == 0.0:
        if s.slip_began == 1:
            note_needed(s, speed_mps)
            s.proven[way] = 1
            _note_failure(s)
        s.waiting_s = max(0.05, 3.0 * s.window_s, 2.0 * max(s.loop_delay_steps, 0) * block_s)
        _more(p, s, way, _SLIP_STEP if s.slip_began == 1 else _STICK_STEP)
    if changed:
        s.swing = max(s.swing, swing_held(p.v_ratio))  # at a new speed the ratio falls from the set point
        s.even_s, s.lead, s.top = 0.0, 0.0, -1.0
    settle_s = settling_s(p, s, force_N, speed_mps)
    s.lead *= max(1.0 - block_s / settle_s, 0.0)
    settled = is_settled(s, settle_s)
    if s.level >= 0 and s.mode_s > starting_s and not changed and s.waiting_s == 0.0 and settled:
        _note_swing(p, s, force_N, speed_mps, block_s, settle_s)
    if s.contact == SMOOTH and s.mode_s > starting_s and s.at_limit == 0 and settled:
        follow_swing(p, s, block_s, settle_s)
    if p.mode == WHILE_MOVING or s.moving == 0:
        return
    s.untried_s[way] += block_s
    follows = (s.contact == SMOOTH or s.blind == 1) and s.steady_s > STEADY_S and s.slip_began == 0
    if s.failed >= _HELPLESS and not changed and s.untried_s[way] > s.off_s[way]:
        s.failed = _FEWEST
        begin_trial(p, s, force_N, speed_mps, 1)
    elif follows and s.calm_s > 2.0 * WINDOW_S and is_due(p, s, speed_mps):
        begin_trial(p, s, force_N, speed_mps, 0)
    elif _is_useless(s) and follows and not is_needed(s, speed_mps) and s.doubted & CONTACT == 0:
        # below v_d a vibration does not reduce friction that is the same at every speed, and the slide slides
        note_needless(s, speed_mps)
        enter(s, WATCH)


@kernel
def _note_swing(
    p: ControllerParams, s: ControllerMemory, force_N: float, speed_mps: float, block_s: float, settle_s: float
) -> None:
    """Update the swing of friction from the swing of v_s, without the swing caused by the ratio."""
    share = min(block_s / min(max(_PERIODS * TWO_PI * settle_s, _SHORTEST_S), _LONGEST_S), 1.0)
    if s.steps % _LOOK_STEPS == 0 or s.swing_level < 0:
        s.swing_level = _swing_level(p, s, speed_mps)
    if s.swing_level < 0:
        return
    sliding_mps, sigma_mps = slide_mps(p, s, s.swing_level, speed_mps)
    off, noise = sliding_mps / speed_mps - 1.0 - s.lead, 3.0 * sigma_mps / speed_mps
    if is_wound_up(s, settle_s):
        s.swing *= 1.0 - share
    if math.fabs(off) < _EVEN + noise:
        s.even_s += block_s
        s.slid_N[way_of(s)] = s.direction * force_N
    s.top = max(s.top * (1.0 - share) if s.top > 0.0 else s.top, off)
    beyond, middle = max(off, 0.5 * (s.top - off)) - noise, 1.0 + 0.5 * (s.top + off)
    if beyond > 0.0 and middle > _LEAST_SLIDING:
        at_slide = max(s.ratio_now / middle, p.least_ratio)
        s.swing = max(s.swing, beyond / middle * grows(at_slide))


@kernel
def _swing_level(p: ControllerParams, s: ControllerMemory, speed_mps: float) -> int:
    """The level of the shortest windows that show the swing of v_s; -1: no level."""
    for level in range(p.levels):
        if s.pushed[level] < BINS:
            return -1
        shows = p.window_s[level] * s.allowed_Hz >= _EXCITER_PERIODS
        if shows and slide_mps(p, s, level, speed_mps)[1] <= _OF_SWING * speed_mps:
            return level
    return -1


@kernel
def _more(p: ControllerParams, s: ControllerMemory, way: int, by: float) -> None:
    """Raise the ratio of a vibration that is not enough, if the exciter allows it."""
    if s.at_limit == 0 and s.ratio[way] < p.most_ratio:
        raise_ratio(p, s, by)
        return
    s.calm_s = 0.0


@kernel
def _is_useless(s: ControllerMemory) -> bool:
    """Whether v_a has been below v_d since the vibration began, for a time in which several sticks were expected."""
    return s.weak_s > max(_USELESS_S, _STICKS * s.expected_stick_s, s.mode_s - _USELESS_S)


@kernel
def _note_failure(s: ControllerMemory) -> None:
    """Count a slip or surge under vibration; the first raises the ratio, and further ones show that this is not enough."""
    s.failed = s.failed + 1 if s.failed_left_s > 0.0 else 1
    s.failed_left_s = _REMEMBERED_S


@kernel
def slips_at_end(s: ControllerMemory) -> bool:
    """Whether slips or surges repeat under vibration."""
    return s.failed >= _FEWEST and s.failed_left_s > 0.0
