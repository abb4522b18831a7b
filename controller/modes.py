"""Changes of the mode, and of the vibration's frequency."""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import EXCITE, WATCH
from controller.frequency import cheapest
from controller.needs.need import swing_held, way_of

_RETRY_S = 60.0  # time until a vibration that did not help is tried again; doubles each time


@kernel
def enter(s: ControllerMemory, mode: int, reason: int) -> None:
    """Set mode and reason; a change of mode resets the counters of the mode."""
    if s.mode != mode:
        s.mode = mode
        s.mode_s = 0.0
        s.calm_s = 0.0
        s.even_s, s.lead, s.top = 0.0, 0.0, -1.0
        s.unasked_s, s.wobbles = 0.0, 0
        s.roughness, s.roughness_s = 0.0, 0.0
    s.reason = reason


@kernel
def excite(p: ControllerParams, s: ControllerMemory, reason: int, ratio: float) -> None:
    """Begin or continue the vibration, with a set point of v_a / v_d of `ratio` or more."""
    way = way_of(s)
    s.ratio[way] = max(s.ratio[way], ratio)
    s.swing = max(s.swing, swing_held(s.ratio[way]))  # the ratio falls no faster than this swing of friction decays
    if s.mode != EXCITE:
        s.waiting_s = 0.0
    enter(s, EXCITE, reason)
    if s.allowed_m == 0.0:
        tune_to(p, s, s.candidate if s.tuned == 1 else cheapest(p, s, p.v_ratio * s.wanted_speed_mps, -1))


@kernel
def tune_to(p: ControllerParams, s: ControllerMemory, candidate: int) -> None:
    """Vibrate at a candidate frequency."""
    s.candidate = candidate
    s.wanted_Hz = p.candidate_Hz[candidate]
    s.tuned = 1


@kernel
def stop_helping(s: ControllerMemory, reason: int) -> None:
    """End a vibration that does not help, for a time that doubles with each call."""
    way = way_of(s)
    s.off_s[way] = _RETRY_S if s.off_s[way] == 0.0 else 2.0 * s.off_s[way]
    s.off_left_s[way] = s.off_s[way]
    enter(s, WATCH, reason)
