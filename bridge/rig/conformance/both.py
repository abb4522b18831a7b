"""The 19 checks that a device and a rig on the bus share; each adds others, and remedies in its words."""

from collections.abc import Mapping

from bridge.rig.conformance import data, exciter
from bridge.rig.conformance.report import Check


def shared(begin: tuple[str, ...], remedies: Mapping[str, str]) -> tuple[Check, ...]:
    """The checks of blocks, channels and tones.

    Args:
        begin: checks that every check here needs.
        remedies: of `shape`, `numbers`, `rate`, `repeated`, `amplitude` and `answer-time`.

    """
    blocks = (*begin, "shape")
    readable = (*blocks, "values")
    samples = (*readable, "missing", "filled")
    moves = (*samples, "positions")
    tone = (*blocks, "channels", "answers")
    vibration = (*tone, "amplitude", "frequency")
    return (
        Check("shape", remedies["shape"], data.shape, begin),
        Check("numbers", remedies["numbers"], data.numbers, blocks),
        Check("rate", remedies["rate"], data.rate, blocks),
        Check(
            "values", "check plug, source, unit and range of the channel, or state it as absent", data.values, blocks
        ),
        Check("missing", "check plug and source of the channel; NaN marks a missing sample", data.missing, readable),
        Check("filled", "mark missing samples as NaN, never as zeros or as the last sample", data.filled, readable),
        Check("repeated", remedies["repeated"], data.repeated, blocks),
        Check("positions", "correct plug, source, sign or unit of the two positions", data.positions, samples),
        Check("force", "correct the sign of drive_force_N: positive pulls the slide forward", data.force, moves),
        Check("slide-acceleration", "correct plug, sign or unit of mass_accel_mps2", data.slide_acceleration, moves),
        Check("rest", "begin with the exciter at rest", exciter.rest, blocks),
        Check("channels", "correct the sources: the base's accelerometer is another channel", exciter.channels, blocks),
        # without `shape`: a device that refuses every order ends the session before its first block
        Check("answers", "pass each order to the exciter; check its cable", exciter.answers, begin),
        Check("order", "pass the blocks on in the order of time, and count lost ones", data.order, (*tone, "repeated")),
        Check("frequency", "take the frequency in hertz", exciter.frequency, tone),
        Check("amplitude", remedies["amplitude"], exciter.amplitude, tone),
        Check("reported", "report the vibration that the exciter executes, not the order", exciter.reported, vibration),
        Check("answer-time", remedies["answer-time"], exciter.answer_time, vibration),
        Check("zero", "end the vibration for an amplitude of 0", exciter.zero, vibration),
    )
