"""The 25 checks of a device."""

import time

from bridge.rig.conformance import data, exciter
from bridge.rig.conformance.both import shared
from bridge.rig.conformance.device_session import DeviceSession
from bridge.rig.conformance.report import Check, Conformance, judged
from bridge.rig.device import Device
from bridge.rig.file import DeviceRig

_REMEDIES = {
    "shape": "return float64 [channels, samples_per_block], as [converter] states",
    "numbers": "read the whole buffer of the driver, then report lost blocks, and as waiting those behind this one",
    "rate": "correct converter.sample_rate_Hz, or the clock of the device",
    "repeated": "return each block once, then None until the next one",
    "amplitude": "correct stroke_m_per_V, the scale of base_accel_mps2, or guard.exciter_gain",
    "answer-time": "return the newest block; state `slowest_answer_s` of the adapter if the exciter is slow",
}
_SHARED = shared(("open", "times"), _REMEDIES)
_VIBRATION = _SHARED[-1].needs  # as `zero`, the end of a vibration
CHECKS = (
    Check("open", "check the address in [device], and that no other client holds it", data.opened),
    Check(
        "times",
        "return None from `read` after 3 block lengths, and write in a thread if the device is slow",
        data.times,
        ("open",),
    ),
    *_SHARED,
    Check("enable", "end the vibration while the enable line is off", exciter.enable, _VIBRATION),
    Check("safe", "let `safe` end the vibration until the next order, and raise nothing", exciter.safe, _VIBRATION),
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
