"""Trials without vibration: now and then a stretch, or a move, shows whether the vibration is needed and whether it helps.

A stretch begins with a fade; a move that starts while a trial is due begins without vibration. The fall of the raw force decides
(`controller.policy.fall`): a slip ends the trial, and the vibration is needed; without a slip it is not. A vibration at the end
of the exciter with slips is tried, too: it ends if the force falls as far with as without it.
"""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import PROBE, SMOOTH, STILL_NEEDED, WATCH
from controller.in_force import is_judged
from controller.policy.fall import WINDOW_S, has_fallen, restart_falls
from controller.policy.need import STEADY_S, is_needed, note_needed, note_needless, settling_s, way_of
from controller.trips.doubts import CONTACT

# Vibrated time of motion until a trial at a speed that is not known to need the vibration. Shorter: more runs pay a slip. Longer:
# an axis that needs no vibration has it for longer.
_FIRST_S = 35.0
_JITTER = 0.15  # relative range of these times, either way: trials do not fall into step with the machine's cycle
# Duration of a fade down to v_d, while the mean friction grows: shortest, longest, and in settling times of the spring, so that
# the slide follows.
_FADE_S, _SLOWEST_S, _SETTLINGS = 0.25, 20.0, 3.0
# v_a / v_d below which the mean friction of a slide that needs no vibration grows no more, and rate of the fade from there on.
# Slower: at 0.6 v_d the slide of a light stiff axis begins to swing, which it does at no other v_a.
_LAST, _LAST_PER_S = 0.98, 100.0
_STICKS = 2.0  # duration of a trial without vibration, in expected sticks
_SAME = 0.9  # fall with vibration, over the fall without, from which the vibration does not help
_RETRY_S = 60.0  # time until such a vibration is tried again; doubles each time
_A, _C, _M = 1_103_515_245, 12_345, 1 << 31  # linear congruential generator: a replay draws the same numbers
FIRST_RANDOM = _M // 2  # the first trial is due in the middle of the range


@kernel
def is_due(p: ControllerParams, s: ControllerMemory, speed_mps: float) -> bool:
    """Whether a trial is due at this speed; a doubted force shows no fall, so it would end a vibration that is needed."""
    if s.doubted & CONTACT:
        return False
    jitter = 1.0 + _JITTER * (2.0 * s.random / _M - 1.0)
    if is_needed(s, speed_mps):
        return s.untried_s[way_of(s)] > jitter * p.trial_every_s
    return s.untried_s[0] + s.untried_s[1] > jitter * _FIRST_S


@kernel
def begin_trial(p: ControllerParams, s: ControllerMemory, force_N: float, speed_mps: float, compares: int) -> None:
    """Begin a trial: by a fade if the base vibrates.

    Args:
        p, s: records of `controller.records`.
        force_N: present force.
        speed_mps: present |v_d|.
        compares: 1 if the trial shall show whether the vibration helps, 0 if it shall show whether it is needed.

    """
    s.fade = s.ratio_now
    fade_s = min(max(_FADE_S, _SETTLINGS * settling_s(p, s, force_N, speed_mps)), _SLOWEST_S)
    s.fade_per_s = max(s.fade - _LAST, 0.0) / fade_s
    s.compares, s.fall_without_N = compares, 0.0
    s.mode, s.mode_s = PROBE, 0.0
    s.random = (_A * s.random + _C) % _M
    restart_falls(s, force_N)


@kernel
def follow_trial(p: ControllerParams, s: ControllerMemory, force_N: float, speed_mps: float) -> bool:
    """Continue a trial at a force and a |v_d|; return whether the vibration begins again."""
    way = way_of(s)
    if s.doubted & CONTACT:
        return True
    if s.fade > 0.0:
        if s.steady_s < STEADY_S or not is_judged(s):
            return True
        per_s = s.fade_per_s if s.fade > _LAST else _LAST_PER_S
        s.fade = max(s.fade - max(per_s * p.block_s, 1e-6), 0.0)
        if (
            s.fade < _LAST
        ):  # friction that falls with speed falls with v_a, too: falls count from the end of the fade on
            restart_falls(s, force_N)
    elif s.steady_s > STEADY_S:
        s.tried_s[way] += p.block_s  # a trial may need several moves
    hold_s = max(2.0 * WINDOW_S, _STICKS * s.expected_stick_s)
    if s.compares == 1:
        s.fall_without_N = max(s.fall_without_N, s.fall_N)
        if s.tried_s[way] < hold_s:
            return False
        s.untried_s[way], s.tried_s[way] = 0.0, 0.0
        s.off_s[way] = _RETRY_S if s.off_s[way] == 0.0 else 2.0 * s.off_s[way]
        if s.fall_with_N[way] <= _SAME * s.fall_without_N:
            s.why = STILL_NEEDED
            return True
        s.off_left_s[way] = s.off_s[way]
        s.mode, s.mode_s = WATCH, 0.0
        return False
    if has_fallen(p, s):
        note_needed(s, speed_mps)
        s.untried_s[way], s.tried_s[way], s.why = 0.0, 0.0, STILL_NEEDED
        return True
    if s.tried_s[way] > hold_s and s.contact == SMOOTH:
        note_needless(s, speed_mps)
        s.untried_s[way], s.tried_s[way] = 0.0, 0.0
        s.mode, s.mode_s = WATCH, 0.0
    return False
