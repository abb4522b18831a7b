"""Which signals are doubted, and the response.

Accelerometer doubted: the vibration continues open loop, at the known gain. Force or slide position doubted: vibration
whenever the drive moves, as when blind. Drive position doubted: the vibration fades to zero, as v_d is unknown.
A trip lasts until the operator resets it or runs a new loop check of the rig.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.messages import RESET
from bridge.wire.stickslip_pb2 import CHECKING
from controller.in_force import is_judged
from controller.trips.band import begin_known, forget_check
from controller.trips.reset import forget_motion, forget_needs

ACCELEROMETER, CONTACT, DRIVE = 1, 2, 4  # bits of `s.doubted`
OF_FORCE, OF_SLIDE, OF_DRIVE, OF_BASE = range(4)  # channels: indices of `s.same_steps`
CHANNELS = 4


@kernel
def trip(s: ControllerMemory, reason: int, doubts: int) -> None:
    """Doubt signals; the first trip is reported until it ends, unless a later trip ends the vibration.

    Soon after an interruption of the commands no doubt begins; a broken signal is still broken afterwards.
    """
    if not is_judged(s):
        return
    if s.trip == 0 or (doubts == DRIVE and s.doubted & DRIVE == 0):
        s.trip = reason
    s.doubted |= doubts


@kernel
def end_trips(p: ControllerParams, s: ControllerMemory, events: int) -> None:
    """End all trips on the operator's reset or a loop check, which also restarts the known gain."""
    if events & RESET:
        if s.doubted & (CONTACT | DRIVE):
            forget_motion(p, s)
        forget_needs(p, s)
        _forget(s)
        for i in range(p.candidates):  # forget the gain learnt from a doubted accelerometer, without a step of v_a
            if s.known_steps[i] > 0:
                s.log_gain[i] = math.log(s.known_gain[i])
    if s.guard_state == CHECKING:
        if s.doubted & (CONTACT | DRIVE):
            forget_motion(p, s)
        _forget(s)
        s.gain_known[:] = 0
        begin_known(p, s)
        forget_check(s)


@kernel
def _forget(s: ControllerMemory) -> None:
    s.trip, s.doubted = 0, 0
    s.low_steps, s.high_steps = 0, 0
    s.rest_steps, s.broken_steps = 0, 0
    s.same_steps[:] = 0
    s.grown_steps, s.drops, s.jumps, s.jumped_s = 0, 0.0, 0.0, 0.0
    s.apart_s, s.confirmed, s.stiffest_m_per_N = 0.0, 1.0, 0.0
    s.agreed_mps[:] = 0.0
