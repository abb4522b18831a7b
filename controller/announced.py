"""What the rig has announced of the drive's velocity: a ring of the newest in the controller's memory."""

from typing import Final

from bridge.kernel import Record, kernel

# Announcements that are kept. A rig whose velocity changes in every block announces one a block: the ring then looks so many
# blocks ahead, and a rig file is refused that would look further.
MOST_ANNOUNCED: Final = 64


@kernel
def take_announcement(s: Record, holds_from_ns: int, drive_velocity_mps: float) -> None:
    """Remember an announcement in place of the oldest one: from when the drive has which velocity.

    The n-th of all, from 0, is at place n % MOST_ANNOUNCED; `s.announced_count` of them came so far.
    """
    at = s.announced_count % MOST_ANNOUNCED
    s.announced_from_ns[at] = holds_from_ns
    s.announced_mps[at] = drive_velocity_mps
    s.announced_count += 1
