"""Measured v_a against the v_a expected from command and known gain, while the command is even.

Less than the band allows: OPEN_LOOP, or a more exact reason from the block's samples. A loss of gain within a second by more than
the band trips as well. A slow loss inside the band is normal for an exciter that warms up; beyond it `band` limits the stroke.
More than the band allows: RESONANCE, and the command is lowered, as a mount may have loosened.
"""

import math

from bridge.kernel import Record, kernel
from bridge.layouts import ControllerMemory, ControllerParams, SensorRow
from bridge.wire.stickslip_pb2 import CLIPPED, FROZEN, NOISE, OPEN_LOOP, SWAPPED
from controller.trips.band import is_known
from controller.trips.doubts import ACCELEROMETER, OF_BASE, trip
from controller.vibration import velocity_of

_TWO_PI = 2.0 * math.pi
SOME = 4  # steps between two slow checks
_EVEN = 0.05  # largest difference of an even expected v_a from its low-pass, over v_a
HOLD_S = 0.05  # time of too small a v_a until a trip; until then the band bounds v_a
LOUD_HOLD_S = 0.1  # time of too large a v_a until RESONANCE; a slip that shakes the base is shorter
GROWN_HOLD_S = 1.0  # time of a gain above the square root of the band until RESONANCE: it grows slowly
PASSED_S = 1.0  # time without too large a v_a until RESONANCE ends
FOLLOW_S = 1.0  # time constant of the followed gain, with which a sudden loss is compared
_NO_SINE = 0.25  # mean square of the rest over the wanted sine's, from which an acceleration is not a sine
_NOISIER = 16.0  # factor by which the mean square of the rest grows before a trip
_AT_EXTREME = 0.99  # share of a block's largest sample from which a sample counts as an extreme
_CLIPPED_SHARE = 0.3  # share of samples at the extremes from which a block is clipped; a sine has 0.09
_MOST_OFF = 1.6  # largest deviation from the known gain, as a factor, of a slide accelerometer swapped with the base's


@kernel
def note_command(s: ControllerMemory, expected_mps: float) -> None:
    """Count the steps for which the expected v_a [m/s] has been even."""
    apart_mps = math.fabs(expected_mps - s.expected_mps)
    s.even_steps = s.even_steps + 1 if expected_mps > 0.0 and apart_mps < _EVEN * expected_mps else 0


@kernel
def is_even(p: ControllerParams, s: ControllerMemory) -> bool:
    """Whether the command was even for long enough to compare the measured v_a with it, for any likely loop delay.

    Until a vibration is first detected, its delay may be any delay that the loop is designed for.
    """
    if s.listening == 1 and s.onset_steps <= p.slot_steps * p.slots:
        return False
    return s.even_steps > p.settle_steps + s.loop_delay_steps // 2 and s.demodulated_Hz == s.allowed_Hz


@kernel
def watch_delivered(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> None:
    """Compare v_a with the command; trip if it is too small for the hold time, and count the steps for which it is too large."""
    i = s.candidate
    if s.followed != i or not is_known(p, s, i):
        s.followed, s.followed_gain, s.low_steps = i, s.known_gain[i], 0
    if not is_known(p, s, i) or not is_even(p, s):
        s.high_steps = min(s.high_steps + 1, 0)
        return
    now_mps, per_band = s.vibration_velocity_mps, 1.0 / p.gain_band
    least = max(s.followed_gain, s.known_gain[i] * per_band) * per_band
    if now_mps < least * s.expected_mps:
        s.low_steps += 1
        if s.low_steps > p.low_steps:
            trip(s, _cause(p, s, block), ACCELEROMETER)
    else:
        s.low_steps = 0
        if s.steps % SOME == 0:
            s.followed_gain += p.follow_share * (now_mps / s.expected_mps - s.followed_gain)
    over = now_mps / (s.known_gain[i] * s.expected_mps)
    s.grown_steps = s.grown_steps + 1 if over > math.sqrt(p.gain_band) else 0
    high = over > p.gain_band or s.grown_steps > p.grown_steps
    if high and s.high_steps < 0:
        s.high_steps = -p.passed_steps
    elif high:
        s.high_steps = s.high_steps + 1 if s.high_steps < p.high_steps else -p.passed_steps
    else:
        s.high_steps = min(s.high_steps + 1, 0)


@kernel
def _cause(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> int:
    """Cause of too small a v_a, from a block: clipped, swapped with the slide's accelerometer, or unknown."""
    if clips(block.base_accel_mps2):
        return CLIPPED
    of_slide_mps = velocity_of(p, s.demodulated_Hz, block.mass_accel_mps2)
    known_mps = s.expected_mps * s.known_gain[s.candidate]
    if known_mps / _MOST_OFF < of_slide_mps < known_mps * _MOST_OFF:
        return SWAPPED
    return OPEN_LOOP


@kernel
def clips(samples: Record) -> bool:
    """Whether samples stay at their extremes for longer than a sine does."""
    largest, at_extreme = 0.0, 0
    for i in range(samples.shape[0]):
        largest = max(largest, math.fabs(float(samples[i])))
    for i in range(samples.shape[0]):
        at_extreme += 1 if math.fabs(float(samples[i])) >= _AT_EXTREME * largest else 0
    return largest > 0.0 and at_extreme > _CLIPPED_SHARE * samples.shape[0]


@kernel
def watch_rest(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> None:
    """Trip if the acceleration was a sine and is not any more: clipped or noisy. Called every SOME steps.

    The reference is the sine of the wanted v_a: far stronger noise would look like v_a, and reduce the command.
    """
    if s.wanted_velocity_mps == 0.0 or not is_known(p, s, s.candidate):
        return
    square = 0.0
    for i in range(block.base_accel_mps2.shape[0]):
        square += float(block.base_accel_mps2[i]) * float(block.base_accel_mps2[i])
    fitted_mps2_2 = 0.5 * (s.in_phase_mps2 * s.in_phase_mps2 + s.quadrature_mps2 * s.quadrature_mps2)
    rest_mps2_2 = max(square / block.base_accel_mps2.shape[0] - fitted_mps2_2, 0.0)
    wanted_mps2 = _TWO_PI * s.wanted_Hz * s.wanted_velocity_mps
    if s.rest_mps2_2 > 0.0 and rest_mps2_2 > max(_NOISIER * s.rest_mps2_2, _NO_SINE * 0.5 * wanted_mps2 * wanted_mps2):
        s.rest_steps += SOME
        if s.rest_steps > p.low_steps:
            repeats = s.same_steps[OF_BASE] >= SOME
            trip(s, FROZEN if repeats else CLIPPED if clips(block.base_accel_mps2) else NOISE, ACCELEROMETER)
        return
    s.rest_steps = 0
    if is_even(p, s):
        s.rest_mps2_2 += (p.follow_share if s.rest_mps2_2 > 0.0 else 1.0) * (rest_mps2_2 - s.rest_mps2_2)


@kernel
def is_loud(s: ControllerMemory) -> bool:
    """Whether v_a is, or was within PASSED_S, larger than the known gain and its band allow."""
    return s.high_steps < 0
