"""One block of a guarded rig, between its messages: commands to the exciter, samples to the guard, the block and its report.

The compiled loop of the plant (`plant.step`) calls `hear`, `allow` and `report`; `begin` and `end` are the same block around any
device. No clock, file, bus or thread.
"""

import math

import numpy as np

from bridge.arrays import Floats, Records
from bridge.guard.check import write_gain
from bridge.guard.core import NO_COMMAND, accept, allow, look, write_in_force
from bridge.guard.estimates import expect_drive
from bridge.kernel import Record, kernel, record, shared_kernel
from bridge.layouts import AppliedRow, DeviceMemory, GuardMemory, GuardParams, SensorRow
from bridge.wire.channels import CHANNELS

# Share of the samples at an end of the range from which a channel counts as clipped. Smaller: a signal of few steps whose tips
# are equal now and then. Larger: a vibration below 1 kHz at 20 kHz, of which 2 in 20 samples leap to an end.
_CLIPPED = 0.03
# Steps of a channel from which its way to an end is a leap. Smaller: a slow signal with few steps, which rests at its ends.
# Larger: a clipped signal with few steps passes.
_LEAP = 8

DEVICE = np.dtype(
    # the command in force; per channel its place in the device's samples, its calibration and range, and the watch for clipping
    [
        *(("command_block", "i8"), ("commanded_Hz", "f8"), ("commanded_m", "f8")),
        *(("source", "i8", (len(CHANNELS),)), ("scale", "f8", (len(CHANNELS),)), ("offset", "f8", (len(CHANNELS),))),
        *((name, "f8", (len(CHANNELS),)) for name in ("range_low", "range_high", "lowest", "highest", "step")),
        ("at_end", "i8", (len(CHANNELS),)),
    ],
    align=True,
)


def device_memory() -> Records:
    """One record of `DEVICE` without a command in force: each channel at its row, in SI units."""
    memory = record(DEVICE)
    memory["command_block"] = NO_COMMAND
    memory["source"], memory["scale"] = np.arange(len(CHANNELS)), 1.0
    memory["range_low"], memory["range_high"] = -np.inf, np.inf
    clipped(memory, 1)
    return memory


def clipped(memory: Records, samples: int) -> list[str]:
    """Names of the channels that were clipped since the last call, `samples` samples ago."""
    names = [name for name, times in zip(CHANNELS, memory["at_end"][0], strict=True) if times > _CLIPPED * samples]
    memory["at_end"], memory["lowest"], memory["highest"] = 0, np.inf, -np.inf
    return names


@kernel
def hear(gp: GuardParams, g: GuardMemory, commands: Records, announce: Records) -> tuple[int, int]:
    """Pass commands and announcements to the guard; the number of accepted commands, and the row of the newest."""
    accepted, newest = 0, 0
    for i in range(commands.shape[0]):
        if accept(gp, g, commands[i]):
            accepted, newest = accepted + 1, i
    for i in range(announce.shape[0]):
        expect_drive(g, announce[i].drive_velocity_mps)
    return accepted, newest


@kernel
def report(
    gp: GuardParams,
    g: GuardMemory,
    frequency_Hz: float,
    amplitude_m: float,
    command_block: int,
    commands: int,
    commands_late: int,
    round_trip_ns: int,
    late_ns: int,
    block: SensorRow,
    a: AppliedRow,
) -> None:
    """Pass the samples of a block to the guard, and fill in the guard's fields of the block and the applied vibration.

    Args:
        gp, g: parameters and memory of the guard.
        frequency_Hz, amplitude_m: of the exciter at the block's end.
        command_block: block answered by the command in force, NO_COMMAND before the first.
        commands: number of accepted commands.
        commands_late, round_trip_ns, late_ns: copied to `a`.
        block: record of a sensor block with number, time and samples.
        a: record of `Applied`, filled.

    """
    look(gp, g, block)
    block.run = gp.run
    block.guard_state = g.state
    write_gain(gp, g, block)
    write_in_force(g, command_block, block)
    a.sequence = block.sequence
    a.t_ns = block.t_ns
    a.frequency_Hz = frequency_Hz
    a.amplitude_m = amplitude_m
    a.command_block = block.applied_block
    a.commands = commands
    a.fallback = block.fallback
    a.round_trip_ns = round_trip_ns
    a.late_ns = late_ns
    a.commands_late = commands_late
    a.guard_state = g.state
    a.cause = g.cause
    a.guard_limit = g.limit
    a.commands_refused = g.refused
    g.refused = 0
    a.heat_share = g.heat
    a.toggle = g.toggle


