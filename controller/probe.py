"""The probe: fade the vibration out, no faster than the slide follows, to see whether it is needed at all.

A slide that sticks, runs ahead or begins to swing on the way needs it; one that follows down to nothing does not.
"""

import math

from bridge.kernel import Record, kernel
from controller.codes import EXCITE, HELD, NOT_NEEDED, PROBE, SMOOTH, STICK, STILL_NEEDED, WATCH
from controller.modes import enter, excite
from controller.need import is_needed, note_needed, note_needless

STEADY_S = 0.2  # of constant v_d before and during a probe
_LAST = 1.02  # ratio of a fading vibration down to which the mean friction grows
_CAUGHT_UP = 0.04  # share of v_d by which the slide may lag when the last part of a fade begins
_LAG, _SWING = 0.5, 0.2  # shares of v_d by which the slide may lag in the first part of a fade, and be off in the last
# Friction without vibration over that at a ratio of 1.2, less 1: 0.40 with C45 and with PTFE on the paper's rig.
_FIRST_RATIO, _TAKEN_OFF = 1.2, 0.4
_LONGEST_RELOAD_S = 0.33


@kernel
def begin_probe(p: Record, s: Record, way: int, force_N: float, speed_mps: float) -> None:
    """Begin a probe where one is due and the slide slides evenly.

    The spring has to take up what the vibration took off the friction. Where that takes long the slide is stuck for long, and a
    slide that is stuck beyond its sliding friction can only slip; so no probe is made there.
    """
    every_s = max(s.probe_s[way], p.probe_every_s) if is_needed(s, speed_mps) else p.first_probe_s
    at_first_N = math.fabs(force_N) * math.asin(1.0 / _FIRST_RATIO) / math.asin(1.0 / s.ratio[way])
    reload_s = _TAKEN_OFF * at_first_N / (s.stiffness_N_per_m * max(speed_mps, p.least_feed_mps))
    ready = s.contact == SMOOTH and s.calm_s > 0.1 and s.steady_s > STEADY_S
    if s.mode_s > every_s and ready and reload_s < _LONGEST_RELOAD_S:
        s.fade = s.ratio[way]
        s.fade_from_N, s.fade_from_rad = math.fabs(force_N), math.asin(1.0 / s.fade)
        enter(s, PROBE, HELD)


@kernel
def probe(p: Record, s: Record, way: int, speed_mps: float, block_s: float) -> None:
    """Fade out while the slide follows."""
    if s.steady_s < STEADY_S:
        enter(s, EXCITE, HELD)
        return
    off = math.fabs(s.fine_mps - speed_mps) > _SWING * speed_mps + 3.0 * s.fine_sigma_mps
    swings = s.level >= 0 and off and (s.fade < _LAST or s.fine_mps > speed_mps)
    if s.contact == STICK or s.slip_began == 1 or swings:
        note_needed(s, speed_mps)
        s.probe_s[way] = min(2.0 * max(s.probe_s[way], p.probe_every_s), p.probe_every_max_s)
        excite(p, s, STILL_NEEDED, p.v_ratio)
        return
    s.fade = _faded(p, s, speed_mps, block_s)
    if s.fade > 0.0:
        s.mode_s = 0.0
    elif s.mode_s > max(p.probe_hold_s, 2.0 * s.expected_stick_s):
        note_needless(s, speed_mps)
        enter(s, WATCH, NOT_NEEDED)


@kernel
def _faded(p: Record, s: Record, speed_mps: float, block_s: float) -> float:
    """The next ratio to v_d of a vibration that fades.

    Down to 1 the mean friction grows as asin(1 / ratio), so the ratio falls as 1 / sin of an angle that grows evenly, at a rate
    at which the drive's spring takes up the friction with the slide at half of its velocity or more: a slide that needs no
    vibration follows. Below 1 the friction of such a slide hardly grows any more, but one that needs vibration sticks, or swings.
    """
    if s.fade >= _LAST:
        follows = s.sliding_mps / speed_mps - (1.0 - _LAG)
        if follows <= 0.0:
            return s.fade
        if s.fade == _LAST:
            return s.fade if math.fabs(s.fine_mps - speed_mps) > _CAUGHT_UP * speed_mps else _LAST - 1e-9
        angle = math.asin(1.0 / s.fade)
        friction_N = s.fade_from_N * 0.5 * math.pi / s.fade_from_rad
        climb_s = friction_N / (_LAG * s.stiffness_N_per_m * speed_mps)
        angle += 0.5 * math.pi * block_s / max(climb_s, p.probe_fade_s) * min(follows / _LAG, 1.0)
        return max(1.0 / math.sin(angle), _LAST) if angle < 0.5 * math.pi else _LAST
    return max(s.fade - 0.5 * block_s / p.probe_fade_s, 0.0)
