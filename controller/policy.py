"""When to vibrate, and how strongly. A wrong policy does no harm, as `limits` bounds the vibration.

WATCH   no vibration; a stick or a slip leads to EXCITE at once: an early release is a small slip, a late release a large slip
EXCITE  hold v_a at a ratio to v_d that falls step by step to the least that is needed, and rises at every stick, slip or surge
PROBE   fade out, no faster than the slide follows, to see whether the vibration is needed at all
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import (
    ACTIVE,
    ARMED,
    BLIND,
    CANNOT_HELP,
    DISABLED,
    DRIVE_STANDS,
    EXCITE,
    HARMFUL,
    HELD,
    MOVING,
    NEEDED_BEFORE,
    NO_GUARD,
    NOT_ARMED,
    NOT_ENABLED,
    NOTHING_TO_DO,
    PROBE,
    SETTLING,
    SMOOTH,
    START_OF_MOVE,
    STICK,
    STICK_SEEN,
    STOPPED,
    WATCH,
)
from controller.announced import announced_ahead
from controller.config import MODES
from controller.frequency import cheapest
from controller.modes import enter, excite, stop_helping, tune_to
from controller.needs.failures import forget_failures, note_failure, note_lesson
from controller.needs.need import (
    follow_swing,
    grows,
    is_needed,
    is_needless,
    is_wound_up,
    needless_from_mps,
    note_needed,
    raise_ratio,
    settling_s,
    swing_held,
    way_of,
)
from controller.needs.probe import STEADY_S, begin_probe, probe
from controller.needs.wobble import LEAST_ASKED, slide_mps, slide_noise_mps, windows_for, wobble_factor
from controller.trips.stall import is_judged

TWO_PI = 2.0 * math.pi
ON_DEMAND, WHILE_MOVING, START_ONLY, SETTLE = range(len(MODES))

_STICK_STEP, _SLIP_STEP = 0.08, 0.4  # rise of the ratio at a stick, and at a slip or a surge
# Duration of the start of a move; force over sliding force from which the spring is wound up; factor on the ratio until then.
_STARTS_S, _WOUND, _AHEAD = 0.2, 0.5, 1.25
_BEGINS_S = 0.02  # first part of a move, in which the spring's force decides whether it is wound up
_RISING = 1.05  # `held_mps` over measured |v_d| above which the drive slows down
_ABOVE_SLIDE = 1.1  # least v_a over v_s of a slide that slows down after its drive
_TURNING_S = 0.05  # longest rest of a drive at a reversal
_STARTING_S = 0.15  # first part of a vibration, in which slips do not count: they release the force stored before
# Shortest stick, over the expected stick, that contradicts a result "not needed": the force has risen by 5 % then
_REAL_STICK = 0.25
_CALM_SHARE = 6.0  # expected stick lengths without an event until the vibration counts as helpful
_LEAST_CALM_S, _MOST_CALM_S = 0.5, 4.0  # bounds of this time
_LOOK_STEPS = 16  # steps between two selections of the windows in which the swing of v_s is measured
_LEAST_SLIDING = 0.5  # least mean v_s over v_d; a slower slide gives no information on the swing of friction
_EVEN = 0.1  # largest deviation of v_s from v_d, over v_d, of a slide that follows
# Memory of a swing of friction: two periods of the slowest swing that the spring does not level out; 10 s at most, for energy.
_PERIODS, _LONGEST_S = 2.0, 10.0
_SEEING_S = 2.0  # time for which noise must not hide a stick until BLIND ends
_HELPLESS = 3  # sticks or slips at the exciter's limit until another frequency is tried; as many again: CANNOT_HELP
_WORSE = 1.1  # mean square of v_s / v_d - 1 with vibration, over without, from which the vibration is harmful


@kernel
def decide(p: ControllerParams, s: ControllerMemory, t_ns: int, force_N: float, block_s: float) -> None:
    """Set the mode and its reason, and the wanted vibration velocity amplitude [m/s]."""
    s.mode_s += block_s
    way = way_of(s)
    for i in range(2):
        s.off_left_s[i] = max(s.off_left_s[i] - block_s, 0.0)
    speed_mps = math.fabs(s.drive_velocity_mps)
    ahead_mps = announced_ahead(s, t_ns, t_ns + round(1e9 * _look_ahead_s(p, s)))
    s.wanted_speed_mps = max(speed_mps, s.rising_mps, math.fabs(ahead_mps))
    sliding_mps = _still_sliding_mps(s)
    if s.moving == 0 and ahead_mps != 0.0:
        s.direction = 1 if ahead_mps > 0.0 else -1
        way = way_of(s)
    _note_roughness(s, speed_mps, block_s)
    if s.stopped == 1:
        enter(s, STOPPED, NOT_ENABLED)
    elif s.guard_state not in (NO_GUARD, ARMED, ACTIVE):
        enter(s, DISABLED, NOT_ARMED)
    elif t_ns < p.enabled_from_ns:
        enter(s, DISABLED, NOT_ENABLED)
        if s.slip_began == 1 and s.moving == 1:
            note_needed(s, speed_mps)
    elif s.mode in (DISABLED, STOPPED):
        enter(s, WATCH, NOTHING_TO_DO)
    elif s.moving == 0 and s.mode != WATCH and s.measured == 1 and s.stood_s > _TURNING_S:
        if ahead_mps == 0.0:
            _stand(p, s)
    elif s.moving == 0 and s.mode == WATCH and s.reason != SETTLING:
        s.reason = BLIND if s.blind == 1 else DRIVE_STANDS

    ratio = 0.0
    if s.mode == WATCH:
        ratio = _watch(p, s, way, speed_mps, ahead_mps, block_s)
    elif s.mode == EXCITE:
        _hold(p, s, way, force_N, speed_mps, block_s)
    elif s.mode == PROBE:
        probe(p, s, way, speed_mps, block_s)
    if s.mode == EXCITE:
        ratio = _held_ratio(p, s, way, force_N, speed_mps)
        if s.wobbles == 1:
            ratio = max(ratio, LEAST_ASKED) * wobble_factor(s)
    elif s.mode == PROBE:
        ratio = s.fade
    s.ratio_now = ratio
    s.wanted_velocity_mps = ratio * (s.settle_mps if s.mode == WATCH else s.wanted_speed_mps)
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
    return max(s.ratio[way], p.v_ratio) * (_AHEAD if starts else 1.0)


@kernel
def _look_ahead_s(p: ControllerParams, s: ControllerMemory) -> float:
    """Time from a command to v_a: loop delay, and for a drive at rest also the slew to the largest amplitude.

    For a moving drive it is the loop delay alone, as an early v_a would release a slide that a smaller v_a holds.
    """
    if s.moving == 1:
        return (max(s.loop_delay_steps, 0) + 1) * p.block_s
    largest_m = (
        min(p.amplitude_max_m, p.velocity_max_mps / (TWO_PI * s.wanted_Hz)) if s.tuned == 1 else p.amplitude_max_m
    )
    delay_s = (max(s.loop_delay_steps, 0) + 1) * p.block_s
    return delay_s + largest_m / p.slew_m_per_step * p.block_s


@kernel
def _stand(p: ControllerParams, s: ControllerMemory) -> None:
    if p.mode == SETTLE and s.mode == EXCITE:
        s.settle_left_s, s.settle_mps = p.settle_s, s.held_mps
        enter(s, WATCH, SETTLING)
    else:
        enter(s, WATCH, DRIVE_STANDS)


@kernel
def _watch(
    p: ControllerParams, s: ControllerMemory, way: int, speed_mps: float, ahead_mps: float, block_s: float
) -> float:
    """Step of the mode WATCH; returns the ratio of a vibration that fades out after a move."""
    if s.reason == SETTLING:
        s.settle_left_s = max(s.settle_left_s - block_s, 0.0)
        if s.settle_left_s == 0.0:
            s.reason = DRIVE_STANDS
        return p.v_ratio * s.settle_left_s / p.settle_s
    if s.moving == 0:
        if ahead_mps != 0.0 and (p.mode == WHILE_MOVING or is_needed(s, math.fabs(ahead_mps))):
            excite(p, s, NEEDED_BEFORE, 0.0)
        return 0.0
    if s.reason in (DRIVE_STANDS, BLIND):
        s.reason = NOTHING_TO_DO
    steady = s.steady_s > STEADY_S
    if s.slip_began == 1 and steady:
        note_needed(s, speed_mps)
    if s.harmful[way] >= 2:
        s.reason = HARMFUL
        return 0.0
    if s.off_left_s[way] > 0.0:
        return 0.0
    if s.reason in (CANNOT_HELP, HARMFUL):
        s.reason = NOTHING_TO_DO
    began = s.moved_s <= 2.0 * block_s
    if p.mode == WHILE_MOVING:
        excite(p, s, MOVING, p.v_ratio)
    elif p.mode == START_ONLY:
        if began:
            excite(p, s, START_OF_MOVE, p.v_ratio)
    elif s.blind == 1:
        excite(p, s, BLIND, p.v_ratio)
    elif is_needed(s, speed_mps):
        excite(p, s, NEEDED_BEFORE, 0.0)
    elif needless_from_mps(s) > 0.0 and not steady:
        pass  # a pair that needs no vibration may stick while the drive speeds up or slows down
    elif s.slip_began == 1 or (s.contact == STICK and not is_needless(s, speed_mps)):
        excite(p, s, STICK_SEEN, p.v_ratio)
    # the slide slid at this speed and sticks again, for longer than a swing on its spring would last
    elif (
        s.contact == STICK
        and s.stick_s > _REAL_STICK * s.expected_stick_s
        and s.slid_s > max(s.expected_stick_s, STEADY_S)
    ):
        note_needed(s, speed_mps)
        excite(p, s, STICK_SEEN, p.v_ratio)
    s.slid_s = s.slid_s + block_s if s.contact == SMOOTH and steady else 0.0 if not steady else s.slid_s
    return 0.0


@kernel
def _hold(p: ControllerParams, s: ControllerMemory, way: int, force_N: float, speed_mps: float, block_s: float) -> None:
    starting_s = _STARTING_S + 12.0 * max(s.loop_delay_steps, 0) * block_s
    if p.mode == START_ONLY and s.moved_s > p.start_s:
        enter(s, WATCH, NOTHING_TO_DO)
        return
    s.waiting_s = max(s.waiting_s - block_s, 0.0)
    forget_failures(s, block_s)
    changed = s.steady_s < STEADY_S  # the slide may still lag behind a change of the drive
    # before its first even sliding a slide may stick because its spring still winds up, except at the exciter's limit
    sticks = s.stick_began == 1 and (s.even_s > 0.0 or s.at_limit == 1)
    begun = (s.slip_began == 1 or sticks) and not changed
    if s.mode_s > starting_s and s.slip_began == 1 and changed and s.waiting_s == 0.0:
        s.waiting_s = STEADY_S
        note_failure(s)
    if s.mode_s > starting_s and begun and s.waiting_s == 0.0:
        if s.slip_began == 1:
            note_needed(s, speed_mps)
            note_lesson(s)
        s.waiting_s = max(0.05, 3.0 * s.window_s, 2.0 * max(s.loop_delay_steps, 0) * block_s)
        _more(p, s, way, _SLIP_STEP if s.slip_began == 1 else _STICK_STEP)
        if s.mode != EXCITE:
            return
    if changed:
        s.swing = max(s.swing, swing_held(p.v_ratio))  # at a new speed the ratio falls from the set point
        s.even_s, s.lead, s.top = 0.0, 0.0, -1.0
    settle_s = settling_s(p, s, force_N, speed_mps)
    s.lead *= max(1.0 - block_s / settle_s, 0.0)
    judged = is_judged(s)
    if s.level >= 0 and s.mode_s > starting_s and not changed and s.waiting_s == 0.0 and judged:
        _note_swing(p, s, force_N, speed_mps, block_s, settle_s)
    if s.contact == SMOOTH and s.mode_s > starting_s and s.wobbles == 0 and s.at_limit == 0 and judged:
        follow_swing(p, s, block_s, settle_s)
    if s.calm_s > min(max(_CALM_SHARE * s.expected_stick_s, _LEAST_CALM_S), _MOST_CALM_S):
        s.helpless = 0
    if p.mode in (WHILE_MOVING, START_ONLY):
        return
    if s.blind == 1:
        s.reason, s.mode_s = BLIND, 0.0
    elif s.reason == BLIND and s.mode_s > _SEEING_S:
        s.reason = HELD
    if s.reason == BLIND:
        return
    begin_probe(p, s, way, force_N, speed_mps)


@kernel
def _note_swing(
    p: ControllerParams, s: ControllerMemory, force_N: float, speed_mps: float, block_s: float, settle_s: float
) -> None:
    """Update the swing of friction from the swing of v_s, without the swing caused by the ratio or its wobble."""
    share = min(block_s / min(max(_PERIODS * TWO_PI * settle_s, _LEAST_CALM_S), _LONGEST_S), 1.0)
    if s.steps % _LOOK_STEPS == 0 or s.swing_level < 0:
        s.swing_level = windows_for(p, s, speed_mps)
    if s.swing_level < 0:
        return
    off = slide_mps(p, s, s.swing_level, speed_mps) / speed_mps - 1.0 - s.lead
    noise = 3.0 * slide_noise_mps(p, s, s.swing_level) / speed_mps
    if is_wound_up(s, settle_s):
        s.swing *= 1.0 - share
    if math.fabs(off) < _EVEN + noise:
        s.even_s += block_s
        s.slid_N[way_of(s)] = s.direction * force_N
    if s.wobbles == 1:
        return
    s.top = max(s.top * (1.0 - share) if s.top > 0.0 else s.top, off)
    beyond, middle = max(off, 0.5 * (s.top - off)) - noise, 1.0 + 0.5 * (s.top + off)
    if beyond > 0.0 and middle > _LEAST_SLIDING:
        at_slide = max(s.ratio_now / middle, p.least_ratio)
        s.swing = max(s.swing, beyond / middle * grows(at_slide))


@kernel
def _more(p: ControllerParams, s: ControllerMemory, way: int, by: float) -> None:
    """Respond to a vibration that is not enough: raise the ratio, then try another frequency, then end the vibration."""
    if s.at_limit == 0 and s.ratio[way] < p.most_ratio:
        raise_ratio(p, s, by)
        return
    s.calm_s = 0.0
    note_failure(s)
    s.helpless += 1
    if s.helpless == _HELPLESS and p.candidates > 1:
        tune_to(p, s, cheapest(p, s, s.ratio[way] * s.wanted_speed_mps, s.candidate))
    elif s.helpless >= 2 * _HELPLESS:
        s.helpless = 0
        s.rough_with[way] = s.roughness / max(s.roughness_s, 1e-9)
        stop_helping(s, CANNOT_HELP)


@kernel
def _note_roughness(s: ControllerMemory, speed_mps: float, block_s: float) -> None:
    """Integrate (v_s / v_d - 1)^2, which shows whether a vibration makes the motion worse."""
    if s.level < 0 or s.moving == 0:
        return
    off = s.sliding_mps / speed_mps - 1.0
    s.roughness += off * off * block_s
    s.roughness_s += block_s
    way = way_of(s)
    if s.mode == WATCH and s.reason == CANNOT_HELP and s.roughness_s > 1.0 and s.rough_with[way] > 0.0:
        without = s.roughness / s.roughness_s
        s.harmful[way] = s.harmful[way] + 1 if s.rough_with[way] > _WORSE * without else 0
        s.rough_with[way] = 0.0
