"""One step of the controller: estimate, policy, amplitude, limits. The same function runs live, in lockstep and in replay."""

import math

from bridge.arrays import Records
from bridge.kernel import kernel, shared_kernel
from bridge.layouts import CommandRow, ControllerMemory, ControllerParams, SensorRow, TraceRow
from bridge.wire.messages import BLOCK, LATE
from controller.amplitude import FIRST_SHARE, amplitude, listen, note_sent
from controller.estimate.compliance import begin_spring, learn_compliance, spring_force
from controller.estimate.contact import contact
from controller.estimate.friction import forces
from controller.estimate.motion import drive_velocity
from controller.estimate.spikes import find_spikes, learn_bends, sum_without
from controller.estimate.windows import BINS, DRIVE, FORCE, MOST_FRESH, SLIDE, clear_windows, note_steps, push
from controller.in_force import is_judged, note_in_force
from controller.limits import allow
from controller.policy.decide import decide
from controller.policy.fall import note_fall
from controller.policy.need import way_of
from controller.policy.reason import reason_of
from controller.policy.trial import FIRST_RANDOM
from controller.trips.band import begin_known, note_check
from controller.trips.doubts import end_trips
from controller.trips.watch import restrain, watch
from controller.vibration import measure, skip

_STEPS_LOOK = 16  # steps between two measurements of resolution and noise of the samples
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
    end_trips(p, s, events)
    note_in_force(p, s, events, gap_blocks, sensors[0])
    force_N = 0.0
    usable = True
    if events & BLOCK:
        block: SensorRow = sensors[0]
        s.block = block.sequence
        s.run, s.guard_state = block.run, block.guard_state
        note_check(p, s, float(block.check_Hz), float(block.check_gain))
        usable = find_spikes(p, s, block)
        s.missing_blocks += gap_blocks if usable else gap_blocks + 1
        if usable:
            if s.missing_blocks > 0:
                _bridge(p, s, block)
                skip(p, s, s.missing_blocks)
                s.missing_blocks = 0
            measure(p, s, block.base_accel_mps2)
            listen(p, s, events & LATE != 0)
            force_N = _look(p, s, block)
            if not is_judged(s):
                s.even_steps = 0  # soon after an interruption v_a does not follow the commands
            watch(p, s, block)
            decide(p, s, t_ns, force_N, p.block_s)
            restrain(p, s)
            amplitude(p, s)
    allow(p, s, events, s.wanted_Hz, s.wanted_m if usable else math.nan)
    note_sent(p, s)

    c: CommandRow = command[0]
    c.sequence = s.steps
    c.t_ns = t_ns
    c.block = s.block
    c.frequency_Hz = s.allowed_Hz
    c.amplitude_m = s.allowed_m
    c.mode = s.mode
    c.limit = s.limit
    c.reason = reason_of(s)
    c.run = s.run

    t: TraceRow = trace[0]
    t.sequence = s.steps
    t.t_ns = t_ns
    t.block = s.block
    t.events = events
    t.gap_blocks = gap_blocks
    t.state = s.contact
    t.mode = s.mode
    t.reason = c.reason
    t.limit = s.limit
    t.slips = s.slips
    t.score = 0.0
    t.force_rate = s.force_rate
    t.drive_force_N = force_N if p.use_force == 1 or s.compliance_m_per_N > 0.0 else 0.0
    t.burst_mps2 = 0.0
    t.drive_velocity_mps = s.drive_velocity_mps
    t.vibration_velocity_mps = s.vibration_velocity_mps
    t.wanted_velocity_mps = s.wanted_velocity_mps
    t.wanted_amplitude_m = s.wanted_m
    t.wanted_frequency_Hz = s.wanted_Hz
    t.time_to_slip_s = s.time_to_slip_s
    way = way_of(s)
    t.surges = s.surges
    t.sliding_velocity_mps = s.direction * s.sliding_mps
    t.window_s = s.window_s
    t.velocity_ratio = s.ratio_now
    known = s.compliance_m_per_N > 0.0 and s.compliance_sigma < s.compliance_m_per_N
    t.drive_stiffness_N_per_m = 1.0 / s.compliance_m_per_N if known else 0.0
    t.drive_stiffness_sigma = s.compliance_sigma / s.compliance_m_per_N if known else 1.0
    t.breakaway_force_N = s.breakaway_N[way]
    t.sliding_force_N = s.sliding_N[way]
    t.loop_delay_s = max(s.loop_delay_steps, 0) * p.block_s
    t.exciter_gain = math.exp(s.log_gain[s.candidate])
    t.announcements = s.announced_count
    s.steps += 1


