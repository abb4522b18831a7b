"""The reason that a command reports: derived from the state at the end of a step, and read by no decision."""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory
from bridge.wire.stickslip_pb2 import (
    ACTIVE,
    ARMED,
    BLIND,
    CANNOT_HELP,
    DISABLED,
    DRIVE_STANDS,
    EXCITE,
    EXCITER_END,
    GAIN_OTHER,
    JUMPED,
    NO_GUARD,
    NOISE,
    NOT_ARMED,
    NOT_ENABLED,
    NOT_NEEDED,
    NOTHING_TO_DO,
    PROBE,
    RESONANCE,
    STOPPED,
    TRAVEL_END,
    TRIAL,
)
from controller.policy.decide import slips_at_end
from controller.policy.need import is_needless, way_of
from controller.trips.delivered import is_loud

WEAK_S = 0.05  # time of too small a v_a at the exciter's end until it is reported


@kernel
def reason_of(s: ControllerMemory) -> int:
    """The most important of: a trip, a passing condition of a signal, the exciter at its end, the mode."""
    if s.trip > 0:
        return s.trip
    if s.outside == 1:
        return TRAVEL_END
    if is_loud(s):
        return RESONANCE
    if s.jumped_s > 0.0:
        return JUMPED
    if s.gain_other_s > 0.0:
        return GAIN_OTHER
    if s.noise_told_s > 0.0 or s.unbelieved_s > 0.0:
        return NOISE
    if s.mode in (DISABLED, STOPPED):
        armed = s.guard_state in (NO_GUARD, ARMED, ACTIVE)
        return NOT_ENABLED if armed or s.mode == STOPPED else NOT_ARMED
    if s.mode == PROBE:
        return TRIAL
    if s.mode == EXCITE:
        if s.weak_s > WEAK_S or slips_at_end(s):
            return EXCITER_END
        return BLIND if s.blind == 1 else s.why
    if s.moving == 0:
        return BLIND if s.blind == 1 else DRIVE_STANDS
    if s.off_left_s[way_of(s)] > 0.0:
        return CANNOT_HELP
    return NOT_NEEDED if is_needless(s, math.fabs(s.drive_velocity_mps)) else NOTHING_TO_DO
