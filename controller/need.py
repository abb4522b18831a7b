"""What the controller remembers of an axis: at which speeds and in which direction it needs vibration, and how much.

Stick-slip lives at low speed: what is needed at a speed is needed below it, and what is not needed at a speed is not needed
above. So one speed each, for each direction, holds the verdicts; a later verdict that contradicts moves the older one away.
"""

from bridge.kernel import Record, kernel

_STEP = 0.02  # of the ratio, as the edge is a cliff 0.02 to 0.04 wide
QUIET = 0.2  # share of v_d by which the slide may be off where a vibration becomes weaker
_EDGE_HELD_S = 30.0  # until an edge is tried again; doubles
_AROUND = 1.25  # factor up and down in speed for which a verdict holds


@kernel
def way_of(s: Record) -> int:
    """The index of the drive's direction in what is learnt for each."""
    return 0 if s.direction > 0 else 1


@kernel
def is_needed(s: Record, speed_mps: float) -> bool:
    """Whether vibration was found to be needed at this speed."""
    return speed_mps <= s.needed_to_mps[way_of(s)]


@kernel
def is_needless(s: Record, speed_mps: float) -> bool:
    """Whether vibration was found not to be needed at this speed."""
    known_mps = s.needless_from_mps[way_of(s)]
    return 0.0 < known_mps <= speed_mps


@kernel
def note_needed(s: Record, speed_mps: float) -> None:
    """Remember that vibration is needed at this speed."""
    way = way_of(s)
    s.needed_to_mps[way] = max(s.needed_to_mps[way], _AROUND * speed_mps)
    if is_needless(s, s.needed_to_mps[way]):
        s.needless_from_mps[way] = _AROUND * s.needed_to_mps[way]


@kernel
def note_needless(s: Record, speed_mps: float) -> None:
    """Remember that vibration is not needed at this speed."""
    way = way_of(s)
    known_mps = s.needless_from_mps[way]
    s.needless_from_mps[way] = speed_mps / _AROUND if known_mps == 0.0 else min(known_mps, speed_mps / _AROUND)
    s.needed_to_mps[way] = min(s.needed_to_mps[way], s.needless_from_mps[way] / _AROUND)


@kernel
def raise_ratio(p: Record, s: Record, by: float) -> None:
    """The present v_a / v_d was too little: ask for more, and remember where the edge is."""
    way = way_of(s)
    s.edge_ratio[way] = max(s.edge_ratio[way], s.ratio[way])
    s.ratio[way] = min(s.ratio[way] + by, p.most_ratio)
    s.edge_held_s[way] = min(max(2.0 * s.edge_held_s[way], _EDGE_HELD_S), p.probe_every_max_s)
    s.calm_s, s.swing = 0.0, 0.0


@kernel
def lower_ratio(p: Record, s: Record, tick_s: float, wait_s: float) -> None:
    """After `wait_s` without stick or slip: a step down, never onto the edge; the edge is forgotten after some time."""
    way = way_of(s)
    s.calm_s += tick_s
    floor = max(p.least_ratio, s.edge_ratio[way] + _STEP) if s.edge_ratio[way] > 0.0 else p.least_ratio
    if s.ratio[way] > floor and s.calm_s > wait_s and s.swing < QUIET:
        s.ratio[way] = max(min(s.ratio[way] - _STEP, 0.5 * (s.ratio[way] + floor)), floor)
        s.calm_s = 0.0
    elif s.ratio[way] <= floor and s.swing < QUIET and s.calm_s > s.edge_held_s[way] and s.edge_ratio[way] > 0.0:
        s.edge_ratio[way] -= _STEP
        s.calm_s = 0.0
