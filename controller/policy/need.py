"""The learnt need of an axis: at which speeds and in which direction it needs vibration, and how much.

Stick-slip occurs at low speed: a vibration that is needed at a speed is needed below it, and a vibration that is not needed at a
speed is not needed above it. So two speeds for each direction store the verdicts; a contradicting verdict replaces an older one.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from controller.estimate.compliance import elongation_m

_STEP = 0.02  # step of v_a / v_d at an edge, below which the slide slips: the transition is 0.02 to 0.04 wide
_MARGIN = 1.5  # safety factor on the swing of friction
# Largest v_a / v_d over `v_ratio` that a swing of the slide may reach without a slip or surge. Larger: interruptions that the rig
# does not report raise v_a further. Smaller: an axis whose friction swings has a surge first.
_UNPROVEN = 1.4
_PACE = 0.2  # share of v_d by which the slide may run ahead or lag while the ratio changes
_LONGEST_S = 60.0  # longest settling time, and the settling time of an axis of unknown stiffness
_SLOW_S = 5.0  # settling time of the spring above which the ratio changes without waiting for it
_FASTEST_S = 0.5  # shortest time in which the ratio changes by a factor of e
_EDGE_HELD_S = 30.0  # time until ratios below an edge are tried again; doubles with each failure
STEADY_S = 0.2  # duration of constant v_d from which the slide follows it
_AROUND = 1.25  # a verdict at a speed holds for speeds up to this factor higher (needed) or lower (not needed)


@kernel
def way_of(s: ControllerMemory) -> int:
    """The index of the drive's direction in memory with an entry for each direction."""
    return 0 if s.direction > 0 else 1


@kernel
def is_needed(s: ControllerMemory, speed_mps: float) -> bool:
    """Whether vibration was found to be needed at this speed; an unknown direction has the need of the opposite direction."""
    way = way_of(s)
    unknown = s.needless_from_mps[way] == 0.0 and s.needed_to_mps[way] == 0.0
    return speed_mps <= s.needed_to_mps[1 - way if unknown else way]


@kernel
def is_needless(s: ControllerMemory, speed_mps: float) -> bool:
    """Whether vibration was found not to be needed at this speed."""
    known_mps = needless_from_mps(s)
    return 0.0 < known_mps <= speed_mps


@kernel
def needless_from_mps(s: ControllerMemory) -> float:
    """Speed from which vibration is not needed; an unknown direction has the speed of the opposite direction."""
    way = way_of(s)
    unknown = s.needless_from_mps[way] == 0.0 and s.needed_to_mps[way] == 0.0
    return s.needless_from_mps[1 - way] if unknown else s.needless_from_mps[way]


@kernel
def note_needed(s: ControllerMemory, speed_mps: float) -> None:
    """Remember that vibration is needed at this speed."""
    way = way_of(s)
    s.needed_to_mps[way] = max(s.needed_to_mps[way], _AROUND * speed_mps)
    if is_needless(s, s.needed_to_mps[way]):
        s.needless_from_mps[way] = _AROUND * s.needed_to_mps[way]


@kernel
def note_needless(s: ControllerMemory, speed_mps: float) -> None:
    """Remember that vibration is not needed at this speed."""
    way = way_of(s)
    known_mps = s.needless_from_mps[way]
    s.needless_from_mps[way] = speed_mps / _AROUND if known_mps == 0.0 else min(known_mps, speed_mps / _AROUND)
    s.needed_to_mps[way] = min(s.needed_to_mps[way], s.needless_from_mps[way] / _AROUND)


@kernel
def largest_ratio(p: ControllerParams, s: ControllerMemory, way: int) -> float:
    """The largest v_a / v_d to which the ratio may rise; a larger present ratio stays."""
    return p.most_ratio if s.proven[way] == 1 else max(s.ratio[way], min(_UNPROVEN * p.v_ratio, p.most_ratio))


@kernel
def raise_ratio(p: ControllerParams, s: ControllerMemory, by: float) -> None:
    """Raise v_a / v_d, and store the present ratio, which was too small, as the edge."""
    way = way_of(s)
    before = s.ratio[way]
    s.edge_ratio[way] = max(s.edge_ratio[way], before)
    s.ratio[way] = min(before + by, largest_ratio(p, s, way))
    s.lead += s.ratio[way] / before - 1.0
    s.edge_held_s[way] = min(max(2.0 * s.edge_held_s[way], _EDGE_HELD_S), p.trial_every_s)
    s.calm_s = 0.0
    s.swing = swing_held(s.ratio[way])


@kernel
def grows(ratio: float) -> float:
    """Relative growth of the mean friction over relative growth of v_s, at a ratio v_a / v_s."""
    above = math.sqrt(ratio * ratio - 1.0)
    return above / (0.5 * math.pi - math.atan(above) + above)


@kernel
def margin(ratio: float) -> float:
    """Share by which the mean friction at a ratio v_a / v_s is below its largest value, at v_a = v_s."""
    above = math.sqrt(ratio * ratio - 1.0)
    more = above - math.atan(above)
    return more / (0.5 * math.pi + more)


@kernel
def swing_held(ratio: float) -> float:
    """The largest relative swing of friction for which a ratio is sufficient."""
    return margin(ratio) / _MARGIN


@kernel
def settling_s(p: ControllerParams, s: ControllerMemory, force_N: float, speed_mps: float) -> float:
    """Time in which the spring takes up a change of the mean friction after a change of v_a.

    Under vibration the mean friction is the friction without vibration times v_s / <|v_r|>, where <|v_r|> is the mean relative
    speed between slide and base. It grows with v_s, by 0.4 F / v_d at a ratio of 1.2; the spring's force grows by k_d.
    """
    return (
        grows(max(s.ratio[way_of(s)], p.least_ratio))
        * min(elongation_m(p, s, force_N) / max(speed_mps, p.least_feed_mps), _LONGEST_S)
        + 1e-9
    )


@kernel
def is_wound_up(s: ControllerMemory, settle_s: float) -> bool:
    """Whether the slide has followed evenly: before, it lags because the spring still takes up the friction.

    A feed so slow that the spring takes seconds does not wait.
    """
    return s.even_s > settle_s or settle_s > _SLOW_S


@kernel
def follow_swing(p: ControllerParams, s: ControllerMemory, tick_s: float, settle_s: float) -> None:
    """Move the ratio towards the value that the swing of the slide requires, never onto a known edge.

    The vibration damps the slide up to v_s = v_a. A relative swing of friction at a constant force of the spring is held if the
    mean friction is below its value at v_a = v_s by more than this swing.
    """
    way = way_of(s)
    s.calm_s += tick_s
    before = s.ratio[way]
    floor = p.least_ratio
    if s.edge_ratio[way] > 0.0:
        # each failure doubles the distance from the edge, and the time until ratios below it are tried again
        floor = max(floor, min(s.edge_ratio[way] + _STEP * s.edge_held_s[way] / _EDGE_HELD_S, p.most_ratio))
    pace = min(_PACE * tick_s / settle_s, tick_s / _FASTEST_S)
    if swing_held(before) < s.swing:
        s.ratio[way] = min(before * (1.0 + pace), largest_ratio(p, s, way))
    elif is_wound_up(s, settle_s):
        s.ratio[way] = max(min(before, floor), before * (1.0 - pace))
        s.proven[way] = s.proven[way] if s.ratio[way] == before else 0
    s.lead += s.ratio[way] / before - 1.0
    if s.calm_s > s.edge_held_s[way] and s.edge_ratio[way] > 0.0 and s.ratio[way] <= floor:
        s.edge_ratio[way] -= _STEP
        s.calm_s = 0.0
