"""One step of the controller: onset, policy, limits. The same function runs live, in lockstep and in replay."""

import math
from typing import Any

import numpy.typing as npt

from bridge.kernel import Record, kernel
from controller.codes import BLOCK
from controller.limits import allow
from controller.onset import contact, drive_velocity, fill_gap
from controller.policy import decide, want
from controller.vibration import burst, measure, skip


@kernel
def step(
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    sensors: npt.NDArray[Any],
    events: int,
    gap_blocks: int,
    t_ns: int,
    command: npt.NDArray[Any],
    trace: npt.NDArray[Any],
    scratch: npt.NDArray[Any],
) -> None:
    """Advance `state` by one frame, in place, and fill in `command` and `trace`.

    Args:
        params, state: one record each of `controller.records.PARAMS` and `STATE`.
        sensors: one sensor block; not read when `events` has no BLOCK.
        events: bits of `controller.codes`: BLOCK, GAP, STALE, STOP, RESET, ANNOUNCED.
        gap_blocks: number of lost blocks just before this block.
        t_ns: time of the frame.
        command, trace: one message record each; all is filled except the trace's lateness.
        scratch: float64 [samples], overwritten.

    """
    p: Record = params[0]
    s: Record = state[0]
    samples = p.samples_per_block
    force_N = 0.0
    usable = True
    if events & BLOCK:
        block: Record = sensors[0]
        s.block = block.sequence
        position_m = 0.0
        accel_mps2 = 0.0
        for i in range(samples):
            force_N += float(block.drive_force_N[i])
            position_m += float(block.drive_position_m[i])
            accel_mps2 += float(block.mass_accel_mps2[i]) + float(block.base_accel_mps2[i])
        force_N /= samples
        position_m /= samples
        # A sample of NaN or infinity would stay in the filters for ever, so its block counts as lost.
        usable = math.isfinite(force_N + position_m + accel_mps2)
        s.missing_blocks += gap_blocks if usable else gap_blocks + 1
        if usable:
            if s.missing_blocks > 0:
                fill_gap(p, s, s.missing_blocks, force_N, position_m)
                skip(p, s, s.missing_blocks)
                s.missing_blocks = 0
            measure(p, s, block.base_accel_mps2)
            drive_velocity(p, s, position_m)
            contact(p, s, force_N, burst(p, s, block.mass_accel_mps2, scratch))
            decide(p, s, t_ns, force_N)
            want(p, s)
    allow(p, s, events, s.wanted_Hz, s.wanted_m if usable else math.nan)

    c: Record = command[0]
    c.sequence = s.steps
    c.t_ns = t_ns
    c.block = s.block
    c.frequency_Hz = s.allowed_Hz
    c.amplitude_m = s.allowed_m
    c.mode = s.mode
    c.limit = s.limit
    c.reason = s.reason

    t: Record = trace[0]
    t.sequence = s.steps
    t.t_ns = t_ns
    t.block = s.block
    t.events = events
    t.gap_blocks = gap_blocks
    t.state = s.contact
    t.mode = s.mode
    t.reason = s.reason
    t.limit = s.limit
    t.slips = s.slips
    t.score = s.score
    t.force_rate = s.force_rate
    t.drive_force_N = force_N
    t.burst_mps2 = s.burst_mps2
    t.drive_velocity_mps = s.drive_velocity_mps
    t.vibration_velocity_mps = s.vibration_velocity_mps
    t.wanted_velocity_mps = s.wanted_velocity_mps
    t.wanted_amplitude_m = s.wanted_m
    t.wanted_frequency_Hz = s.wanted_Hz
    t.time_to_slip_s = s.time_to_slip_s
    t.announcements = s.announced_count
    s.steps += 1
