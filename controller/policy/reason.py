"""The reason that a command reports: derived from the state at the end of a step, and read by no decision."""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory
from bridge.wire import stickslip_pb2 as wire
from controller.estimate.channels import has_jumped, is_noisy
from controller.exciter import HOLD_S
from controller.policy.trial import AT_END, is_needless

WEAK_S = 0.05  # time of too small a v_a at the exciter's end until it is reported


@kernel
def reason_of(s: ControllerMemory) -> int:
    """The most important of: a trip, a passing condition of a signal, the exciter at its end, the mode."""
    if s.trip > 0:
        return s.trip
    if s.outside == 1:
        return wire.TRAVEL_END
    if s.resonates == 1:
        return wire.RESONANCE
    if is_noisy(s):
        return wire.NOISE
    if has_jumped(s):
        return wire.JUMPED
    if s.mode in (wire.DISABLED, wire.STOPPED):
        armed = s.guard_state in (wire.NO_GUARD, wire.ARMED, wire.ACTIVE)
        return wire.NOT_ENABLED if armed or s.mode == wire.STOPPED else wire.NOT_ARMED
    if s.mode == wire.PROBE:
        return wire.TRIAL
    if s.mode == wire.EXCITE and (s.weak_s > WEAK_S or s.failed > AT_END):
        return wire.EXCITER_END
    if s.low_s > HOLD_S:
        return wire.GAIN_OTHER
    if s.drive_unseen == 1:
        return wire.DRIVE_UNSEEN
    if s.blind == 1 and (s.mode == wire.EXCITE or s.moving == 0):
        return wire.BLIND
    if s.mode == wire.EXCITE:
        return s.why
    if s.moving == 0:
        return wire.DRIVE_STANDS
    if s.off_left_s > 0.0:
        return wire.CANNOT_HELP
    return wire.NOT_NEEDED if is_needless(s, math.fabs(s.drive_velocity_mps)) else wire.NOTHING_TO_DO
