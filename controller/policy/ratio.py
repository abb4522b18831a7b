"""The ratio v_a / v_d: it holds the swing of friction that the swing of the slide shows, and slips raise it.

The vibration damps the slide up to v_s = v_a. A relative swing of friction at a constant force of the spring is held if the mean
friction is below its value at v_a = v_s by more than this swing.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from controller.estimate.compliance import elongation_m, slide_mps
from controller.estimate.windows import BINS

_MARGIN = 1.5  # safety factor on the swing of friction
# Largest v_a / v_d over `v_ratio` that a swing of the slide may reach before the first slip or surge. Larger: interruptions that
# the rig does not report raise v_a further. Smaller: an axis whose friction swings has a surge first.
_UNPROVEN = 1.4
_PACE = 0.2  # share of v_d by which the slide may run ahead or lag while the ratio changes
# Longest settling time of the spring that counts; then the ratio falls without waiting. Longer: slow feeds hold it for minutes.
_LONGEST_S = 5.0
_OF_SWING = 0.02  # largest noise of v_s, over v_d, of the windows that show its swing
_EVEN = 0.1  # largest deviation of v_s from v_d, over v_d, of a slide that follows
# Memory of a swing of friction: two periods of the slowest swing that the spring does not level out; at least the time in which
# the ratio may change by a factor of e, and before the first slip 10 s at most, for energy.
_PERIODS, _SHORTEST_S, _MEMORY_S = 4.0 * math.pi, 0.5, 10.0


@kernel
def grows(ratio: float) -> float:
    """Relative growth of the mean friction over relative growth of v_s, at a ratio v_a / v_s."""
    above = math.sqrt(ratio * ratio - 1.0)
    return above / (0.5 * math.pi - math.atan(above) + above)


@kernel
def swing_held(ratio: float) -> float:
    """The largest relative swing of friction for which a ratio v_a / v_s is sufficient.

    The mean friction is below its largest value, at v_a = v_s, by a share more / (pi / 2 + more).
    """
    above = math.sqrt(ratio * ratio - 1.0)
    more = above - math.atan(above)
    return more / (0.5 * math.pi + more) / _MARGIN


@kernel
def set_ratio(p: ControllerParams, s: ControllerMemory, ratio: float) -> None:
    """Set v_a / v_d within its limits; before the first slip or surge the upper limit is lower."""
    most = p.most_ratio if s.memory_s > 0.0 else min(_UNPROVEN * p.v_ratio, p.most_ratio)
    s.ratio = min(max(ratio, p.least_ratio), most)


@kernel
def raise_ratio(p: ControllerParams, s: ControllerMemory, by: float) -> None:
    """Raise v_a / v_d after a slip or surge: its swing of friction is the swing that the new ratio holds.

    Each time, this swing is remembered twice as long.
    """
    s.memory_s = min(max(2.0 * s.memory_s, _MEMORY_S), p.trial_every_s)
    set_ratio(p, s, s.ratio + by)
    s.swing = swing_held(s.ratio)


@kernel
def settling_s(p: ControllerParams, s: ControllerMemory, force_N: float, speed_mps: float) -> float:
    """Time in which the spring takes up a change of the mean friction after a change of v_a.

    Under vibration the mean friction is the friction without vibration times v_s / <|v_r|>, where <|v_r|> is the mean relative
    speed between slide and base. It grows with v_s, by 0.4 F / v_d at a ratio of 1.2; the spring's force grows by k_d.
    """
    stretch_s = elongation_m(p, s, force_N) / max(speed_mps, p.least_feed_mps)
    return min(grows(s.ratio) * stretch_s + 1e-9, _LONGEST_S)


@kernel
def _is_wound_up(s: ControllerMemory, settle_s: float) -> bool:
    return s.even_s > settle_s or settle_s == _LONGEST_S


@kernel
def follow_swing(p: ControllerParams, s: ControllerMemory, settle_s: float) -> None:
    """Move the ratio towards the value that the swing of friction requires, no faster than the spring follows.

    It falls only after the slide has followed evenly: before, it lags because the spring still takes up the friction.
    """
    pace = p.block_s * min(_PACE / settle_s, 1.0 / _SHORTEST_S)
    if swing_held(s.ratio) < s.swing:
        set_ratio(p, s, s.ratio * (1.0 + pace))
    elif _is_wound_up(s, settle_s):
        set_ratio(p, s, s.ratio * (1.0 - pace))


@kernel
def note_swing(p: ControllerParams, s: ControllerMemory, speed_mps: float, settle_s: float) -> None:
    """Update the swing of friction from the swing of v_s, in the shortest windows that show it."""
    level = s.level
    while level < p.levels and s.pushed[level] >= BINS:
        sliding_mps, sigma_mps = slide_mps(p, s, level, speed_mps)
        if sigma_mps <= _OF_SWING * speed_mps:
            break
        level += 1
    else:
        return
    share = min(p.block_s / max(min(max(_PERIODS * settle_s, _SHORTEST_S), _MEMORY_S), s.memory_s), 1.0)
    off, noise = sliding_mps / speed_mps - 1.0, 3.0 * sigma_mps / speed_mps
    if _is_wound_up(s, settle_s):
        s.swing *= 1.0 - share
    if math.fabs(off) < _EVEN + noise:
        s.even_s += p.block_s
    s.top = max(s.top * (1.0 - share) if s.top > 0.0 else s.top, off)
    beyond, middle = max(off, 0.5 * (s.top - off)) - noise, 1.0 + 0.5 * (s.top + off)
    if beyond > 0.0:
        s.swing = max(s.swing, beyond / middle * grows(max(s.ratio_now / middle, p.least_ratio)))
