"""The guard, block by block: `accept` each command, `allow` a vibration for the next block, `look` at its samples."""

import math

from bridge.guard.check import check_tone, enable_off, follow_check
from bridge.guard.estimates import see_drive, see_vibration
from bridge.guard.limits import held, held_by_drive, slewed_m, watch
from bridge.guard.states import enter, note_vibration
from bridge.kernel import Record, kernel
from bridge.layouts import CommandRow, GuardMemory, GuardParams, SensorRow
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import NO_BLOCK

# number of a command from which it is refused: far below 2^63, from which `last_sequence` would be negative
_MOST = 2**62
NO_COMMAND = -1  # NO_BLOCK as a signed number


@kernel
def accept(p: GuardParams, s: GuardMemory, command: CommandRow) -> bool:
    """Whether a command is valid: of this run, newer than the last, finite, and the answer to a block already sent.

    A restarted controller counts from 0, so after a time without fresh commands any number is newer.
    """
    sequence, block = int(command.sequence), int(command.block)
    numbers = math.isfinite(command.frequency_Hz) and math.isfinite(command.amplitude_m) and sequence < _MOST
    ours = command.run == p.run and 0 <= block < s.block
    if ours and numbers and command.amplitude_m >= 0.0 and (sequence > s.last_sequence or s.fresh == 0):
        s.last_sequence = sequence
        return True
    s.refused += 1
    return False


@kernel
def allow(p: GuardParams, s: GuardMemory, command_block: int, frequency_Hz: float, amplitude_m: float) -> None:
    """Set `frequency_Hz`, `amplitude_m`, `enable` and `toggle` of the next block, from the command in force.

    `enable` is the enable line of the exciter's amplifier; a watchdog of the device ends the vibration once `toggle` stays.

    Args:
        p, s: records of `bridge.guard.records`.
        command_block: block answered by the command, NO_COMMAND before the first.
        frequency_Hz, amplitude_m: the commanded vibration.

    """
    s.limit = wire.NO_CAUSE
    s.fresh = 1 if command_block != NO_COMMAND and 0 <= s.block - command_block <= p.timeout_blocks else 0
    target_Hz, target_m = s.frequency_Hz, 0.0
    if s.state in (wire.ARMED, wire.ACTIVE):
        if s.fresh == 1:
            s.heard, s.lost_blocks = 1, 0
            target_Hz = frequency_Hz
            target_m = min(held(p, s, frequency_Hz, amplitude_m), held_by_drive(p, s, frequency_Hz, amplitude_m))
        elif (
            s.heard == 1 or s.cause != wire.ARMED_BY_SCENARIO
        ):  # not while a rig armed by its scenario waits for its controller; an operator arms only with one
            s.limit = wire.COMMAND_LOST
            s.lost_blocks += 1
            if s.lost_blocks > p.lost_blocks:
                enter(s, wire.DISARMED, wire.COMMAND_LOST)
    elif s.state == wire.CHECKING:
        target_Hz, tone_m = check_tone(p, s)
        target_m = held(p, s, target_Hz, tone_m)
    watch(p, s)
    if s.state not in (wire.CHECKING, wire.ARMED, wire.ACTIVE):
        target_m = 0.0
    if target_m > 0.0:
        s.frequency_Hz = target_Hz  # a fading vibration keeps its frequency
    s.amplitude_m = slewed_m(s.amplitude_m, target_m, p.slew_m_per_block)
    if s.amplitude_m != target_m and s.limit == wire.NO_CAUSE:
        s.limit = wire.SLEW_RATE
    note_vibration(s)
    s.toggle = 1 - s.toggle
    proof = s.state == wire.CHECKING and enable_off(p, s)
    may_vibrate = s.state in (wire.CHECKING, wire.ARMED, wire.ACTIVE) or s.amplitude_m > 0.0
    s.enable = 1 if may_vibrate and not proof else 0


@kernel
def _blank(p: GuardParams, channel: int, samples: Record) -> None:
    if p.absent[channel] == 1:
        samples[:] = 0.0


@kernel
def look(p: GuardParams, s: GuardMemory, block: SensorRow) -> None:
    """Process the samples of the block that vibrated as `allow` set; the next block begins. Absent channels become zeros."""
    _blank(p, 0, block.drive_force_N)
    _blank(p, 1, block.mass_accel_mps2)
    _blank(p, 3, block.mass_position_m)
    see_drive(p, s, block)
    see_vibration(p, s, block)
    if s.state == wire.CHECKING:
        follow_check(p, s, block, s.square_mps2)
    s.block += 1


@kernel
def write_in_force(s: GuardMemory, command_block: int, block: SensorRow) -> None:
    """Write the vibration in force at the block's end, as `allow` set it; `command_block` as there."""
    block.applied_Hz = s.frequency_Hz
    block.applied_m = s.amplitude_m
    if command_block == NO_COMMAND:  # an interpreter stores no negative number in an unsigned field
        block.applied_block = NO_BLOCK
    else:
        block.applied_block = command_block
    block.fallback = 1 - s.fresh
    block.guard_limit = s.limit
