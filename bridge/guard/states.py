"""The states of a rig and their transitions. Nothing arms by itself: not after a freeze, a restart or a new link."""

from bridge.kernel import kernel
from bridge.layouts import GuardMemory
from bridge.wire import stickslip_pb2 as wire

# orders to the guard; numba reads no values of the nested enum
STOP, RESET, ARM, DISARM = wire.Operator.STOP, wire.Operator.RESET, wire.Operator.ARM, wire.Operator.DISARM
ACCEPT_GAIN = wire.Operator.ACCEPT_GAIN
LEAVE = -1  # order at the end of the rig's process
HOLD = -2  # order at its start, while an operator's stop holds


@kernel
def enter(s: GuardMemory, state: int, cause: int) -> None:
    """Go to a state; a change of state resets the counters of the state."""
    if s.state != state:
        s.lost_blocks, s.check_blocks, s.heard = 0, 0, 0
        s.over_blocks[:] = 0
    s.state, s.cause = state, cause


@kernel
def trip(s: GuardMemory, cause: int) -> None:
    """Go to FAULT until the operator resets it; the first cause is kept, except that the operator's stop replaces it."""
    if s.state != wire.FAULT:
        enter(s, wire.FAULT, cause)


@kernel
def apply_order(s: GuardMemory, order: int) -> bool:
    """Apply an order of the operator, or of the process at its start or end. Returns whether it changed the state.

    A stop is valid in every state. ARM begins a check in DISARMED, in READY, and in ARMED without a check. ACCEPT_GAIN does the
    same, but in READY it accepts the measured gain and arms. A rig in FAULT must be reset first.
    """
    before = s.state
    if order == STOP:
        enter(s, wire.FAULT, wire.STOP_BY_PERSON)
        return True
    if order == HOLD:
        enter(s, wire.FAULT, wire.STOP_KEPT)
    elif order == RESET and before == wire.FAULT:
        enter(s, wire.DISARMED, wire.RESET_BY_PERSON)
    elif order in (ARM, ACCEPT_GAIN):
        if before == wire.READY and order == ACCEPT_GAIN:
            s.accepted[:] = s.gain
            enter(s, wire.ARMED, wire.GAIN_ACCEPTED)
        elif before in (wire.DISARMED, wire.READY) or (before == wire.ARMED and s.verified == 0):
            enter(s, wire.CHECKING, wire.ARMED_BY_PERSON)
    elif order in (DISARM, LEAVE) and before not in (wire.DISARMED, wire.FAULT):
        enter(s, wire.DISARMED, wire.DISARMED_BY_PERSON if order == DISARM else wire.RUN_ENDED)
    return before != s.state


@kernel
def note_vibration(s: GuardMemory) -> None:
    """ARMED becomes ACTIVE when the vibration starts, and ARMED again when it ends."""
    if s.state == wire.ARMED and s.amplitude_m > 0.0:
        s.state, s.cause = wire.ACTIVE, wire.VIBRATION_BEGAN
    elif s.state == wire.ACTIVE and s.amplitude_m == 0.0:
        s.state, s.cause = wire.ARMED, wire.VIBRATION_ENDED
