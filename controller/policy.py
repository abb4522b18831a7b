"""When to vibrate, how strongly, at which frequency. A wrong policy does no harm: `limits` decides which vibration is allowed.

WATCH   no vibration; a stick leads to EXCITE, or to WAIT when it is too late for the coming slip
WAIT    a vibration that starts this late causes the slip that it should prevent: wait for the re-stick
EXCITE  hold v_a at v_ratio v_d; just above v_d at first where breakaway is near
PROBE   fade out from time to time: a stick shows that the vibration is still needed, smooth sliding that it is not
"""

import math

from bridge.kernel import Record, kernel
from controller.codes import (
    DISABLED,
    DRIVE_STANDS,
    EXCITE,
    HELD,
    LATE_SO_GENTLE,
    NOT_ENABLED,
    NOT_NEEDED,
    NOTHING_TO_DO,
    PIEZO_WEAK,
    PROBE,
    STANDSTILL,
    STICK,
    STICK_SEEN,
    STILL_NEEDED,
    STOPPED,
    TOO_LATE,
    WAIT,
    WATCH,
)
from controller.onset import known_breakaway_N

TWO_PI = 2.0 * math.pi
# Steps of smooth sliding until a gentle vibration is raised. Fewer: the raise may cause a slip. More: weak for longer.
_SMOOTH_STEPS_TO_RAISE = 200
# Steps without stick after which WAIT ends without a slip, as when the drive slows down.
_RELAXED_STEPS = 500
# Steps without a limit before the amplitude is trimmed. Fewer: filter and delay still show the limited command. More: late trim.
_FREE_STEPS_TO_TRIM = 10
# Share of the set point below which the measured v_a is not trusted. Larger: a weak piezo is not trimmed. Smaller: the noise of
# a dead accelerometer is.
_LEAST_SHARE_TO_TRIM = 0.02
# Largest correction, a factor of 30 either way. Smaller: a lightly damped mount, which amplifies 10 to 25 times, is not held.
_LARGEST_LOG_GAIN = 3.4
# Steps in a row until a piezo is called weak, and until no longer. Fewer: noise around 1.05 switches. More: it is told late.
_WEAK_STEPS = 50
_ALARM_RATIO = 1.05  # v_a / v_d below which a vibration is too weak: 1.00 does not stop stick-slip, 1.05 does


@kernel
def _enter(s: Record, mode: int, reason: int) -> None:
    if s.mode != mode:
        s.mode = mode
        s.steps_in_mode = 0
        s.smooth_steps = 0
        s.fade = 1.0
    s.reason = reason


@kernel
def choose_frequency(p: Record, velocity_mps: float) -> float:
    """Lowest candidate whose amplitude for `velocity_mps` uses at most 80 % of the stroke; else the highest [Hz]."""
    for i in range(p.candidates):
        if velocity_mps / (TWO_PI * p.candidate_Hz[i]) <= 0.8 * p.amplitude_max_m:
            return p.candidate_Hz[i]
    return p.candidate_Hz[p.candidates - 1]


@kernel
def _begin_to_excite(p: Record, s: Record, reason: int, gentle: int) -> None:
    _enter(s, EXCITE, reason)
    s.gentle = gentle
    s.probe_steps = max(s.probe_steps, p.probe_steps)
    if s.allowed_m == 0.0:
        s.wanted_Hz = choose_frequency(p, p.v_ratio * s.drive_velocity_held_mps)
        s.log_gain = 0.0


