"""The 25 checks of a device."""

import time

from bridge.rig.conformance import data, exciter
from bridge.rig.conformance.report import Check, Conformance, judged
from bridge.rig.conformance.session import DeviceSession
from bridge.rig.device import Device
from bridge.rig.file import DeviceRig

_BLOCKS = ("open", "times", "shape")
_SAMPLES = (*_BLOCKS, "missing", "filled", "values")
_TONE = (*_BLOCKS, "channels", "answers")
_VIBRATION = (*_TONE, "amplitude", "frequency")
CHECKS = (
    Check("open", "check the address in [device], and that no other client holds it", data.opened),
    Check(
        "times",
        "return None from `read` after 3 block lengths, and write in a thread if the device is slow",
        data.times,
        ("open",),
    ),
    Check(
        "shape", "return float64 [channels, samples_per_block], as [converter] states", data.shape, ("open", "times")
    ),
    Check("numbers", "count the blocks of the device, and report lost and waiting ones", data.numbers, _BLOCKS),
    Check("rate", "correct converter.sample_rate_Hz, or the clock of the device", data.rate, _BLOCKS),
    Check("missing", "check the plug and the source of the channel; NaN marks a missing sample", data.missing, _BLOCKS),
    Check("filled", "mark missing samples as NaN, never as zeros or as the last sample", data.filled, _BLOCKS),
    Check("repeated", "return each block once, then None until the next one", data.repeated, _BLOCKS),
    Check("values", "check plug, source, scale and range of the channel", data.values, _BLOCKS),
    Check("positions", "correct source, sign or scale of the two positions", data.positions, _SAMPLES),
    Check(
        "force",
        "correct the sign of drive_force_N: positive pulls the slide forward",
        data.force,
        (*_SAMPLES, "positions"),
    ),
    Check(
        "slide-acceleration",
        "correct source, sign or scale of mass_accel_mps2",
        data.slide_acceleration,
        (*_SAMPLES, "positions"),
    ),
    Check("rest", "open the device with its exciter at rest", exciter.rest, _BLOCKS),
    Check("channels", "correct the sources: the base's accelerometer is another channel", exciter.channels, _BLOCKS),
    Check("answers", "pass each order to the exciter; check its cable", exciter.answers, ("open", "times")),
    Check("order", "return the blocks in the order of time, and count lost ones", data.order, (*_TONE, "repeated")),
    Check("frequency", "pass the frequency in hertz", exciter.frequency, _TONE),
    Check(
        "amplitude",
        "correct stroke_m_per_V, the scale of base_accel_mps2, or guard.exciter_gain",
        exciter.amplitude,
        _TONE,
    ),
    Check("reported", "report the vibration that the device executes, not the order", exciter.reported, _VIBRATION),
    Check(
        "answer-time",
        "return the newest block; state `slowest_answer_s` of the adapter if the exciter is slow",
        exciter.answer_time,
        _VIBRATION,
    ),
    Check("zero", "end the vibration for an amplitude of 0", exciter.zero, _VIBRATION),
    Check("enable", "end the vibration while the enable line is off", exciter.enable, _VIBRATION),
    Check("safe", "let `safe` end the vibration, and raise nothing", exciter.safe, _VIBRATION),
    Check(
        "watchdog", "let the device end the vibration by itself, or state watchdog_s = 0", exciter.watchdog, _VIBRATION
    ),
    Check("close", "let `close` end the vibration, and raise nothing", exciter.close, _VIBRATION),
)


def conformance(device: Device, rig: DeviceRig) -> Conformance:
    """Hold a session with a device, which is not open, and judge it."""
    begun_s = time.monotonic()
    session = DeviceSession(device, rig).run()
    results = judged(CHECKS, session)
    return Conformance(rig.name, time.monotonic() - begun_s, results)
