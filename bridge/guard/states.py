"""The states of a rig and their transitions. Nothing arms by itself: not after a freeze, a restart or a new link."""

from bridge.kernel import kernel
from bridge.layouts import GuardMemory
from bridge.wire.stickslip_pb2 import (
    ACTIVE,
    ARMED,
    ARMED_BY_PERSON,
    CHECKING,
    DISARMED,
    DISARMED_BY_PERSON,
    FAULT,
    GAIN_ACCEPTED,
    GAIN_CHANGED,
    READY,
    RESET_BY_PERSON,
    RUN_ENDED,
    STOP_BY_PERSON,
    VIBRATION_BEGAN,
    VIBRATION_ENDED,
    Operator,
)

# orders to the guard; numba reads no values of the nested enum
STOP, RESET, ARM, DISARM = Operator.STOP, Operator.RESET, Operator.ARM, Operator.DISARM
ACCEPT_GAIN = Operator.ACCEPT_GAIN
LEAVE = -1  # the rig's process ends


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
    if s.state != FAULT:
        enter(s, FAULT, cause)


@kernel
def apply_order(s: GuardMemory, order: int) -> bool:
    """Apply an order of the operator or of the ending process. Returns whether it changed the state.

    A stop is valid in every state. ARM begins a check in DISARMED, in ARMED without a check, and in READY after a change of the
    gain; otherwise it arms in READY. ACCEPT_GAIN does the same, but arms after a change of the gain. A rig in FAULT must be
    reset first.
    """
    before = s.state
    if order == STOP:
        enter(s, FAULT, STOP_BY_PERSON)
        return True
    if order == RESET and before == FAULT:
        enter(s, DISARMED, RESET_BY_PERSON)
    elif order in (ARM, ACCEPT_GAIN):
        changed = before == READY and s.cause == GAIN_CHANGED
        if changed and order == ACCEPT_GAIN:
            s.accepted[:] = s.gain
            enter(s, ARMED, GAIN_ACCEPTED)
        elif changed or before == DISARMED or (before == ARMED and s.verified == 0):
            enter(s, CHECKING, ARMED_BY_PERSON)
        elif before == READY:
            enter(s, ARMED, ARMED_BY_PERSON)
    elif order in (DISARM, LEAVE) and before not in (DISARMED, FAULT):
        enter(s, DISARMED, DISARMED_BY_PERSON if order == DISARM else RUN_ENDED)
    return before != s.state


@kernel
def note_vibration(s: GuardMemory) -> None:
    """ARMED becomes ACTIVE when the vibration starts, and ARMED again when it ends."""
    if s.state == ARMED and s.amplitude_m > 0.0:
        s.state, s.cause = ACTIVE, VIBRATION_BEGAN
    elif s.state == ACTIVE and s.amplitude_m == 0.0:
        s.state, s.cause = ARMED, VIBRATION_ENDED
