"""The commanded amplitude for a wanted v_a, by the exciter's gain, which is learnt from the delivered v_a.

The measured v_a is compared with all commands within the longest loop delay that the loop is designed for. The gain is learnt
only from a v_a that none of these commands explains (set membership: the delay is unknown but bounded). So the learnt gain does
not overshoot the true gain, for any delay and any change of it, and the loop needs no integrator. A gain that was never measured
starts at a tenth of the rigid mount's stroke, as a mount may resonate tenfold.
"""

import math

from bridge.kernel import Record, kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import CHECKING
from controller.in_force import REMEMBERED, is_judged
from controller.trips.band import banded, is_known, note_known
from controller.trips.delivered import is_even, note_command
from controller.trips.doubts import ACCELEROMETER

TWO_PI = 2.0 * math.pi
FIRST_SHARE = 0.1  # first stroke over the stroke of the rigid mount, for a gain that was never measured
_GROWTH = 1.25  # factor by which the stroke grows in each loop delay, while the gain is not known
_UNKNOWN_DELAY_S = 0.05  # loop delay until it is measured: the longest that the loop is designed for
SETTLE_S = 0.004  # duration of a detected vibration until its gain is learnt
LEARN_S = 0.01  # time constant of the learnt gain
MOST_DELAY_S = 0.05  # longest loop delay of the gain's learning. Larger: a gain that changes with v_d is learnt later
TAIL = 3.0  # time constants of the demodulator's low-pass after which earlier commands have no effect
SLOTS = 18  # time slots for extremes of the command; fixed, so that a scan costs the same at any block length
_HEARD = 5.0  # smallest v_a that counts as detected, over the mean v_a that noise shows at rest
_LEAST_HEARD_MPS = 1e-7  # no accelerometer detects a weaker vibration of some kHz
_MEAN_STEPS = 50  # silent blocks over which the accelerometer's noise is averaged
_FEW_STEPS = 10  # with fewer silent blocks, blocks until a first vibration is detected count as silent, too
# Number of silent blocks at which a vibration must be twice as strong to be detected. Smaller: noise is detected in the first
# blocks, and a delay of 0 is learnt; at 5 that happens in 0.1 % of the first starts in the second block of a run.
_UNSURE_STEPS = 5.0
_LOUDER, _MUCH_LOUDER = 1.3, 2.0  # measured over wanted v_a above which the command is corrected, or cut, at once
LOUD_S = 0.003  # time for which v_a must exceed _LOUDER times the wanted v_a until it is corrected
SILENCE_S = 0.1  # duration of zero commands until the base counts as at rest
_LARGEST_LOG_GAIN = 4.6  # largest logarithm of the gain, either sign: a factor of 100
_ALARM_RATIO = 1.05  # v_a / v_d below which a vibration at the exciter's limit is too weak


@kernel
def note_sent(p: ControllerParams, s: ControllerMemory) -> None:
    """Store the commanded and the wanted v_a of this step [m/s]."""
    s.sent_m[s.steps % REMEMBERED] = s.allowed_m
    sent_mps, slot = TWO_PI * s.allowed_Hz * s.allowed_m, s.steps // p.slot_steps % p.slots
    is_new_slot = s.steps % p.slot_steps == 0
    s.least_sent_mps[slot] = sent_mps if is_new_slot else min(s.least_sent_mps[slot], sent_mps)
    s.most_sent_mps[slot] = sent_mps if is_new_slot else max(s.most_sent_mps[slot], sent_mps)
    wanted_mps = s.wanted_velocity_mps
    s.most_wanted_mps[slot] = wanted_mps if is_new_slot else max(s.most_wanted_mps[slot], wanted_mps)


@kernel
def _largest(p: ControllerParams, slots: Record) -> float:
    largest = 0.0
    for i in range(p.slots):
        largest = max(largest, slots[i])
    return largest


@kernel
def _least(p: ControllerParams, slots: Record) -> float:
    least = math.inf
    for i in range(p.slots):
        least = min(least, slots[i])
    return least


