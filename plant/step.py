"""One block of the rig at its interface: a command in, a sensor block and a message of the applied vibration out."""

from typing import Any

import numpy.typing as npt

from bridge.guard.check import write_gain
from bridge.guard.core import allow, look
from bridge.kernel import Record, kernel, shared_kernel
from plant.core import advance, advance_disturbed
from plant.loop_delay import receive, send
from plant.sensors import digitise


@shared_kernel
def act(
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    guard_params: npt.NDArray[Any],
    guard_state: npt.NDArray[Any],
    drive_velocity_mps: float,
    command: npt.NDArray[Any],
    commands: int,
    delay_blocks: int,
    noise: npt.NDArray[Any],
    analogue: npt.NDArray[Any],
    truth: npt.NDArray[Any],
    sensors: npt.NDArray[Any],
) -> None:
    """Advance `state` by one block, in place, up to the samples of its sensors; arguments as in `step`."""
    p: Record = params[0]
    s: Record = state[0]
    if commands > 0:
        send(s, command[0], delay_blocks)
    receive(s)
    g: Record = guard_state[0]
    allow(guard_params[0], g, s.command_block, s.commanded_Hz, s.commanded_m)
    if p.disturbed:
        advance_disturbed(params, state, drive_velocity_mps, g.frequency_Hz, g.amplitude_m, analogue, truth)
    else:
        advance(params, state, drive_velocity_mps, g.frequency_Hz, g.amplitude_m, analogue, truth)
    block: Record = sensors[0]
    block.sequence = s.block
    block.t_ns = (s.block + 1) * p.block_ns
    digitise(p, analogue, noise, block)


@shared_kernel
def report(
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    guard_params: npt.NDArray[Any],
    guard_state: npt.NDArray[Any],
    commands: int,
    commands_late: int,
    round_trip_ns: int,
    late_ns: int,
    sensors: npt.NDArray[Any],
    applied: npt.NDArray[Any],
) -> None:
    """Pass the samples to the guard, and end the block that `act` began: fill in the applied vibration."""
    p: Record = params[0]
    s: Record = state[0]
    gp: Record = guard_params[0]
    g: Record = guard_state[0]
    block: Record = sensors[0]
    look(gp, g, block)
    block.run = gp.run
    block.guard_state = g.state
    write_gain(gp, g, block)
    a: Record = applied[0]
    a.sequence = s.block
    a.t_ns = (s.block + 1) * p.block_ns
    a.frequency_Hz = s.frequency_Hz
    a.amplitude_m = s.amplitude_m
    a.command_block = s.command_block
    a.commands = commands
    a.fallback = 1 - g.fresh
    a.round_trip_ns = round_trip_ns
    a.late_ns = late_ns
    a.commands_late = commands_late
    a.guard_state = g.state
    a.cause = g.cause
    a.guard_limit = g.limit
    a.commands_refused = g.refused
    g.refused = 0
    a.heat_share = g.heat
    s.block += 1


@kernel
def step(
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    guard_params: npt.NDArray[Any],
    guard_state: npt.NDArray[Any],
    drive_velocity_mps: float,
    command: npt.NDArray[Any],
    commands: int,
    delay_blocks: int,
    noise: npt.NDArray[Any],
    commands_late: int,
    round_trip_ns: int,
    late_ns: int,
    analogue: npt.NDArray[Any],
    truth: npt.NDArray[Any],
    sensors: npt.NDArray[Any],
    applied: npt.NDArray[Any],
) -> None:
    """Advance `state` by one block, in place, and fill in `sensors` and `applied`.

    Args:
        params, state: one record each of `plant.records.PARAMS` and `STATE`.
        guard_params, guard_state: one record each of `bridge.guard.records`; the guard has accepted `command`.
        drive_velocity_mps: held over the block.
        command, commands: the newest command, and the number of commands since the last block; at 0 `command` is not read.
        delay_blocks: blocks that this command takes to the exciter besides.
        noise: standard normal numbers, float64 [5, samples].
        commands_late, round_trip_ns, late_ns: copied to `applied`.
        analogue, truth: filled, as in `plant.core.advance`.
        sensors, applied: one message record each, filled.

    """
    act(
        params, state, guard_params, guard_state, drive_velocity_mps, command, commands, delay_blocks, noise,
        analogue, truth, sensors,
    )  # fmt: skip
    report(params, state, guard_params, guard_state, commands, commands_late, round_trip_ns, late_ns, sensors, applied)
