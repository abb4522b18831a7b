"""The probe: whether the vibration is needed at all.

First a wobble of v_a tests whether friction falls with speed (`controller.needs.wobble`). Only if it does not, the vibration is
faded out, no faster than the slide follows. If the spring takes up the friction too quickly for the wobble, the fade is the test:
a slide that sticks, runs ahead or begins to swing during the fade needs the vibration; a slide that follows to the end does not.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import EXCITE, HELD, NOT_NEEDED, PROBE, SMOOTH, STICK, STILL_NEEDED, WATCH
from controller.estimate.windows import BINS
from controller.modes import enter, excite
from controller.needs.need import is_needed, note_needed, note_needless, settling_s, swing_held
from controller.needs.wobble import (
    EVEN,
    FALLS,
    LEAST_ASKED,
    MOST_ASKED,
    UNSURE,
    answer,
    begin_wobble,
    can_ask,
    slide_mps,
)
from controller.needs.wobble import wobble as ask

STEADY_S = 0.2  # duration of constant v_d before and during a probe
_LAST = 1.02  # v_a / v_d at which the last part of a fade begins; below, the mean friction grows little
_CAUGHT_UP = 0.04  # share of v_d by which the slide may lag when the last part of a fade begins
_BEHIND = 0.1  # share of v_d by which the slide may lag when a wobble begins; if more, the spring still winds up
# Share of v_d by which the slide may lag in the last part, while the spring takes up the rest. Larger: surges from a lower v_a.
_LAST_LAG = 0.12
_LAG, _SWING = 0.5, 0.2  # over v_d: allowed lag in the first part of a fade; allowed difference in the last part
# Longest settling time for a probe, which takes about ten settling times; at feeds far below the speed at which friction falls,
# the fall is too small to be detected.
_SLOWEST_S = 5.0
_NEARLY = 0.98  # share of the ratio LEAST_ASKED from which a wobble may begin
# A slide swings increasingly about its mean before it sticks or runs ahead. The swing is v_s of short windows minus v_s of
# windows 2^4 times as long, averaged over two of the long windows.
_LONGER, _MEMORY = 4, 2.0
_GROWN, _FELT = 2.0, 0.1  # rms swing at which a fade ends: over its least value since the fade began, and over v_d
_ASKED_FASTER = 2.0  # speed of a fade after a wobble without a fall of friction, over the speed of a trial fade


@kernel
def begin_probe(p: ControllerParams, s: ControllerMemory, way: int, force_N: float, speed_mps: float) -> None:
    """Begin a wobble if a probe is due and the slide slides evenly; begin the fade if its result allows it."""
    s.unasked_s += p.block_s
    _note_swing(p, s, speed_mps)
    follows = s.contact == SMOOTH and s.slip_began == 0 and s.steady_s > STEADY_S and s.mode == EXCITE
    if s.wobbles == 1:
        if not follows:
            s.wobbles = 0
        elif ask(p, s, speed_mps):
            verdict = answer(s)
            if verdict != UNSURE:
                s.wobbles = 0
            if verdict == FALLS:
                _still_needed(p, s, way, speed_mps)
                s.probe_s[way] = p.probe_every_max_s  # a wobble, unlike a fade, does not fail by chance
                s.reason = STILL_NEEDED
            elif verdict == EVEN:
                _fade(p, s, force_N, _ASKED_FASTER)
        return
    every_s = max(s.probe_s[way], p.probe_every_s) if is_needed(s, speed_mps) else p.first_probe_s
    caught_up = s.fine_mps > (1.0 - _BEHIND) * speed_mps
    if s.unasked_s < every_s or not follows or not caught_up or s.calm_s < 0.1:
        return
    longest_s = settling_s(p, s, force_N, speed_mps)
    if not can_ask(p, longest_s):
        _fade(p, s, force_N, 1.0)
    elif s.ratio[way] < _NEARLY * LEAST_ASKED:
        s.swing = max(s.swing, swing_held(LEAST_ASKED))  # the ratio rises to the least ratio of a wobble
    elif s.ratio[way] < MOST_ASKED and longest_s < _SLOWEST_S:
        begin_wobble(p, s, speed_mps, longest_s)


@kernel
def _fade(p: ControllerParams, s: ControllerMemory, force_N: float, faster: float) -> None:
    s.fade, s.fade_from_N = s.ratio_now, math.fabs(force_N)
    s.fade_per_s = faster * 0.5 / p.probe_fade_s
    # after a wobble the slide may lag; this lag does not count as a swing
    s.swung_least = s.swung if faster == 1.0 else math.inf
    enter(s, PROBE, HELD)


@kernel
def _note_swing(p: ControllerParams, s: ControllerMemory, speed_mps: float) -> None:
    """Update the mean square of the swing of v_s over v_d."""
    longer = s.level + _LONGER
    if s.level < 0 or longer >= p.levels or s.pushed[longer] < BINS:
        return
    off = (slide_mps(p, s, s.level, speed_mps) - slide_mps(p, s, longer, speed_mps)) / speed_mps
    s.swung += min(p.block_s / (_MEMORY * p.window_s[longer]), 1.0) * (off * off - s.swung)


@kernel
def _still_needed(p: ControllerParams, s: ControllerMemory, way: int, speed_mps: float) -> None:
    note_needed(s, speed_mps)
    s.probe_s[way] = min(2.0 * max(s.probe_s[way], p.probe_every_s), p.probe_every_max_s)
    s.unasked_s = 0.0


@kernel
def probe(p: ControllerParams, s: ControllerMemory, way: int, speed_mps: float, block_s: float) -> None:
    """Fade the vibration out while the slide follows; end the probe once its result is known."""
    if s.steady_s < STEADY_S:
        enter(s, EXCITE, HELD)
        return
    # with v_a below v_d the slide may be as slow as v_a, until the spring pulls with all of the friction
    off_mps = _SWING * speed_mps + 3.0 * s.fine_sigma_mps
    slow = s.fade < _LAST and s.fine_mps < min(s.vibration_velocity_mps, speed_mps) - off_mps
    _note_swing(p, s, speed_mps)
    if s.swung_least < math.inf:
        s.swung_least = min(s.swung_least, s.swung)
    grown = s.swung > _GROWN * _GROWN * s.swung_least + _FELT * _FELT
    swings = s.level >= 0 and (slow or grown or s.fine_mps > speed_mps + off_mps)
    if s.contact == STICK or s.slip_began == 1 or swings:
        _still_needed(p, s, way, speed_mps)
        excite(p, s, STILL_NEEDED, p.v_ratio)
        return
    s.fade = _faded(s, speed_mps, block_s)
    if s.fade > 0.0:
        s.mode_s = 0.0
    elif s.mode_s > max(p.probe_hold_s, 2.0 * s.expected_stick_s):
        note_needless(s, speed_mps)
        enter(s, WATCH, NOT_NEEDED)


@kernel
def _faded(s: ControllerMemory, speed_mps: float, block_s: float) -> float:
    """The next v_a / v_d of a vibration that fades.

    Down to 1 the mean friction grows as 1 / <|v_r|>, the mean relative speed between slide and base. So the ratio falls as the
    spring takes up the force while the slide has half of its velocity or more: a slide that needs no vibration follows. Below 1
    the friction of such a slide grows little, but a slide that needs vibration sticks or swings.
    """
    step = s.fade_per_s * block_s
    if s.fade < _LAST:
        return max(s.fade - step, 0.0) if s.fine_mps > (1.0 - _LAST_LAG) * speed_mps else s.fade
    follows = s.sliding_mps / speed_mps - (1.0 - _LAG)
    if follows <= 0.0:
        return s.fade
    if s.fade == _LAST:
        return s.fade if math.fabs(s.fine_mps - speed_mps) > _CAUGHT_UP * speed_mps else _LAST - 1e-9
    above = math.sqrt(s.fade * s.fade - 1.0)
    per_ratio = above / s.fade / (math.asin(1.0 / s.fade) + above)  # relative change of <|v_r|> per change of the ratio
    share = _LAG * s.stiffness_N_per_m * speed_mps / s.fade_from_N * block_s * min(follows / _LAG, 1.0)
    return max(s.fade - min(share / per_ratio, step), _LAST)
