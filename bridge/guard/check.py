"""The loop check before a rig is armed: every sensor is live, the exciter answers at each tone, and its gain is as expected.

It begins with the first tone while the exciter's enable line is off: a response then shows a dead line.
"""

import math

from bridge.guard.records import FIRST
from bridge.guard.states import enter, trip
from bridge.kernel import Record, kernel
from bridge.layouts import GuardMemory, GuardParams, SensorRow
from bridge.wire import stickslip_pb2 as wire

_TWO_PI = 2.0 * math.pi
_QUIET_S = 0.5  # time before the first tone, at rest; long enough for a 16-bit converter to show some noise
_TONE_S = 0.2  # time per tone; its first half, the start of the exciter, is not measured
_NOISY = 3  # the first 3 channels, force and accelerations, must show noise; an encoder at rest repeats its number
_ANSWERS = 4.0  # power at the tone over power of the noise, from which the exciter counts as answering
# Largest factor, either way, between the first check and the rig file. Smaller: a sensor and an exciter at the ends of their data
# sheets (10 % and 20 %) need an operator. Larger: half the sensitivity passes; with 20, an accelerometer in g (9.8) passed.
_UNEXPECTED = 1.5
# Largest v_a of a tone, over the absolute limit. Smaller: the tone drowns in the noise. Larger: mounts that resonate reach it.
_VELOCITY_SHARE = 0.5
_PROOF, _QUIET = -2, -1  # parts of the check before its tones: a tone with the enable line off, then no tone


@kernel
def check_tone(p: GuardParams, s: GuardMemory) -> tuple[float, float]:
    """Frequency [Hz] and amplitude [m] of the check's present tone; amplitude 0 in the quiet part and after the last tone."""
    at = _part(p, s.check_blocks)
    if at == _QUIET or at >= p.tones:
        return s.frequency_Hz, 0.0
    tone_Hz = p.tone_Hz[max(at, 0)]
    return tone_Hz, min(p.check_m, _VELOCITY_SHARE * p.alarm[wire.DRIVE_MAX - FIRST] / (_TWO_PI * tone_Hz))


@kernel
def enable_off(p: GuardParams, s: GuardMemory) -> bool:
    """Whether the check proves the enable line: until the first tone has faded."""
    part = _part(p, s.check_blocks)
    return part == _PROOF or (part == _QUIET and s.amplitude_m > 0.0)


@kernel
def _part(p: GuardParams, blocks: int) -> int:
    """The part of the check: _PROOF, _QUIET, or the number of a tone."""
    tone_blocks = _blocks(p, _TONE_S)
    if blocks < tone_blocks:
        return _PROOF
    since = blocks - tone_blocks - _blocks(p, _QUIET_S)
    return since // tone_blocks if since >= 0 else _QUIET


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
        not _note(p, s, 0, block.drive_force_N)
        or not _note(p, s, 1, block.mass_accel_mps2)
        or not _note(p, s, 2, block.base_accel_mps2)
        or not _note(p, s, 3, block.mass_position_m)
        or not _note(p, s, 4, block.drive_position_m)
    ):
        trip(s, wire.SENSOR_NOT_FINITE)
    at = _part(p, s.check_blocks)
    since = s.check_blocks if at == _PROOF else s.check_blocks - tone_blocks
    s.check_blocks += 1
    if at >= p.tones:
        if s.amplitude_m == 0.0:
            s.square_mps2, s.vibration_mps = 0.0, 0.0  # the check's tones must not add to the next vibration
            _end(p, s)
        return
    if at == _QUIET:
        s.quiet_mps2 += square_mps2 / quiet_blocks
        if since == quiet_blocks - 1:
            _judge_quiet(s)
        return
    done = since if at == _PROOF else (since - quiet_blocks) % tone_blocks
    if done == 0:
        s.tone_mps2 = 0.0
    if 2 * done >= tone_blocks:
        s.tone_mps2 += square_mps2 / (tone_blocks - (tone_blocks + 1) // 2)
    if done == tone_blocks - 1 and at != _PROOF:
        _judge(p, s, at)


@kernel
def _judge_quiet(s: GuardMemory) -> None:
    """Compare the power of the proof, the only tone so far, with the noise; look for channels that never changed."""
    for channel in range(_NOISY):
        if s.lowest[channel] == s.highest[channel]:
            s.frozen_channel = channel
            trip(s, wire.SENSOR_FROZEN)
    if s.tone_mps2 >= _ANSWERS * s.quiet_mps2:
        trip(s, wire.ENABLE_DEAD)


@kernel
def _judge(p: GuardParams, s: GuardMemory, at: int) -> None:
    if s.amplitude_m == 0.0 or not s.tone_mps2 > _ANSWERS * s.quiet_mps2:
        trip(s, wire.EXCITER_SILENT)
        return
    omega = _TWO_PI * p.tone_Hz[at]
    s.gain[at] = math.sqrt(s.tone_mps2 - s.quiet_mps2) / (omega * omega * s.amplitude_m)
    if at == p.tones - 1:
        s.verified = 1


@kernel
def _end(p: GuardParams, s: GuardMemory) -> None:
    """Compare the gain with the last accepted gain, or with the rig file if none was accepted; arm if it agrees."""
    first = s.accepted[0] == 0.0
    if gain_change(p, s) > (_UNEXPECTED if first else p.gain_change):
        enter(s, wire.READY, wire.GAIN_UNEXPECTED if first else wire.GAIN_CHANGED)
    elif first:
        s.accepted[:] = s.gain
        enter(s, wire.ARMED, wire.FIRST_CHECK)
    else:  # the accepted gain is not updated: small changes would add up unnoticed
        enter(s, wire.ARMED, wire.CHECK_PASSED)


@kernel
def expected_gain(p: GuardParams, s: GuardMemory, at: int) -> float:
    """The gain that the check compares a tone with: the accepted one, else the gain of the rig file."""
    return s.accepted[at] if s.accepted[at] > 0.0 else p.exciter_gain


@kernel
def gain_change(p: GuardParams, s: GuardMemory) -> float:
    """Largest factor, either way, between the gains of the last check and the expected gains."""
    largest = 1.0
    for at in range(p.tones):
        ratio = s.gain[at] / expected_gain(p, s, at)
        largest = max(largest, ratio, 1.0 / ratio)
    return largest


def gain_report(p: GuardParams, s: GuardMemory) -> str:
    """The measured and the expected gain at each tone of the last check, as text."""
    tones = [
        f"{s.gain[at]:.3g} at {p.tone_Hz[at]:.0f} Hz (expected {expected_gain(p, s, at):.3g})" for at in range(p.tones)
    ]
    return f"measured {', '.join(tones)}"


@kernel
def write_gain(p: GuardParams, s: GuardMemory, block: SensorRow) -> None:
    """Write one tone of the last check and its gain into a block, the next tone into each next block; zeros without a check."""
    at = s.block % p.tones
    block.check_Hz = p.tone_Hz[at] if s.verified == 1 else 0.0
    block.check_gain = s.gain[at] if s.verified == 1 else 0.0


@kernel
def _note(p: GuardParams, s: GuardMemory, channel: int, samples: Record) -> bool:
    """Note the range of a channel; returns whether its samples are finite. Only a measured channel has a range, or freezes."""
    if p.absent[channel] != 0:
        return True
    for i in range(samples.shape[0]):
        value = float(samples[i])
        if not math.isfinite(value):
            return False
        s.lowest[channel], s.highest[channel] = min(s.lowest[channel], value), max(s.highest[channel], value)
    return True