@kernel
def listen(p: ControllerParams, s: ControllerMemory, late: bool) -> None:
    """Learn loop delay and gain from the v_a of this block, and correct the gain where v_a is too large.

    A `late` block shows a v_a that was commanded at an unknown earlier time: nothing is learnt from it. Soon after a stall no
    gain is learnt, as the rig may not vibrate again yet; too large a v_a is still cut.
    """
    if s.guard_state == CHECKING:  # the tones of the rig's check do not answer a command
        s.silent_steps, s.heard_steps, s.loud_steps, s.even_steps = 0, 0, 0, 0
        s.expected_mps, s.in_phase_mps2, s.quadrature_mps2 = 0.0, 0.0, 0.0
        return
    at = s.steps % REMEMBERED
    delay = s.loop_delay_steps if s.loop_delay_steps >= 0 else 0
    sent_m = s.sent_m[(at - 1 - delay) % REMEMBERED]
    expected_mps = TWO_PI * s.allowed_Hz * sent_m
    note_command(s, expected_mps)
    s.expected_mps += p.filter_share * (expected_mps - s.expected_mps)
    s.silent_steps = s.silent_steps + 1 if s.allowed_m == 0.0 and not late else 0
    if s.silent_steps > p.silence_steps:
        _note_silence(s)
        s.onset_steps, s.listening = -1, 1
    unsure = 1.0 + _UNSURE_STEPS / max(s.noise_steps, 1)
    heard = s.fast_mps > max(_HEARD * unsure * s.noise_mps, _LEAST_HEARD_MPS)
    if s.listening == 1 and s.allowed_m > 0.0 and not late:
        s.onset_steps += 1
        if heard:
            _note_delay(s)
        elif s.noise_steps < _FEW_STEPS:
            _note_silence(s)
    s.heard_steps = s.heard_steps + 1 if heard and s.listening == 0 else 0
    doubted = s.doubted & ACCELEROMETER != 0
    # a first gain waits longer, as the loop delay may vary by half of its value
    steps = p.settle_steps if s.gain_known[s.candidate] == 1 else max(p.settle_steps, s.loop_delay_steps // 2)
    if s.heard_steps < steps or s.demodulated_Hz != s.allowed_Hz or doubted:
        s.loud_steps = 0
        return
    if late:
        return
    most_mps = _largest(p, s.most_sent_mps)
    if is_judged(s):
        _learn(p, s, s.candidate, most_mps)
    _hold_down(p, s, s.candidate, most_mps)


@kernel
def _learn(p: ControllerParams, s: ControllerMemory, i: int, most_mps: float) -> None:
    """Learn the gain at a candidate frequency from a v_a that no recent command explains; `most_mps`: their largest."""
    now_mps = s.vibration_velocity_mps
    if s.expected_mps <= 0.0 or now_mps <= 0.0:
        return
    if s.gain_known[i] == 0:
        s.log_gain[i], s.gain_known[i] = _bounded(math.log(now_mps / s.expected_mps)), 1
        return
    gain = math.exp(s.log_gain[i])
    least_mps = _least(p, s.least_sent_mps)
    if now_mps > gain * most_mps > 0.0:
        s.log_gain[i] += p.learn_share * (_bounded(math.log(now_mps / most_mps)) - s.log_gain[i])
    elif 0.02 * gain * least_mps < now_mps < gain * least_mps:
        s.log_gain[i] += p.learn_share * (_bounded(math.log(now_mps / least_mps)) - s.log_gain[i])
    if now_mps > 0.02 * gain * s.expected_mps and is_even(p, s) and not is_known(p, s, i):
        note_known(p, s, i, now_mps / s.expected_mps)


@kernel
def _note_silence(s: ControllerMemory) -> None:
    """Learn the accelerometer's noise while the base is at rest."""
    s.noise_steps = min(s.noise_steps + 1, _MEAN_STEPS)
    s.noise_mps += (s.fast_mps - s.noise_mps) / s.noise_steps


@kernel
def _bounded(log_gain: float) -> float:
    return min(max(log_gain, -_LARGEST_LOG_GAIN), _LARGEST_LOG_GAIN)


@kernel
def _note_delay(s: ControllerMemory) -> None:
    """Set the loop delay at the first detected vibration: the steps since it was commanded."""
    if s.loop_delay_steps < 0:
        s.loop_delay_steps = s.onset_steps
    else:
        s.loop_delay_steps += (s.onset_steps - s.loop_delay_steps) // 2
    s.listening, s.even_steps = 0, 0
    # restart the low-passes of measured and expected v_a, as the delay was not known before
    s.expected_mps, s.in_phase_mps2, s.quadrature_mps2 = 0.0, 0.0, 0.0


@kernel
def _hold_down(p: ControllerParams, s: ControllerMemory, i: int, most_mps: float) -> None:
    wanted_mps = _largest(p, s.most_wanted_mps)
    ratio = s.fast_mps / wanted_mps if wanted_mps > 0.0 else 0.0
    s.loud_steps = s.loud_steps + 1 if ratio > _LOUDER else 0
    if s.loud_steps >= p.loud_steps and most_mps > 0.0:
        s.log_gain[i] = max(s.log_gain[i], _bounded(math.log(s.fast_mps / most_mps)))
        s.loud_steps = -s.loop_delay_steps  # the correction takes effect after one delay
        if ratio > _MUCH_LOUDER:
            s.cut_steps = s.loop_delay_steps + p.settle_steps


@kernel
def amplitude(p: ControllerParams, s: ControllerMemory) -> None:
    """Set the wanted amplitude [m] for the wanted v_a, and decide whether the piezo is too weak for it."""
    velocity_mps = s.wanted_velocity_mps
    s.cut_steps = max(s.cut_steps - 1, 0)
    if velocity_mps <= 0.0 or s.cut_steps > 0:
        s.wanted_m, s.growth = 0.0, FIRST_SHARE
        _judge_piezo(p, s, weak=False)
        return
    model_m = velocity_mps / (TWO_PI * s.wanted_Hz)
    doubted = s.doubted & ACCELEROMETER != 0
    if doubted and s.known_steps[s.candidate] > 0:
        s.wanted_m = model_m / s.known_gain[s.candidate]
    elif s.gain_known[s.candidate] == 1:
        s.wanted_m = model_m * math.exp(-s.log_gain[s.candidate])
    else:
        delay_s = _UNKNOWN_DELAY_S if s.loop_delay_steps < 0 else (s.loop_delay_steps + 1) * p.block_s + SETTLE_S
        if s.heard_steps == 0:  # no growth once v_a is detected: commands within the last loop delay have yet to act
            s.growth = min(s.growth * _GROWTH ** (p.block_s / delay_s), 1.0)
        s.wanted_m = model_m * s.growth
    s.wanted_m = banded(p, s, s.wanted_m, model_m)
    largest_m = min(p.amplitude_max_m, p.velocity_max_mps / (TWO_PI * s.wanted_Hz))
    settled = s.free_steps > s.loop_delay_steps + p.settle_steps
    tried = s.growth >= 1.0 or s.gain_known[s.candidate] == 1
    unheard = settled and tried and is_judged(s) and s.vibration_velocity_mps < 0.02 * velocity_mps
    s.at_limit = 1 if s.wanted_m > largest_m or unheard or s.banded == 1 or doubted else 0
    weak = s.at_limit == 1 and not doubted and s.vibration_velocity_mps < _ALARM_RATIO * s.held_mps
    _judge_piezo(p, s, weak)


@kernel
def _judge_piezo(p: ControllerParams, s: ControllerMemory, weak: bool) -> None:
    if not is_judged(s):
        s.weak_s = 0.0
        return
    s.weak_s = s.weak_s + p.block_s if weak else 0.0
