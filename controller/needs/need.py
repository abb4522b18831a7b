"""What the controller remembers of an axis: at which speeds and in which direction it needs vibration, and how much.

Stick-slip lives at low speed: what is needed at a speed is needed below it, and what is not needed at a speed is not needed
above. So one speed each, for each direction, holds the verdicts; a later contradicting verdict replaces the older one.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams

_STEP = 0.02  # of the ratio, as the edge is a cliff 0.02 to 0.04 wide
_MARGIN = 1.5  # of the friction over that which its swing takes
_PACE = 0.2  # of v_d that the slide may run ahead, or lag, as the ratio changes
_SLOW_S = 5.0  # settling time of feeds so slow that the ratio need not wait for the spring
_FASTEST_S = 0.5  # in which the ratio changes by a factor of e, at least
_EDGE_HELD_S = 30.0  # until an edge is tried again; doubles
_AROUND = 1.25  # factor up and down in speed for which a verdict holds


@kernel
def way_of(s: ControllerMemory) -> int:
    """The index of the drive's direction in what is learnt for each."""
    return 0 if s.direction > 0 else 1


@kernel
def is_needed(s: ControllerMemory, speed_mps: float) -> bool:
    """Whether vibration was found to be needed at this speed."""
    return speed_mps <= s.needed_to_mps[way_of(s)]


@kernel
def is_needless(s: ControllerMemory, speed_mps: float) -> bool:
    """Whether vibration was found not to be needed at this speed."""
    known_mps = needless_from_mps(s)
    return 0.0 < known_mps <= speed_mps


@kernel
def needless_from_mps(s: ControllerMemory) -> float:
    """From which speed on vibration is not needed; a direction of which nothing is known yet is taken to be as the other one."""
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
def raise_ratio(p: ControllerParams, s: ControllerMemory, by: float) -> None:
    """The present v_a / v_d was too little: ask for more, and remember where the edge is."""
    way = way_of(s)
    before = s.ratio[way]
    s.edge_ratio[way] = max(s.edge_ratio[way], before)
    s.ratio[way] = min(before + by, p.most_ratio)
    s.lead += s.ratio[way] / before - 1.0
    s.edge_held_s[way] = min(max(2.0 * s.edge_held_s[way], _EDGE_HELD_S), p.probe_every_max_s)
    s.calm_s = 0.0
    s.swing = swing_held(s.ratio[way])


@kernel
def grows(ratio: float) -> float:
    """By how much the mean friction grows with v_s at a v_a / v_s, each over itself."""
    above = math.sqrt(ratio * ratio - 1.0)
    return above / (0.5 * math.pi - math.atan(above) + above)


@kernel
def margin(ratio: float) -> float:
    """Share by which the mean friction at a v_a / v_s is below that at v_a = v_s, beyond which nothing holds the slide."""
    above = math.sqrt(ratio * ratio - 1.0)
    more = above - math.atan(above)
    return more / (0.5 * math.pi + more)


@kernel
def swing_held(ratio: float) -> float:
    """The swing of friction, over itself, that a ratio is right for."""
    return margin(ratio) / _MARGIN


@kernel
def settling_s(p: ControllerParams, s: ControllerMemory, force_N: float, speed_mps: float) -> float:
    """Time in which the spring takes up a change of the mean friction after a change of v_a.

    Under vibration the mean friction is the friction without it times v_s / <|v_r|>, where <|v_r|> is the mean relative speed
    between slide and base. It grows with v_s, by 0.4 F / v_d at a ratio of 1.2, and the spring with the way, by k_d.
    """
    return (
        grows(max(s.ratio[way_of(s)], p.least_ratio))
        * math.fabs(force_N)
        / (s.stiffness_N_per_m * max(speed_mps, p.least_feed_mps))
        + 1e-9
    )


@kernel
def is_wound_up(s: ControllerMemory, settle_s: float) -> bool:
    """Whether the slide has followed evenly: before, it lags because the spring still takes up the friction.

    A feed so slow that the spring takes seconds does not wait for that.
    """
    return s.even_s > settle_s or settle_s > _SLOW_S


@kernel
def follow_swing(p: ControllerParams, s: ControllerMemory, tick_s: float, settle_s: float) -> None:
    """Bring the ratio to the value that the swing of the slide requires, never onto a known edge.

    The vibration damps the slide up to v_s = v_a. Friction that swings by a share of itself, while the spring's force stays,
    is held where the mean friction is below that at v_a = v_s by more than this share.
    """
    way = way_of(s)
    s.calm_s += tick_s
    before = s.ratio[way]
    floor = p.least_ratio
    if s.edge_ratio[way] > 0.0:
        # the distance from the edge doubles with every failure, as the time does until it is tried again
        floor = max(floor, min(s.edge_ratio[way] + _STEP * s.edge_held_s[way] / _EDGE_HELD_S, p.most_ratio))
    pace = min(_PACE * tick_s / settle_s, tick_s / _FASTEST_S)
    if swing_held(before) < s.swing:
        s.ratio[way] = min(before * (1.0 + pace), p.most_ratio)
    elif is_wound_up(s, settle_s):
        s.ratio[way] = max(min(before, floor), before * (1.0 - pace))
    s.lead += s.ratio[way] / before - 1.0
    if s.calm_s > s.edge_held_s[way] and s.edge_ratio[way] > 0.0 and s.ratio[way] <= floor:
        s.edge_ratio[way] -= _STEP
        s.calm_s = 0.0
