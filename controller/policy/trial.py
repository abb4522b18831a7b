"""Trials without vibration: now and then a stretch, or a move, shows whether the vibration is needed and whether it helps.

The raw force decides: a slip relaxes the drive's spring, and the force falls from its crest. Falls without vibration that exceed
the falls with it show that the vibration is needed. Without such a fall the slide slides, and it is not needed, or the slips
continue as before, and it cannot help. Without a force sensor the elongation of the spring takes the place of the force.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire import stickslip_pb2 as wire
from controller.estimate.windows import FEWEST, FORCE
from controller.in_force import is_settled
from controller.policy.need import is_needed, is_needless, note_needed, note_needless, way_of
from controller.policy.ratio import settling_s
from controller.trips.doubts import CONTACT

# Time in which the crest of the force is remembered. Shorter: a slide that slips for half of it, with a natural period of 0.5 s,
# shows half of its fall. Longer: friction that changes along the track looks like a fall.
WINDOW_S = 0.5
STEADY_S = 0.2  # duration of constant v_d from which the slide follows it
# Least fall in a slip, over the force; friction that falls by 8 % gives twice that. Smaller: the swing at the end of a fade, of
# 7 % at 100 kg on 5 N/um and 11 % at 1 kg on 11 N/um. Larger: stick-slip of friction that falls by less is not seen.
_LEAST = 0.15
_TIMES = 1.5  # least fall without vibration, over the largest fall with vibration: a track's waves are in both
# Least fall, in sigmas of the slope of four bins times a bin, of which a bin has √5: two extremes of 5000 bins are 7 sigma apart.
_NOISES = 8.0 * math.sqrt(5.0)
_FORGETS = 0.98  # factor of the largest fall with vibration at each window: half of it after 17 s
# Vibrated time of motion until a trial at a speed that is not known to need the vibration. Shorter: more runs pay a slip. Longer:
# an axis that needs no vibration has it for longer.
_FIRST_S = 35.0
# Relative range of these times, either way, so that trials do not fall into step with the machine's cycle; the share of the range
# by which each differs from the last.
_JITTER, _GOLDEN = 0.15, 0.618
_SETTLINGS = 3.0  # duration of a fade down to v_d, while the mean friction grows, in settling times of the spring
# Duration of a trial, at least and in expected sticks. Shorter: steel at 2 mm/s, whose swing grows for 4 s until it slips.
_LEAST_S, _STICKS = 5.0, 2.0
_RETRY_S = 60.0  # time without a vibration that does not help; doubles each time
AT_END, HELPLESS = 2.0, 7.0  # slips under vibration from which the exciter is at its end; from which a trial is due


@kernel
def note_fall(p: ControllerParams, s: ControllerMemory, force_N: float) -> None:
    """Update crest and fall with the mean force of a bin [N]."""
    along_N = s.direction * force_N
    if s.moved_s < WINDOW_S:  # at the start of a move the slide swings about its mean
        restart_falls(s, force_N)
    s.fall_s += p.bin_s
    if s.fall_s > WINDOW_S:
        if s.mode == wire.EXCITE and min(s.mode_s, s.steady_s) > 2.0 * WINDOW_S:
            way = way_of(s)
            s.fall_with_N[way] = max(_FORGETS * s.fall_with_N[way], s.fall_N)
        s.fall_s, s.fall_N, s.crest_before_N, s.crest_N = 0.0, 0.0, s.crest_N, along_N
    s.crest_N = max(s.crest_N, along_N)
    s.fall_N = max(s.fall_N, max(s.crest_N, s.crest_before_N) - along_N)


@kernel
def restart_falls(s: ControllerMemory, force_N: float) -> None:
    """Forget crest and falls up to now."""
    s.fall_s, s.fall_N = 0.0, 0.0
    s.crest_N = s.crest_before_N = s.direction * force_N


@kernel
def has_fallen(p: ControllerParams, s: ControllerMemory) -> bool:
    """Whether the force fell by more than noise, waves of the track and the vibrated slide explain."""
    return shows_falls(p, s, s.fall_N) and s.fall_N > max(_LEAST * _crest_N(s), _TIMES * s.fall_with_N[way_of(s)])


@kernel
def shows_falls(p: ControllerParams, s: ControllerMemory, fall_N: float) -> bool:
    """Whether a fall of the force [N] exceeds its noise."""
    noise_N = p.bin_s * s.sigma[FORCE, 0] + s.resolution[FORCE]
    return s.differences[0] >= FEWEST and _crest_N(s) > 0.0 and fall_N > _NOISES * noise_N


@kernel
def _crest_N(s: ControllerMemory) -> float:
    return max(s.crest_N, s.crest_before_N)


@kernel
def length_s(s: ControllerMemory) -> float:
    """Duration of a trial [s]."""
    return max(_LEAST_S, _STICKS * s.expected_stick_s)


@kernel
def calm_s(s: ControllerMemory) -> float:
    """Time since the last stick or slip [s]."""
    return min(s.since_stick_s, s.slipped_s) if s.slipping == 0 else 0.0


@kernel
def is_due(p: ControllerParams, s: ControllerMemory, speed_mps: float) -> bool:
    """Whether a trial is due at this speed; a doubted force shows no fall, so it would end a vibration that is needed."""
    if s.doubted & CONTACT:
        return False
    if s.tried_s[way_of(s)] > 0.0:  # a trial goes on over several moves
        return True
    jitter = 1.0 + _JITTER * (2.0 * ((0.5 + _GOLDEN * s.trials) % 1.0) - 1.0)
    if is_needed(s, speed_mps):
        return s.untried_s[way_of(s)] > jitter * p.trial_every_s
    if is_needless(s, math.inf):  # the need ends at some speed, perhaps below this one
        return s.untried_s[way_of(s)] > length_s(s)
    return s.untried_s[0] + s.untried_s[1] > jitter * _FIRST_S


@kernel
def begin_trial(p: ControllerParams, s: ControllerMemory, force_N: float, speed_mps: float) -> None:
    """Begin a trial at a force and a |v_d|: by a fade if the base vibrates."""
    s.fade = s.ratio_now
    s.fade_per_s = max(s.fade - 1.0, 0.0) / max(WINDOW_S, _SETTLINGS * settling_s(p, s, force_N, speed_mps))
    s.mode, s.mode_s = wire.PROBE, 0.0
    restart_falls(s, force_N)


@kernel
def follow_trial(p: ControllerParams, s: ControllerMemory, force_N: float, speed_mps: float) -> int:
    """Continue a trial at a force and a |v_d|; return the mode after it."""
    way = way_of(s)
    if s.doubted & CONTACT or (s.fade > 0.0 and (s.steady_s < STEADY_S or not is_settled(s, 0.0))):
        return wire.EXCITE
    if s.fade > 0.0:
        s.fade -= s.fade_per_s * p.block_s
        # Below v_d the mean friction grows no more, but at 0.6 v_d the slide of a light stiff axis begins to swing. Friction that
        # falls with speed falls with v_a, too, so falls count from here on.
        if s.fade <= 1.0:
            s.fade = 0.0
            restart_falls(s, force_N)
    elif s.steady_s > STEADY_S:
        s.tried_s[way] += p.block_s  # a trial may need several moves
    needed, helpless = has_fallen(p, s), s.failed > HELPLESS
    if not needed and (s.tried_s[way] < length_s(s) or (calm_s(s) < WINDOW_S and not helpless)):
        return wire.PROBE
    s.untried_s[way], s.tried_s[way], s.trials = 0.0, 0.0, s.trials + 1
    s.failed = min(s.failed, AT_END)
    if needed:
        note_needed(s, speed_mps)
        s.why = wire.STILL_NEEDED
        return wire.EXCITE
    if helpless:
        s.off_s[way] = _RETRY_S if s.off_s[way] == 0.0 else 2.0 * s.off_s[way]
        s.off_left_s[way] = s.off_s[way]
    elif s.contact == wire.SMOOTH or shows_falls(p, s, _LEAST * _crest_N(s)):
        note_needless(s, speed_mps)
    else:  # neither force nor slide shows an answer
        return wire.EXCITE
    return wire.WATCH
