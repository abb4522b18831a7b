"""Slips in spite of all that the vibration can do: after some of them CANNOT_HELP is said, and it goes on.

Fewer slips may be all that can be had, as on a track whose friction falls by more than any v_a makes up for, or where v_d changes
faster than it can be followed. Only where nothing is gained at all `policy` ends the vibration.

A first slip or surge under vibration teaches how much is needed. One that comes again shows that what was learnt does not do.
"""

from bridge.kernel import Record, kernel
from controller.codes import CANNOT_HELP, HELD

_FEWEST = 2  # slips until it is said: one may be chance
_REMEMBERED_S = 30.0  # since the last of them


@kernel
def note_failure(s: Record) -> None:
    """Count a slip that no more vibration could have prevented."""
    s.failed = s.failed + 1 if s.failed_left_s > 0.0 else 1
    s.failed_left_s = _REMEMBERED_S
    if s.failed >= _FEWEST:
        s.reason = CANNOT_HELP


@kernel
def note_lesson(s: Record) -> None:
    """Count a slip or surge after which more is asked for: the first of them is none that nothing could have prevented."""
    if s.failed_left_s > 0.0:
        note_failure(s)
    else:
        s.failed, s.failed_left_s = 0, _REMEMBERED_S


@kernel
def forget_failures(s: Record, block_s: float) -> None:
    """Take back what was said once nothing came for long."""
    s.failed_left_s = max(s.failed_left_s - block_s, 0.0)
    if s.reason == CANNOT_HELP and s.failed_left_s == 0.0:
        s.reason = HELD
