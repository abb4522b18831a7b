"""One step of the controller: estimate, policy, amplitude, limits. The same function runs live, in lockstep and in replay."""

import math

from bridge.arrays import Records
from bridge.kernel import kernel, shared_kernel
from bridge.layouts import CommandRow, ControllerMemory, ControllerParams, SensorRow, TraceRow
from bridge.wire.messages import BLOCK
from controller.estimate.channels import bin_means, is_usable, means, note_resolution, watch_channels
from controller.estimate.compliance import learn_compliance, spring_force
from controller.estimate.contact import contact
from controller.estimate.motion import drive_velocity
from controller.estimate.windows import BINS, DRIVE, FORCE, MOST_FRESH, ROWS, SLIDE, clear_windows, push
from controller.exciter import begin_gain, listen, note_applied, note_check, restart_gain, stroke
from controller.in_force import note_in_force
from controller.limits import allow
from controller.policy.decide import decide
from controller.policy.reason import reason_of
from controller.policy.trial import note_fall
from controller.trips.reset import begin_motion, begin_policy, end_trips
from controller.trips.watch import restrain, watch
from controller.vibration import measure, skip

_MOST_BRIDGED_BINS = 640  # most lost bins that a line replaces: after 64 ms the longer windows still know v_d


@shared_kernel
def step(
    params: Records,
    state: Records,
    sensors: Records,
    events: int,
    gap_blocks: int,
    t_ns: int,
    command: Records,
    trace: Records,
) -> None:
    """Advance `state` by one frame, in place, and fill in `command` and `trace`.

    Args:
        params, state: one record each of `controller.records.PARAMS` and `STATE`.
        sensors: one sensor block; not read when `events` has no BLOCK.
        events: bits of `bridge.wire.messages`: BLOCK, GAP, STALE, STOP, RESET, ANNOUNCED, LATE.
        gap_blocks: number of lost blocks just before this block.
        t_ns: time of the frame.
        command, trace: one message record each; all fields are set except the trace's lateness.

    """
    p: ControllerParams = params[0]
    s: ControllerMemory = state[0]
    if s.steps == 0:
        _begin(p, s)
    end_trips(p, s, state, events)
    restart_gain(p, s, events)
    note_in_force(p, s, events, sensors[0])
    force_N = 0.0
    usable = True
    if events & BLOCK:
        block: SensorRow = sensors[0]
        s.block = block.sequence
        s.run, s.guard_state = block.run, block.guard_state
        note_check(p, s, block)
        note_applied(p, s, block)
        usable = is_usable(p, s, block)
        s.missing_blocks += gap_blocks if usable else gap_blocks + 1
        if usable:
            if s.missing_blocks > 0:
                _bridge(p, s, block)
                skip(p, s, s.missing_blocks)
                s.missing_blocks = 0
            measure(p, s, block.base_accel_mps2)
            listen(p, s)
            force_N = _look(p, s, block)
            watch_channels(p, s)
            watch(p, s)
            decide(p, s, t_ns, force_N)
            restrain(s)
            stroke(p, s)
    allow(p, s, events, p.frequency_Hz, s.wanted_m if usable else math.nan)
    s.silent_s = s.silent_s + p.block_s if s.allowed_m == 0.0 else 0.0

    c: CommandRow = command[0]
    c.sequence, c.t_ns, c.block, c.run = s.steps, t_ns, s.block, s.run
    c.frequency_Hz, c.amplitude_m = s.allowed_Hz, s.allowed_m
    c.mode, c.limit, c.reason = s.mode, s.limit, reason_of(s)

    t: TraceRow = trace[0]
    t.sequence, t.t_ns, t.block, t.events, t.gap_blocks = s.steps, t_ns, s.block, events, gap_blocks
    t.state, t.mode, t.reason, t.limit = s.contact, s.mode, c.reason, s.limit
    t.slips, t.surges, t.announcements = s.slips, s.surges, s.announced_count
    t.force_rate, t.window_s, t.time_to_slip_s = s.force_rate, s.window_s, s.time_to_slip_s
    t.drive_force_N = force_N if p.use_force == 1 or s.compliance_m_per_N > 0.0 else 0.0
    t.drive_velocity_mps, t.sliding_velocity_mps = s.drive_velocity_mps, s.direction * s.sliding_mps
    t.vibration_velocity_mps, t.wanted_velocity_mps = s.vibration_velocity_mps, s.wanted_velocity_mps
    t.velocity_ratio, t.wanted_amplitude_m, t.wanted_frequency_Hz = s.ratio_now, s.wanted_m, p.frequency_Hz
    known = s.compliance_m_per_N > 0.0 and s.compliance_sigma < s.compliance_m_per_N
    t.drive_stiffness_N_per_m = 1.0 / s.compliance_m_per_N if known else 0.0
    t.drive_stiffness_sigma = s.compliance_sigma / s.compliance_m_per_N if known else 1.0
    t.breakaway_force_N = s.breakaway_N[0 if s.direction > 0 else 1]
    t.loop_delay_s, t.exciter_gain = s.loop_delay_steps * p.block_s, s.gain
    s.steps += 1


