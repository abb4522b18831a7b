"""States and causes of the guard as plain numbers for kernels, and the operator's orders to the guard."""

from bridge.wire import stickslip_pb2 as wire

DISARMED, CHECKING, READY, ARMED, ACTIVE, FAULT = (
    int(state) for state in (wire.DISARMED, wire.CHECKING, wire.READY, wire.ARMED, wire.ACTIVE, wire.FAULT)
)
NO_CAUSE, POWER_UP, ARMED_BY_SCENARIO, ARMED_BY_PERSON, DISARMED_BY_PERSON, RESET_BY_PERSON = (
    int(cause)
    for cause in (
        *(wire.NO_CAUSE, wire.POWER_UP, wire.ARMED_BY_SCENARIO, wire.ARMED_BY_PERSON),
        *(wire.DISARMED_BY_PERSON, wire.RESET_BY_PERSON),
    )
)
CHECK_PASSED, VIBRATION_BEGAN, VIBRATION_ENDED, RUN_ENDED, STOP_BY_PERSON, STOP_KEPT, COMMAND_LOST = (
    int(cause)
    for cause in (
        *(wire.CHECK_PASSED, wire.VIBRATION_BEGAN, wire.VIBRATION_ENDED, wire.RUN_ENDED),
        *(wire.STOP_BY_PERSON, wire.STOP_KEPT, wire.COMMAND_LOST),
    )
)
OVERTRAVEL, DRIVE_MAX, DRIVE_RATIO, LOUD, BAND, HEAT, DUTY, SLEW_RATE = (
    int(cause)
    for cause in (
        *(wire.OVERTRAVEL, wire.DRIVE_MAX, wire.DRIVE_RATIO, wire.LOUD),
        *(wire.BAND, wire.HEAT, wire.DUTY, wire.SLEW_RATE),
    )
)
FIRST_CHECK, GAIN_CHANGED, GAIN_ACCEPTED = (
    int(cause) for cause in (wire.FIRST_CHECK, wire.GAIN_CHANGED, wire.GAIN_ACCEPTED)
)
SENSOR_FROZEN, SENSOR_NOT_FINITE, EXCITER_SILENT, EXCITER_WILD = (
    int(cause) for cause in (wire.SENSOR_FROZEN, wire.SENSOR_NOT_FINITE, wire.EXCITER_SILENT, wire.EXCITER_WILD)
)
LIMITS = OVERTRAVEL, DRIVE_MAX, DRIVE_RATIO, LOUD, BAND, HEAT, DUTY  # limits with a level and a hold time

STOP, RESET, ARM, DISARM, ACCEPT_GAIN = (
    int(word)
    for word in (
        *(wire.Operator.STOP, wire.Operator.RESET, wire.Operator.ARM, wire.Operator.DISARM),
        wire.Operator.ACCEPT_GAIN,
    )
)
LEAVE = -1  # the rig's process ends