@kernel
def _begin(p: ControllerParams, s: ControllerMemory) -> None:
    """Set all memory whose initial value is not zero."""
    begin_spring(p, s)
    begin_known(p, s)
    s.followed, s.confirmed, s.went_m[:] = -1, 1.0, -1.0
    s.listening, s.onset_steps, s.loop_delay_steps = 1, -1, -1
    s.silent_steps = p.silence_steps  # the base counts as at rest, as no vibration was ever commanded
    s.level, s.swing_level = -1, -1
    s.growth, s.quiet_s, s.settled_s, s.slipped_s = FIRST_SHARE, math.inf, math.inf, math.inf
    s.demodulated_Hz, s.random = 0.0, FIRST_RANDOM
    s.tail[:, :], s.spike_at[:] = math.nan, -1
    for way in range(2):
        s.ratio[way] = p.v_ratio


@kernel
def _mean(
    p: ControllerParams, s: ControllerMemory, block: SensorRow, first: int, samples: int
) -> tuple[float, float, float]:
    """Means of force [N], slide and drive position [m] over some samples; without a force sensor, the spring's force."""
    force_N, slide_m, drive_m = 0.0, 0.0, 0.0
    for i in range(first, first + samples):
        drive_m += float(block.drive_position_m[i])
        if p.use_force == 1:
            force_N += float(block.drive_force_N[i])
        if p.use_slide_position == 1:
            slide_m += float(block.mass_position_m[i])
    if s.spiked == 1:
        drive_m = sum_without(s, DRIVE, block.drive_position_m, first, samples)
        force_N = sum_without(s, FORCE, block.drive_force_N, first, samples) if p.use_force == 1 else 0.0
        slide_m = sum_without(s, SLIDE, block.mass_position_m, first, samples) if p.use_slide_position == 1 else 0.0
    force_N, slide_m, drive_m = force_N / samples, slide_m / samples, drive_m / samples
    if p.use_force == 0:
        force_N = spring_force(s, drive_m - slide_m)
    return force_N, slide_m, drive_m


@kernel
def _bridge(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> None:
    """Fill the windows with a straight line over lost blocks; empty them after too many lost blocks."""
    bins = s.missing_blocks * (p.samples_per_block // p.bin_samples)
    if bins > _MOST_BRIDGED_BINS or s.pushed[0] < BINS:
        clear_windows(s)
        return
    # from the mean of the last window to the mean of as many samples, as the noise of single samples would bend the windows
    force_N, slide_m, drive_m = 0.0, 0.0, 0.0
    for i in range(BINS):
        force_N += s.bins[FORCE, 0, i] / BINS
        slide_m += s.bins[SLIDE, 0, i] / BINS
        drive_m += s.bins[DRIVE, 0, i] / BINS
    samples = min(BINS * p.bin_samples, p.samples_per_block)
    next_N, next_slide_m, next_drive_m = _mean(p, s, block, 0, samples)
    apart = bins + 0.5 * BINS + 0.5 * samples / p.bin_samples
    for i in range(bins):
        share = (i + 0.5 + 0.5 * BINS) / apart
        s.fresh[FORCE, 0] = force_N + share * (next_N - force_N)
        s.fresh[SLIDE, 0] = slide_m + share * (next_slide_m - slide_m)
        s.fresh[DRIVE, 0] = drive_m + share * (next_drive_m - drive_m)
        push(p, s, 1, False)


@kernel
def _look(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> float:
    """Estimate motion and contact, tick by tick; return the mean force of the block [N]."""
    if s.steps % _STEPS_LOOK == 0:
        note_steps(s, FORCE, block.drive_force_N)
        note_steps(s, SLIDE, block.mass_position_m)
        note_steps(s, DRIVE, block.drive_position_m)
        learn_bends(p, s, s.steps // _STEPS_LOOK, block)
    tick_s = p.bins_per_tick * p.bin_s
    total_N, at = 0.0, 0
    slip_began, stick_began = 0, 0
    for _ in range(p.ticks_per_block):
        tick_N, fresh = 0.0, 0
        for i in range(p.bins_per_tick):
            force_N, slide_m, drive_m = _mean(p, s, block, at, p.bin_samples)
            at += p.bin_samples
            s.fresh[FORCE, fresh], s.fresh[SLIDE, fresh], s.fresh[DRIVE, fresh] = force_N, slide_m, drive_m
            fresh += 1
            tick_N += force_N
            note_fall(p, s, force_N)
            if fresh == MOST_FRESH or i == p.bins_per_tick - 1:
                push(p, s, fresh, True)
                fresh = 0
        tick_N /= p.bins_per_tick
        total_N += tick_N
        drive_velocity(p, s, tick_s)
        contact(p, s, tick_N, tick_s)
        learn_compliance(p, s, tick_s)
        forces(s, tick_N, tick_s)
        slip_began, stick_began = slip_began | s.slip_began, stick_began | s.stick_began
    s.slip_began, s.stick_began = slip_began, stick_began
    return total_N / p.ticks_per_block
