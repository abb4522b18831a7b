"""The codes of modes, states, reasons and limits, and the event bits of a frame, as plain numbers for kernels."""

from bridge.wire import stickslip_pb2 as wire

DISABLED, WATCH, EXCITE, PROBE, STOPPED = (
    int(mode) for mode in (wire.DISABLED, wire.WATCH, wire.EXCITE, wire.PROBE, wire.STOPPED)
)
UNKNOWN, STANDSTILL, STICK, SLIP, SMOOTH = (
    int(state) for state in (wire.UNKNOWN, wire.STANDSTILL, wire.STICK, wire.SLIP, wire.SMOOTH)
)
NO_LIMIT, RANGE, SLEW, FREQUENCY_BAND, STALE_INPUT, OPERATOR_STOP, NOT_FINITE = (
    int(limit)
    for limit in (
        *(wire.NO_LIMIT, wire.RANGE, wire.SLEW, wire.FREQUENCY_BAND),
        *(wire.STALE_INPUT, wire.OPERATOR_STOP, wire.NOT_FINITE),
    )
)
NOT_ENABLED, NOTHING_TO_DO, STICK_SEEN, HELD = (
    int(reason) for reason in (wire.NOT_ENABLED, wire.NOTHING_TO_DO, wire.STICK_SEEN, wire.HELD)
)
STILL_NEEDED, NOT_NEEDED, DRIVE_STANDS, PIEZO_WEAK = (
    int(reason) for reason in (wire.STILL_NEEDED, wire.NOT_NEEDED, wire.DRIVE_STANDS, wire.PIEZO_WEAK)
)
BLIND, CANNOT_HELP, HARMFUL, MOVING, START_OF_MOVE, SETTLING, NEEDED_BEFORE = (
    int(reason)
    for reason in (
        *(wire.BLIND, wire.CANNOT_HELP, wire.HARMFUL, wire.MOVING),
        *(wire.START_OF_MOVE, wire.SETTLING, wire.NEEDED_BEFORE),
    )
)
NOT_ARMED = int(wire.NOT_ARMED)
OPEN_LOOP, CLIPPED, SWAPPED, FROZEN, RESONANCE, FORCE_DOUBTED, DRIVE_DOUBTED, TRAVEL_END, NOISE = (
    int(reason)
    for reason in (
        *(wire.OPEN_LOOP, wire.CLIPPED, wire.SWAPPED, wire.FROZEN, wire.RESONANCE),
        *(wire.FORCE_DOUBTED, wire.DRIVE_DOUBTED, wire.TRAVEL_END, wire.NOISE),
    )
)
SLIDE_DOUBTED, POSITIONS_APART, JUMPED, LOOSE, GAIN_OTHER = (
    int(reason) for reason in (wire.SLIDE_DOUBTED, wire.POSITIONS_APART, wire.JUMPED, wire.LOOSE, wire.GAIN_OTHER)
)
GAIN_LIMIT, HELD_OPEN_LOOP, NO_DRIVE = (int(limit) for limit in (wire.GAIN_LIMIT, wire.HELD_OPEN_LOOP, wire.NO_DRIVE))
NO_GUARD, CHECKING, ARMED, ACTIVE = (int(state) for state in (wire.NO_GUARD, wire.CHECKING, wire.ARMED, wire.ACTIVE))

# bits of a frame's events, as Trace.events
BLOCK = 1
GAP = 2
STALE = 4
STOP = 8
RESET = 16
ANNOUNCED = 32
LATE = 64