@kernel
def decide(p: Record, s: Record, t_ns: int, force_N: float) -> None:
    """Set the mode and its reason, and the wanted vibration velocity amplitude [m/s]."""
    s.steps_in_mode += 1
    s.smooth_steps = s.smooth_steps + 1 if s.contact != STICK and s.slipping == 0 else 0
    if s.stopped == 1:
        _enter(s, STOPPED, NOT_ENABLED)
    elif t_ns < p.enabled_from_ns:
        _enter(s, DISABLED, NOT_ENABLED)
    elif s.mode in (DISABLED, STOPPED):
        _enter(s, WATCH, NOTHING_TO_DO)
    elif s.contact == STANDSTILL:
        _enter(s, WATCH, DRIVE_STANDS)

    if s.mode == WATCH:
        breakaway_N = known_breakaway_N(p, s)
        near = force_N / breakaway_N if breakaway_N > 0.0 else 0.0
        if s.slipping == 1:
            s.slips_at_wait = s.slips - 1
            _enter(s, WAIT, TOO_LATE)
        elif s.contact == STICK and s.score > 0.5:
            if near >= p.too_late_from:
                s.slips_at_wait = s.slips
                _enter(s, WAIT, TOO_LATE)
            elif near >= p.gentle_from:
                _begin_to_excite(p, s, LATE_SO_GENTLE, 1)
            else:
                _begin_to_excite(p, s, STICK_SEEN, 0)
    elif s.mode == WAIT:
        if s.slips > s.slips_at_wait and s.slipping == 0:
            _begin_to_excite(p, s, STICK_SEEN, 0)
        elif s.smooth_steps > _RELAXED_STEPS:
            _enter(s, WATCH, NOTHING_TO_DO)
    elif s.mode == EXCITE:
        if s.gentle == 1 and s.smooth_steps > _SMOOTH_STEPS_TO_RAISE:
            s.gentle = 0
            s.reason = HELD
        if s.steps_in_mode > s.probe_steps:
            _enter(s, PROBE, HELD)
    elif s.mode == PROBE:
        s.fade = max(s.fade - p.block_s / p.probe_fade_s, 0.0)
        if s.slipping == 1 or (s.contact == STICK and s.score > 0.5):
            s.probe_steps = min(2 * s.probe_steps, p.probe_steps_max)
            _begin_to_excite(p, s, STILL_NEEDED, 1)
        elif s.fade == 0.0 and s.smooth_steps > p.probe_hold_steps:
            s.probe_steps = p.probe_steps
            _enter(s, WATCH, NOT_NEEDED)

    ratio = 0.0
    if s.mode == EXCITE:
        ratio = p.gentle_ratio if s.gentle == 1 else p.v_ratio
    elif s.mode == PROBE:
        ratio = p.v_ratio * s.fade
    s.wanted_velocity_mps = ratio * s.drive_velocity_held_mps


@kernel
def _judge_piezo(s: Record, weak: bool) -> None:
    s.weak_steps = max(s.weak_steps, 0) + 1 if weak else min(s.weak_steps, 0) - 1
    if s.weak_steps > _WEAK_STEPS:
        s.reason = PIEZO_WEAK
    elif s.weak_steps < -_WEAK_STEPS and s.reason == PIEZO_WEAK:
        s.reason = HELD


@kernel
def want(p: Record, s: Record) -> None:
    """Turn the wanted velocity into frequency and amplitude, and trim the amplitude by the measured v_a.

    The loop works on logarithms, where the exciter's unknown gain is a constant, so its margins hold for any mount.
    """
    velocity_mps = s.wanted_velocity_mps
    if velocity_mps <= 0.0:
        s.wanted_m = 0.0
        _judge_piezo(s, weak=False)
        return
    trusted = s.vibration_velocity_mps > _LEAST_SHARE_TO_TRIM * velocity_mps
    settled = s.free_steps > _FREE_STEPS_TO_TRIM
    too_strong = s.vibration_velocity_mps > velocity_mps  # trimmed at once, so that a resonating mount does not ring up
    if trusted and (settled or too_strong) and s.mode == EXCITE:
        s.log_gain += p.loop_gain * (math.log(velocity_mps) - math.log(s.vibration_velocity_mps))
        s.log_gain = min(max(s.log_gain, -_LARGEST_LOG_GAIN), _LARGEST_LOG_GAIN)
    s.wanted_m = velocity_mps * math.exp(s.log_gain) / (TWO_PI * s.wanted_Hz)
    if s.wanted_m > p.amplitude_max_m:
        higher_Hz = choose_frequency(p, velocity_mps * math.exp(s.log_gain))
        if higher_Hz > s.wanted_Hz:
            s.wanted_Hz = higher_Hz
            s.wanted_m = velocity_mps * math.exp(s.log_gain) / (TWO_PI * higher_Hz)
    largest_m = min(p.amplitude_max_m, p.velocity_max_mps / (TWO_PI * s.wanted_Hz))
    helpless = s.wanted_m > largest_m or (settled and not trusted)  # too weak at its limit, or no vibration arrives
    _judge_piezo(s, helpless and s.vibration_velocity_mps < _ALARM_RATIO * s.drive_velocity_mps)
