"""The loop check before a rig is armed: every sensor is live, the exciter answers at each tone, and its gain is measured."""

import math

from bridge.guard.states import enter, trip
from bridge.kernel import Record, kernel
from bridge.layouts import GuardMemory, GuardParams, SensorRow
from bridge.wire import stickslip_pb2 as wire

_TWO_PI = 2.0 * math.pi
_QUIET_S = 0.5  # time before the first tone, at rest; long enough for a 16-bit converter to show some noise
_TONE_S = 0.2  # time per tone; its first half, the start of the exciter, is not measured
_NOISY = 3  # the first 3 channels, force and accelerations, must show noise; an encoder at rest repeats its number
_ANSWERS = 4.0  # power at the tone over power of the noise, from which the exciter counts as answering
_WILD = 20.0  # largest plausible gain, and 1 over the smallest; a rigid mount has 1, a resonant one up to 10


@kernel
def check_tone(p: GuardParams, s: GuardMemory) -> tuple[float, float]:
    """Frequency [Hz] and amplitude [m] of the check's present tone; amplitude 0 before the first and after the last tone."""
    at = _tone(p, s.check_blocks)
    if at < 0 or at >= p.tones:
        return s.frequency_Hz, 0.0
    return p.tone_Hz[at], p.check_m


@kernel
def _tone(p: GuardParams, blocks: int) -> int:
    quiet_blocks, tone_blocks = _blocks(p, _QUIET_S), _blocks(p, _TONE_S)
    return (blocks - quiet_blocks) // tone_blocks if blocks >= quiet_blocks else -1


@kernel
def _blocks(p: GuardParams, time_s: float) -> int:
    return max(math.ceil(time_s / p.block_s), 2)


@kernel
def follow_check(p: GuardParams, s: GuardMemory, block: SensorRow, square_mps2: float) -> None:
    """Add a block of samples to the check; at its end go to ARMED, to READY if the gain has changed, or to FAULT.

    Args:
        p, s: records of `bridge.guard.records`.
        block: record of a sensor block.
        square_mps2: square of the amplitude of the base's acceleration at the frequency of the tone.

    """
    quiet_blocks, tone_blocks = _blocks(p, _QUIET_S), _blocks(p, _TONE_S)
    if s.check_blocks == 0:
        s.quiet_mps2, s.tone_mps2 = 0.0, 0.0
        s.lowest[:], s.highest[:] = math.inf, -math.inf
    if (
        not _note(s, 0, block.drive_force_N)
        or not _note(s, 1, block.mass_accel_mps2)
        or not _note(s, 2, block.base_accel_mps2)
        or not _note(s, 3, block.mass_position_m)
        or not _note(s, 4, block.drive_position_m)
    ):
        trip(s, wire.SENSOR_NOT_FINITE)
    at = _tone(p, s.check_blocks)
    s.check_blocks += 1
    if at >= p.tones:
        if s.amplitude_m == 0.0:
            s.square_mps2, s.vibration_mps = 0.0, 0.0  # the check's tones must not add to the next vibration
            _end(p, s)
        return
    if at < 0:
        s.quiet_mps2 += square_mps2 / quiet_blocks
        if s.check_blocks == quiet_blocks:
            for channel in range(_NOISY):
                if s.lowest[channel] == s.highest[channel]:
                    s.frozen_channel = channel
                    trip(s, wire.SENSOR_FROZEN)
        return
    done = (s.check_blocks - 1 - quiet_blocks) % tone_blocks
    if done == 0:
        s.tone_mps2 = 0.0
    if 2 * done >= tone_blocks:
        s.tone_mps2 += square_mps2 / (tone_blocks - (tone_blocks + 1) // 2)
    if done == tone_blocks - 1:
        _judge(p, s, at)


@kernel
def _end(p: GuardParams, s: GuardMemory) -> None:
    """Compare the gain with the last accepted gain; arm if it is the same, or if none was accepted."""
    if s.accepted[0] == 0.0:
        s.accepted[:] = s.gain
        enter(s, wire.ARMED, wire.FIRST_CHECK)
    elif gain_change(p, s) > p.gain_change:
        enter(s, wire.READY, wire.GAIN_CHANGED)
    else:  # the accepted gain is not updated: small changes would add up unnoticed
        enter(s, wire.ARMED, wire.CHECK_PASSED)


@kernel
def gain_change(p: GuardParams, s: GuardMemory) -> float:
    """Largest factor, either way, between the gains of the last check and the accepted gains."""
    largest = 1.0
    for at in range(p.tones):
        ratio = s.gain[at] / s.accepted[at]
        largest = max(largest, ratio, 1.0 / ratio)
    return largest


@kernel
def _judge(p: GuardParams, s: GuardMemory, at: int) -> None:
    omega = _TWO_PI * p.tone_Hz[at]
    s.gain[at] = math.sqrt(max(s.tone_mps2 - s.quiet_mps2, 0.0)) / (omega * omega * p.check_m)
    if s.tone_mps2 < _ANSWERS * s.quiet_mps2:
        trip(s, wire.EXCITER_SILENT)
    elif not 1.0 / _WILD < s.gain[at] < _WILD:
        trip(s, wire.EXCITER_WILD)
    elif at == p.tones - 1:
        s.verified = 1


@kernel
def write_gain(p: GuardParams, s: GuardMemory, block: SensorRow) -> None:
    """Write one tone of the last check and its gain into a block, the next tone into each next block; zeros without a check."""
    at = s.block % p.tones
    block.check_Hz = p.tone_Hz[at] if s.verified == 1 else 0.0
    block.check_gain = s.gain[at] if s.verified == 1 else 0.0


@kernel
def _note(s: GuardMemory, channel: int, samples: Record) -> bool:
    for i in range(samples.shape[0]):
        value = float(samples[i])
        if not math.isfinite(value):
            return False
        s.lowest[channel], s.highest[channel] = min(s.lowest[channel], value), max(s.highest[channel], value)
    return True
