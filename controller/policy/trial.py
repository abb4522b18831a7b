"""Trials without vibration: now and then a stretch, or a move, shows whether the vibration is needed and whether it helps.

A slip shows the need, and so does the raw force where no window is short enough: a slip relaxes the drive's spring, and the force
falls from its crest. Without slip and fall the vibration is not needed. Where slips repeat under vibration, only a larger fall
without it shows that it helps. Without a force sensor the elongation of the spring takes the place of the force.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire import stickslip_pb2 as wire
from controller.estimate.windows import FEWEST, FORCE
from controller.in_force import is_settled
from controller.policy.ratio import settling_s
from controller.trips.doubts import CONTACT

# Time in which the crest of the force is remembered. Shorter: a slide that slips for half of it, with a natural period of 0.5 s,
# shows half of its fall. Longer: friction that changes along the track looks like a fall.
WINDOW_S = 0.5
STEADY_S = 0.2  # duration of constant v_d from which the slide follows it
# Least fall in a slip, over the force; friction that falls by 8 % gives twice that. Smaller: the swing at the end of a fade, of
# 7 % at 100 kg on 5 N/um and 11 % at 1 kg on 11 N/um. Larger: stick-slip of friction that falls by less is not seen.
_LEAST = 0.15
REMEMBERED_S = 30.0  # time constant with which slips and falls under vibration are forgotten
_TIMES = 1.5  # least fall without vibration, over the largest fall with vibration: a track's waves are in both
# Least fall, in sigmas of the slope of four bins times a bin: 8 sigma of a bin, as two extremes of 5000 bins are 7 apart.
_NOISES = 18.0
# Vibrated time of motion until a trial at a speed that is not known to need the vibration. Shorter: more runs pay a slip. Longer:
# an axis that needs no vibration has it for longer.
_FIRST_S = 35.0
# Duration of a trial, at least and in expected sticks. Shorter: steel at 2 mm/s, whose swing grows for 4 s until it slips.
_LEAST_S, _STICKS = 5.0, 2.0
# Least duration of a fade down to v_d, while the mean friction grows, in settling times of the spring. Shorter: PTFE runs ahead
# after a fade of 0.5 s and seems to slip.
_SETTLINGS = 3.0
_RETRY_S = 60.0  # time without a vibration that does not help
_AROUND = 1.25  # a result at a speed holds for speeds up to this factor higher (needed) or lower (not needed)
AT_END, HELPLESS = 2.0, 7.0  # slips under vibration from which the exciter is at its end; from which a trial is due


@kernel
def is_needed(s: ControllerMemory, speed_mps: float) -> bool:
    """Whether vibration was shown to be needed at this speed."""
    return speed_mps <= s.needed_to_mps


@kernel
def is_needless(s: ControllerMemory, speed_mps: float) -> bool:
    """Whether vibration was shown not to be needed at this speed; at an infinite speed: at any."""
    return 0.0 < s.needless_from_mps <= speed_mps


@kernel
def note_needed(s: ControllerMemory, speed_mps: float) -> None:
    """Remember that vibration is needed at this speed, and below it, as stick-slip occurs at low speed."""
    s.needed_to_mps = max(s.needed_to_mps, _AROUND * speed_mps)
    if is_needless(s, s.needed_to_mps):
        s.needless_from_mps = _AROUND * s.needed_to_mps


@kernel
def note_needless(s: ControllerMemory, speed_mps: float) -> None:
    """Remember that vibration is not needed at this speed, and above it."""
    from_mps = speed_mps / _AROUND
    s.needless_from_mps = min(s.needless_from_mps, from_mps) if s.needless_from_mps > 0.0 else from_mps
    s.needed_to_mps = min(s.needed_to_mps, s.needless_from_mps / _AROUND)


@kernel
def note_fall(p: ControllerParams, s: ControllerMemory, force_N: float) -> None:
    """Update crest and fall with the mean force of a bin [N]."""
    along_N = s.direction * force_N
    # at the start of a move the slide swings about its mean, and in a fade the mean friction grows
    begins = s.moved_s < WINDOW_S or (s.mode == wire.PROBE and s.fade > 0.0)
    s.fall_s += p.bin_s
    if begins or s.fall_s > WINDOW_S:
        if s.mode == wire.EXCITE and min(s.mode_s, s.steady_s) > 2.0 * WINDOW_S:
            s.fall_with_N = max((1.0 - WINDOW_S / REMEMBERED_S) * s.fall_with_N, s.fall_N)
        s.crest_before_N = along_N if begins else s.crest_N
        s.fall_s, s.fall_N, s.crest_N = 0.0, 0.0, along_N
    s.crest_N = max(s.crest_N, along_N)
    s.fall_N = max(s.fall_N, max(s.crest_N, s.crest_before_N) - along_N)


@kernel
def shows_need(p: ControllerParams, s: ControllerMemory) -> bool:
    """Whether the slide slips, or the force fell by more than noise, waves of the track and the vibrated slide explain.

    Where slips repeat under vibration, a slip without it shows no need.
    """
    if s.slip_began == 1 and s.moved_s > WINDOW_S and s.failed <= HELPLESS:
        return True
    return s.fall_N > max(_least_fall_N(s), _TIMES * s.fall_with_N, _noise_N(p, s))


@kernel
def _least_fall_N(s: ControllerMemory) -> float:
    return _LEAST * max(s.crest_N, s.crest_before_N)


@kernel
def _noise_N(p: ControllerParams, s: ControllerMemory) -> float:
    """Fall of the force [N] that its noise may show; infinite while it is unknown."""
    return _NOISES * (p.bin_s * s.sigma[FORCE, 0] + s.resolution[FORCE]) if s.differences[0] >= FEWEST else math.inf


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
    if s.failed > HELPLESS:
        return True
    if is_needed(s, speed_mps):
        return s.untried_s > p.trial_every_s
    # below a speed without need, the need ends at some speed
    return s.untried_s > (length_s(s) if is_needless(s, math.inf) else _FIRST_S)


@kernel
def begin_trial(s: ControllerMemory) -> None:
    """Begin a trial: by a fade if the base vibrates."""
    s.fade, s.mode, s.mode_s = s.ratio_now, wire.PROBE, 0.0


@kernel
def follow_trial(p: ControllerParams, s: ControllerMemory, force_N: float, speed_mps: float) -> int:
    """Continue a trial at a force and a |v_d|; return the mode after it."""
    even = s.steady_s > STEADY_S
    if not is_due(p, s, speed_mps) or (s.fade > 0.0 and not (even and is_settled(s, 0.0))):
        return wire.EXCITE
    if s.fade > 0.0:
        # below v_d the mean friction grows no more, but at 0.6 v_d the slide of a light stiff axis begins to swing
        s.fade -= (s.ratio - 1.0) * p.block_s / max(WINDOW_S, _SETTLINGS * settling_s(p, s, force_N, speed_mps))
        s.fade = s.fade if s.fade > 1.0 else 0.0
    elif even:  # a trial may need several moves, and holds for the fastest of them
        s.tried_s += p.block_s
        s.tried_mps = max(s.tried_mps, speed_mps)
    needed, helpless = shows_need(p, s), s.failed > HELPLESS
    if not needed and (s.tried_s < length_s(s) or (calm_s(s) < WINDOW_S and not helpless)):
        return wire.PROBE
    tried_mps = s.tried_mps
    s.untried_s, s.tried_s, s.tried_mps = 0.0, 0.0, 0.0
    s.failed = min(s.failed, AT_END)
    if needed:
        # a slide that slips as its drive brakes needs vibration at the speed before
        note_needed(s, max(speed_mps, tried_mps))
        s.why = wire.STILL_NEEDED
        return wire.EXCITE
    if helpless:
        s.off_left_s = _RETRY_S
    elif s.contact == wire.SMOOTH or _least_fall_N(s) > _noise_N(p, s):
        note_needless(s, tried_mps)
    else:  # neither force nor slide shows an answer
        return wire.EXCITE
    return wire.WATCH
