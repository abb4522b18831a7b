"""Slips that more vibration cannot prevent: after some of them CANNOT_HELP is reported, and the vibration continues.

Fewer slips may be the best result, as on a track whose friction falls by more than any v_a can compensate, or if v_d changes
faster than v_a can follow. `policy` ends the vibration only if it does not help at all.

A first slip or surge under vibration raises the learnt need. A repeated slip or surge shows that the raised need is too small.
"""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory
from bridge.wire.stickslip_pb2 import CANNOT_HELP, HELD

_FEWEST = 2  # fewest slips or surges until CANNOT_HELP is reported: a single one may be chance
_REMEMBERED_S = 30.0  # time after the last failure until their count restarts


@kernel
def note_failure(s: ControllerMemory) -> None:
    """Count a slip that more vibration could not have prevented."""
    s.failed = s.failed + 1 if s.failed_left_s > 0.0 else 1
    s.failed_left_s = _REMEMBERED_S
    if s.failed >= _FEWEST:
        s.reason = CANNOT_HELP


@kernel
def note_lesson(s: ControllerMemory) -> None:
    """Count a slip or surge after which the ratio rises: only a repeated slip or surge counts as a failure."""
    if s.failed_left_s > 0.0:
        note_failure(s)
    else:
        s.failed, s.failed_left_s = 0, _REMEMBERED_S


@kernel
def forget_failures(s: ControllerMemory, block_s: float) -> None:
    """End CANNOT_HELP after a long time without a failure."""
    s.failed_left_s = max(s.failed_left_s - block_s, 0.0)
    if s.reason == CANNOT_HELP and s.failed_left_s == 0.0:
        s.reason = HELD
