"""Changes of the mode, and of the vibration's frequency."""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import EXCITE
from controller.policy.frequency import cheapest
from controller.policy.need import swing_held, way_of


@kernel
def enter(s: ControllerMemory, mode: int) -> None:
    """Set the mode; a change resets the times of the mode."""
    if s.mode != mode:
        s.mode = mode
        s.mode_s = 0.0
        s.calm_s = 0.0
        s.even_s, s.lead, s.top = 0.0, 0.0, -1.0


@kernel
def excite(p: ControllerParams, s: ControllerMemory, why: int, ratio: float) -> None:
    """Begin the vibration for a reason `why`, with a set point of v_a / v_d of `ratio` or more."""
    way = way_of(s)
    s.ratio[way] = max(s.ratio[way], ratio)
    s.swing = max(s.swing, swing_held(s.ratio[way]))  # the ratio falls no faster than this swing of friction decays
    s.waiting_s = 0.0
    enter(s, EXCITE)
    s.why = why
    if s.allowed_m == 0.0:
        tune_to(p, s, s.candidate if s.tuned == 1 else cheapest(p, s, p.v_ratio * s.wanted_speed_mps, -1))


@kernel
def tune_to(p: ControllerParams, s: ControllerMemory, candidate: int) -> None:
    """Vibrate at a candidate frequency."""
    s.candidate = candidate
    s.wanted_Hz = p.candidate_Hz[candidate]
    s.tuned = 1