@shared_kernel
def begin(guard_params: Records, guard_state: Records, memory: Records, commands: Records, announce: Records) -> int:
    """Set the vibration of the next block in the guard's memory; return the number of accepted commands.

    Args:
        guard_params, guard_state: one record each of `bridge.guard.records`.
        memory: one record of `DEVICE`.
        commands: commands received since the last block; the newest that the guard accepts comes into force.
        announce: the rig's announcements before these samples.

    """
    gp: GuardParams = guard_params[0]
    g: GuardMemory = guard_state[0]
    m: DeviceMemory = memory[0]
    accepted, newest = hear(gp, g, commands, announce)
    if accepted > 0:
        m.command_block = commands[newest].block
        m.commanded_Hz, m.commanded_m = commands[newest].frequency_Hz, commands[newest].amplitude_m
    allow(gp, g, m.command_block, m.commanded_Hz, m.commanded_m)
    return accepted


@shared_kernel
def fill(guard_state: Records, memory: Records, block_ns: int, lost: int, samples: Floats, sensors: Records) -> None:
    """Write number, time and calibrated samples of a device's block into a message; a missing sample stays NaN.

    Args:
        guard_state: one record of `bridge.guard.records`; its block number skips the lost blocks.
        memory: one record of `DEVICE`.
        block_ns: length of a block by the device's clock.
        lost: whole blocks that the device lost before this one.
        samples: of the device, float64 [its channels, samples]; NaN: missing.
        sensors: one message record.

    """
    g: GuardMemory = guard_state[0]
    m: DeviceMemory = memory[0]
    block: SensorRow = sensors[0]
    g.block += lost
    block.sequence = g.block
    block.t_ns = (g.block + 1) * block_ns
    _calibrate(m, 0, samples, block.drive_force_N)
    _calibrate(m, 1, samples, block.mass_accel_mps2)
    _calibrate(m, 2, samples, block.base_accel_mps2)
    _calibrate(m, 3, samples, block.mass_position_m)
    _calibrate(m, 4, samples, block.drive_position_m)


@kernel
def _calibrate(m: DeviceMemory, channel: int, samples: Floats, calibrated: Record) -> None:
    source = m.source[channel]
    for i in range(calibrated.shape[0]):
        raw = samples[source, i] if source >= 0 else 0.0
        calibrated[i] = m.scale[channel] * raw + m.offset[channel] if math.isfinite(raw) else math.nan
    if source >= 0:
        _watch_ends(m, channel, calibrated)


@kernel
def _watch_ends(m: DeviceMemory, channel: int, values: Record) -> None:
    """Count the times at an end: of the stated range, or two equal samples at an extreme since the last report, after a leap."""
    lowest, highest, step, times = m.lowest[channel], m.highest[channel], m.step[channel], m.at_end[channel]
    for i in range(1, values.shape[0]):
        value, change = float(values[i]), math.fabs(float(values[i]) - float(values[i - 1]))
        if change > 0.0 and (step == 0.0 or change < step):
            step = change
        if value < lowest or value > highest:
            lowest, highest, times = min(lowest, value), max(highest, value), 0
        at_extreme = i > 1 and change == 0.0 and value in (lowest, highest)
        is_flat = at_extreme and math.fabs(value - float(values[i - 2])) > _LEAP * step
        if is_flat or value <= m.range_low[channel] or value >= m.range_high[channel]:
            times += 1
    m.lowest[channel], m.highest[channel], m.step[channel], m.at_end[channel] = lowest, highest, step, times


@shared_kernel
def end(
    guard_params: Records,
    guard_state: Records,
    memory: Records,
    frequency_Hz: float,
    amplitude_m: float,
    commands: int,
    commands_late: int,
    round_trip_ns: int,
    late_ns: int,
    sensors: Records,
    applied: Records,
) -> None:
    """End the block that `begin` and `fill` made; arguments as in `report`."""
    m: DeviceMemory = memory[0]
    report(
        guard_params[0], guard_state[0], frequency_Hz, amplitude_m, m.command_block, commands, commands_late, round_trip_ns,
        late_ns, sensors[0], applied[0],
    )  # fmt: skip
