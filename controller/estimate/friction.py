"""Breakaway and sliding force of each direction, learnt without vibration."""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory
from bridge.wire.stickslip_pb2 import SMOOTH, STICK

_SLIP_SHARE = 0.3  # weight of a new slip in the learnt breakaway force and in the learnt fall of the force
_SLIDING_S = 0.3  # time constant of the learnt sliding force


@kernel
def forces(s: ControllerMemory, force_N: float, tick_s: float) -> None:
    """Learn the breakaway force at slips, and the sliding force in smooth sliding, both without vibration."""
    way = 0 if s.direction > 0 else 1
    along_N = s.direction * force_N
    s.peak_N = max(s.peak_N, along_N)
    if s.allowed_m == 0.0:
        if s.slip_began == 1 and s.peak_N > 0.0:
            known_N = s.breakaway_N[way]
            s.breakaway_N[way] = s.peak_N if known_N == 0.0 else known_N + _SLIP_SHARE * (s.peak_N - known_N)
            s.slip_from_N = s.peak_N
        if s.slipping == 0 and s.slip_from_N > 0.0:
            fell_N, known_N = s.slip_from_N - along_N, s.swing_N[way]
            s.swing_N[way] = fell_N if known_N == 0.0 else known_N + _SLIP_SHARE * (fell_N - known_N)
            s.slip_from_N = 0.0
        if s.contact == SMOOTH and s.smooth_s > s.window_s:
            known_N = s.sliding_N[way]
            s.sliding_N[way] = along_N if known_N == 0.0 else known_N + tick_s / _SLIDING_S * (along_N - known_N)
    if s.slipping == 0 and s.contact != STICK:
        s.peak_N = along_N
    if s.contact == SMOOTH or s.slipping == 1:
        s.dragged[way] = 1
