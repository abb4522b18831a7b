"""The end of all trips, on the operator's reset or a loop check of the rig.

After a fault of force or position the memory of both is as at a start: windows, noise, stiffness, forces, needs. Values of
exciter, loop delay and accelerometer stay: they do not depend on the doubted channels.
"""

import math

import numpy as np

from bridge.arrays import Records
from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.messages import RESET
from bridge.wire.stickslip_pb2 import CHECKING
from controller.estimate.compliance import begin_spring
from controller.records import STATE
from controller.trips.doubts import CONTACT, DRIVE


def _words(first: str, last: str) -> tuple[int, int]:
    """The place of neighbouring fields in the memory, in words of 8 bytes."""
    offsets: dict[str, int] = {name: place[1] for name, place in (STATE.fields or {}).items()}
    return offsets[first] // 8, (offsets[last] + STATE[last].itemsize) // 8  # ty: ignore


_MOTION, _POLICY, _TRIPS = _words("bins", "breakaway_N"), _words("mode", "ratio_now"), _words("trip", "most_drive_mps")
_NEEDS = _words("untried_s", "needless_from_mps")  # a part of _POLICY


@kernel
def begin_motion(p: ControllerParams, s: ControllerMemory) -> None:
    """Set the memory of force and positions whose initial value is not zero."""
    begin_spring(p, s)
    s.level, s.slipped_s = -1, math.inf


@kernel
def begin_policy(p: ControllerParams, s: ControllerMemory) -> None:
    """Set the memory of the policy whose initial value is not zero."""
    s.top = -1.0
    s.ratio = p.v_ratio


@kernel
def end_trips(p: ControllerParams, s: ControllerMemory, memory: Records, events: int) -> None:
    """End all trips; `memory` is the array that holds `s`."""
    if events & RESET == 0 and s.guard_state != CHECKING:
        return
    words = memory.view(np.int64)
    if s.doubted & (CONTACT | DRIVE):
        words[_MOTION[0] : _MOTION[1]] = 0
        words[_POLICY[0] : _POLICY[1]] = 0
        begin_motion(p, s)
        begin_policy(p, s)
    elif events & RESET:  # some needs may have been learnt with the exciter off; the vibration continues
        words[_NEEDS[0] : _NEEDS[1]] = 0
        s.ratio = p.v_ratio
    words[_TRIPS[0] : _TRIPS[1]] = 0
    s.gain_off_s, s.repeats[:], s.jumps = 0.0, 0.0, 0.0
