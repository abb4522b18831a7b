"""One block of the rig at its interface: a command in, a sensor block and a message of the applied vibration out."""

from bridge.arrays import Floats, Records
from bridge.guard.core import allow
from bridge.kernel import shared_kernel
from bridge.layouts import GuardMemory, GuardParams, PlantMemory, PlantParams, SensorRow
from bridge.rig.step import hear
from bridge.rig.step import report as report_block
from plant.core import advance, advance_disturbed
from plant.loop_delay import receive, send
from plant.sensors import digitise


@shared_kernel
def act(
    params: Records,
    state: Records,
    guard_params: Records,
    guard_state: Records,
    drive_velocity_mps: float,
    commands: Records,
    delay_blocks: int,
    announce: Records,
    noise: Floats,
    analogue: Floats,
    truth: Floats,
    sensors: Records,
) -> int:
    """Advance `state` by one block, in place, up to the samples of its sensors; return the number of accepted commands.

    Args:
        params, state: one record each of `plant.records.PARAMS` and `STATE`.
        guard_params, guard_state: one record each of `bridge.guard.records`.
        drive_velocity_mps: velocity of the drive, held over the block.
        commands: commands received since the last block; the newest that the guard accepts goes to the exciter.
        delay_blocks: additional delay of this command on its way to the exciter.
        announce: the rig's announcements before these samples.
        noise: standard normal numbers, float64 [5, samples].
        analogue, truth: filled, as in `plant.core.advance`.
        sensors: one message record, filled up to the fields of the guard.

    """
    p: PlantParams = params[0]
    s: PlantMemory = state[0]
    gp: GuardParams = guard_params[0]
    g: GuardMemory = guard_state[0]
    accepted, newest = hear(gp, g, commands, announce)
    if accepted > 0:
        send(s, commands[newest], delay_blocks)
    receive(s)
    allow(gp, g, s.command_block, s.commanded_Hz, s.commanded_m)
    amplitude_m = g.amplitude_m if g.enable == 1 or p.always_on != 0.0 else 0.0
    vibrate(params, state, drive_velocity_mps, g.frequency_Hz, amplitude_m, noise, analogue, truth, sensors)
    return accepted


@shared_kernel
def vibrate(
    params: Records,
    state: Records,
    drive_velocity_mps: float,
    frequency_Hz: float,
    amplitude_m: float,
    noise: Floats,
    analogue: Floats,
    truth: Floats,
    sensors: Records,
) -> None:
    """Advance the physics by one block under a vibration; fill number, time and samples of `sensors`. Arguments as in `act`."""
    p: PlantParams = params[0]
    s: PlantMemory = state[0]
    if p.disturbed:
        advance_disturbed(params, state, drive_velocity_mps, frequency_Hz, amplitude_m, analogue, truth)
    else:
        advance(params, state, drive_velocity_mps, frequency_Hz, amplitude_m, analogue, truth)
    block: SensorRow = sensors[0]
    block.sequence = s.block
    block.t_ns = (s.block + 1) * p.block_ns
    digitise(p, analogue, noise, block)


@shared_kernel
def report(
    state: Records,
    guard_params: Records,
    guard_state: Records,
    commands: int,
    commands_late: int,
    round_trip_ns: int,
    late_ns: int,
    sensors: Records,
    applied: Records,
) -> None:
    """Pass the samples to the guard, and end the block that `act` began: fill in the applied vibration.

    Args:
        state, guard_params, guard_state, sensors: as in `act`.
        commands: number of accepted commands.
        commands_late, round_trip_ns, late_ns: copied to `applied`.
        applied: one message record, filled.

    """
    s: PlantMemory = state[0]
    report_block(
        guard_params[0], guard_state[0], s.frequency_Hz, s.amplitude_m, s.command_block, commands, commands_late,
        round_trip_ns, late_ns, sensors[0], applied[0],
    )  # fmt: skip
    s.block += 1
