"""The drive velocity that the rig has announced: a ring of the newest announcements in the controller's memory."""

import math
from typing import Final

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory

# Number of stored announcements. A rig whose velocity changes in every block sends one for each block: the ring then reaches as
# many blocks ahead, and a rig file that would need more is refused.
MOST_ANNOUNCED: Final = 64


@kernel
def take_announcement(s: ControllerMemory, holds_from_ns: int, drive_velocity_mps: float) -> None:
    """Store an announcement in place of the oldest: a velocity of the drive, and the time from which it holds.

    The n-th announcement, from 0, is at index n % MOST_ANNOUNCED; `s.announced_count` have been received.
    """
    at = s.announced_count % MOST_ANNOUNCED
    s.announced_from_ns[at] = holds_from_ns
    s.announced_mps[at] = drive_velocity_mps
    s.announced_count += 1


@kernel
def announced_ahead(s: ControllerMemory, t_ns: int, until_ns: int) -> float:
    """The fastest announced velocity of the drive between two times [m/s], backwards below 0; 0 without an announcement."""
    holding_ns, holding_mps, fastest_mps = -1, 0.0, 0.0
    for i in range(min(s.announced_count, MOST_ANNOUNCED)):
        from_ns, velocity_mps = s.announced_from_ns[i], s.announced_mps[i]
        if from_ns <= t_ns:
            if from_ns > holding_ns:
                holding_ns, holding_mps = from_ns, velocity_mps
        elif from_ns <= until_ns and math.fabs(velocity_mps) > math.fabs(fastest_mps):
            fastest_mps = velocity_mps
    return holding_mps if math.fabs(holding_mps) > math.fabs(fastest_mps) else fastest_mps