@kernel
def _begin(p: ControllerParams, s: ControllerMemory) -> None:
    """Set all memory whose initial value is not zero."""
    begin_motion(p, s)
    begin_policy(p, s)
    begin_gain(p, s)
    s.in_force_s, s.silent_s = math.inf, math.inf


@kernel
def _bridge(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> None:
    """Fill the windows with a straight line over lost blocks; empty them after too many lost blocks."""
    bins = s.missing_blocks * (p.samples_per_block // p.bin_samples)
    if bins > _MOST_BRIDGED_BINS or s.pushed[0] < BINS:
        clear_windows(s)
        return
    # from the mean of the last window to the mean of as many samples, as the noise of single samples would bend the windows
    samples = min(BINS * p.bin_samples, p.samples_per_block)
    apart = bins + 0.5 * BINS + 0.5 * samples / p.bin_samples
    means(p, s, block, 0, samples, 1)
    if p.use_force == 0:
        s.fresh[FORCE, 1] = spring_force(s, s.fresh[DRIVE, 1] - s.fresh[SLIDE, 1])
    for row in range(ROWS):
        s.last[row] = 0.25 * (s.bins[row, 0, 0] + s.bins[row, 0, 1] + s.bins[row, 0, 2] + s.bins[row, 0, 3])
        s.rate[row] = (s.fresh[row, 1] - s.last[row]) / apart
        s.last[row] += 0.5 * (BINS - 1) * s.rate[row]
    for _ in range(bins):
        for row in range(ROWS):
            s.last[row] += s.rate[row]
            s.fresh[row, 0] = s.last[row]
        push(p, s, 1, False)


@kernel
def _look(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> float:
    """Estimate motion and contact, tick by tick; return the mean force of the block [N]."""
    note_resolution(s, FORCE, block.drive_force_N)
    note_resolution(s, SLIDE, block.mass_position_m)
    note_resolution(s, DRIVE, block.drive_position_m)
    tick_s = p.bins_per_tick * p.bin_s
    total_N, at = 0.0, 0
    slip_began, stick_began = 0, 0
    for _ in range(p.ticks_per_block):
        tick_N, left = 0.0, p.bins_per_tick
        while left > 0:
            bins = min(left, MOST_FRESH)
            bin_means(p, s, block, at, bins)
            for i in range(bins):
                tick_N += s.fresh[FORCE, i]
                note_fall(p, s, s.fresh[FORCE, i])
            push(p, s, bins, True)
            at, left = at + bins * p.bin_samples, left - bins
        tick_N /= p.bins_per_tick
        total_N += tick_N
        drive_velocity(p, s, tick_s)
        contact(p, s, tick_N, tick_s)
        learn_compliance(p, s, tick_s)
        slip_began, stick_began = slip_began | s.slip_began, stick_began | s.stick_began
    s.slip_began, s.stick_began = slip_began, stick_began
    return total_N / p.ticks_per_block
