"""The codes of a verdict's own findings, each with its cause and remedy, as `stickslip explain` prints them."""

from bridge.wire.event_codes import EventCode
from bridge.wire.words import FAILURE, OUTSIDE

_ROWS = (
    ("SENSOR_ABSENT", FAILURE, "samples of a channel are NaN or infinite. Connect the sensor, or repair its data acquisition"),
    ("SENSOR_DEAD", FAILURE, "a channel does not change, or shows noise alone where the slide must shake. Check plug and supply"),
    ("SENSOR_CLIPPED", FAILURE, "a channel ends at its range: the signal went beyond. Use a larger range, or correct the unit"),
    ("SENSOR_FROZEN", FAILURE, "a channel repeats one block: a stopped converter. Restart the data acquisition"),
    ("SENSOR_NOISE", FAILURE, "the drive force is so noisy that a slip does not show. Check cables and grounding"),
    ("SENSOR_SCALE", FAILURE, "the force does not follow the stiffness times the elongation: check sign, scale and cable of the "
     "force and of both positions, and the stiffness"),
    ("SENSOR_SWAPPED", FAILURE, "the slide vibrates more than the base: are the accelerometers swapped, or is the "
     "base's not connected?"),
    ("SENSOR_OTHER", FAILURE, "v_a of the log differs from v_a of the controller: check whether both received the same signal"),
    ("SLIPS_DISAGREE", FAILURE, "positions and controller show slips, the force shows none: check the force sensor"),
    ("OVER_EXCITED", OUTSIDE, "v_a is far above its set point: check the exciter's gain and the base accelerometer"),
    ("CONTROLLER_LOST", FAILURE, "the rig went on after the controller's last step. Look for the reason at the controller's end"),
    ("UNANSWERED", OUTSIDE, "blocks have no command that answers them: check the controller, the link and the recorder"),
)  # fmt: skip
FINDINGS = {code: EventCode(code, "verdict", letter, meaning) for code, letter, meaning in _ROWS}
