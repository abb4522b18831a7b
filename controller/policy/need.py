"""The learnt need of an axis: at which speeds and in which direction it needs vibration.

Stick-slip occurs at low speed: a vibration that is needed at a speed is needed below it, and a vibration that is not needed at a
speed is not needed above it. So two speeds for each direction store the results; a contradicting result replaces an older one.
"""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory

_AROUND = 1.25  # a result at a speed holds for speeds up to this factor higher (needed) or lower (not needed)


@kernel
def way_of(s: ControllerMemory) -> int:
    """The index of the drive's direction in memory with an entry for each direction."""
    return 0 if s.direction > 0 else 1


@kernel
def _known_way(s: ControllerMemory) -> int:
    """The index of the direction whose results hold: the opposite direction until this direction has a result."""
    way = way_of(s)
    return way if s.needless_from_mps[way] > 0.0 or s.needed_to_mps[way] > 0.0 else 1 - way


@kernel
def is_needed(s: ControllerMemory, speed_mps: float) -> bool:
    """Whether vibration was shown to be needed at this speed."""
    return speed_mps <= s.needed_to_mps[_known_way(s)]


@kernel
def is_needless(s: ControllerMemory, speed_mps: float) -> bool:
    """Whether vibration was shown not to be needed at this speed; at an infinite speed: at any."""
    return 0.0 < s.needless_from_mps[_known_way(s)] <= speed_mps


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
