"""The derived numbers of a controller, and all of its memory. A memory of zeros is a controller at its start."""

import hashlib
import math
from typing import Any

import numpy as np

from bridge.arrays import Records
from bridge.kernel import record
from controller.amplitude import LEARN_S, LOUD_S, MOST_DELAY_S, SETTLE_S, SILENCE_S, SLOTS, TAIL
from controller.announced import MOST_ANNOUNCED
from controller.config import (
    MODES,
    MOST_BANDS,
    MOST_CANDIDATES,
    ControllerConfig,
    candidate_frequencies_Hz,
    forbidden_bands_Hz,
)
from controller.estimate.spikes import BENDS
from controller.estimate.windows import BINS, LEVELS, MOST_FRESH, ROWS
from controller.in_force import REMEMBERED
from controller.trips import band, confirmed, delivered, doubts, frozen, spring

_BIN_S = 1e-4  # longest bin; one sample if samples are longer: four bins resolve the slips of a drive of 50 N/um
_TICK_S = 1e-3  # longest period of the estimate of motion and contact; a longer block holds several periods
_LONGEST_WINDOW_S = 3.3  # drift makes longer windows useless; a feed of 0.5 um/s exceeds 0.5 um of noise in 0.1 s


def _divisor(count: int, wanted: float) -> int:
    """The largest divisor of `count` up to `wanted`, at least 1."""
    return max(n for n in range(1, count + 1) if count % n == 0 and (n <= wanted * (1.0 + 1e-9) or n == 1))


_PARAMS_FLOATS = (
    *("block_s", "sample_s", "bin_s", "spike_bends", "drive_stiffness_N_per_m", "least_feed_mps"),
    *("trial_every_s", "least_ratio", "most_ratio"),
    *("filter_share", "learn_share", "accel_bandwidth_Hz", "accel_range_mps2"),
    *("gain_band", "gain_floor", "told_gain", "follow_share", "travel_low_m", "travel_high_m"),
    *("v_ratio", "amplitude_max_m", "velocity_max_mps", "slew_m_per_step", "frequency_min_Hz", "frequency_max_Hz"),
)
_PARAMS_INTS = (
    *(
        "samples_per_block",
        "bin_samples",
        "bins_per_tick",
        "ticks_per_block",
        "levels",
    ),
    *("use_force", "use_slide_position", "mode", "enabled_from_ns", "candidates", "bands"),
    *("silence_steps", "settle_steps", "loud_steps", "slot_steps", "slots"),
    *(
        "known_steps",
        "low_steps",
        "high_steps",
        "passed_steps",
        "frozen_steps",
        "spring_level",
        "broken_steps",
        "first_steps",
        "confirm_level",
        "grown_steps",
    ),
)
PARAMS = np.dtype(
    [(name, "f8") for name in _PARAMS_FLOATS]
    + [(name, "i8") for name in _PARAMS_INTS]
    + [("window_s", "f8", (LEVELS,)), ("candidate_Hz", "f8", (MOST_CANDIDATES,)), ("band_Hz", "f8", (MOST_BANDS, 2))],
    align=True,
)

_WAYS = 2  # directions of the drive, forwards and backwards: entries of a value that is learnt for each direction
STATE = np.dtype(
    [
        # windows; the rows are FORCE [N], SLIDE [m] and DRIVE [m]
        ("bins", "f8", (ROWS, LEVELS, BINS)),
        ("fresh", "f8", (ROWS, MOST_FRESH)),  # means of the bins that are added next
        ("slope", "f8", (ROWS, LEVELS)),
        ("slope_before", "f8", (ROWS, LEVELS, 2)),  # slopes of the last window, and of the window before it
        ("sigma", "f8", (ROWS, LEVELS)),  # measured noise of a slope
        # noise of a slope: sigma, extrapolated from a shorter window until it is measured, and quantisation; 0: unknown
        ("noise", "f8", (ROWS, LEVELS)),
        ("law_mps", "f8", (LEVELS,)),  # sigma of the slope of x_s + F / k_d - x_d, which is 0 without noise
        ("agreements", "i8", (LEVELS,)),  # number of slope differences from which law_mps was learnt
        ("pushed", "i8", (LEVELS,)),  # number of bins since the windows were last emptied
        ("differences", "i8", (LEVELS,)),  # number of slope differences from which sigma was learnt
        ("resolution", "f8", (ROWS,)),  # quantisation step of a sample; 0: unknown
        # spikes: single samples far from their neighbours
        ("bends", "f8", (ROWS,)),  # mean second difference of the samples; 0: unknown
        ("most_bend", "f8", (ROWS,)),  # second difference above which a sample is a spike
        ("tail", "f8", (ROWS, 2)),  # last two samples of the block before; NaN: unknown
        ("spiked", "i8"),  # whether any channel has a spike in this block
        ("spike_at", "i8", (ROWS,)),  # sample of the spike; -1: no spike
        ("spike", "f8", (ROWS,)),  # value that replaces the spike
        ("spike_step", "i8", (ROWS,)),  # number of the controller's step with the last spike
        # motion
        ("drive_velocity_mps", "f8"),
        ("drive_velocity_sigma_mps", "f8"),
        ("held_mps", "f8"),  # |v_d| whose rises count at once and whose falls with a time constant of 0.1 s
        ("rising_mps", "f8"),  # |v_d| at the end of its windows while it grows, with a margin for noise
        ("late_mps", "f8"),  # least |v_s| in EXCITE since v_d last changed; infinite at a constant v_d
        ("steady_mps", "f8"),  # |v_d| after its last change by 4 % or more
        ("steady_s", "f8"),  # time since that change
        ("moved_s", "f8"),  # time since the drive started or turned; 0 at rest
        ("stood_s", "f8"),
        ("rested", "i8"),  # 1 if the slide must have been at rest when the drive started or turned
        ("measured", "i8"),
        ("moving", "i8"),
        ("direction", "i8"),
        # contact
        ("contact", "i8"),  # ContactState
        ("level", "i8"),  # level of the shortest windows that resolve a stick at the present v_d; -1: no level
        ("window_s", "f8"),
        ("sliding_mps", "f8"),  # velocity of the slide along the drive's direction
        ("fine_mps", "f8"),  # sliding_mps over a longer window with less noise
        ("fine_sigma_mps", "f8"),
        ("force_rate", "f8"),
        ("stick_s", "f8"),
        ("since_stick_s", "f8"),
        ("smooth_s", "f8"),
        ("expected_stick_s", "f8"),
        ("unseen_s", "f8"),
        ("time_to_slip_s", "f8"),
        ("blind", "i8"),
        ("slipping", "i8"),
        ("slipped_s", "f8"),  # time since the last slip ended
        ("slip_window_s", "f8"),  # window that showed its end
        ("slip_began", "i8"),  # 1 if a slip began in this step
        ("stick_began", "i8"),
        ("slips", "i8"),
        ("surges", "i8"),
        # learnt values of the axis
        ("compliance_m_per_N", "f8"),  # 1 / k_d
        ("compliance_sigma", "f8"),  # [m/N]; infinite while k_d is unknown
        ("stiffness_learnt", "i8"),  # 1 once c is known from windows within 20 %
        ("shown", "f8"),  # sums over the windows that show c: weight, weight c, weight (c - mean)^2, number
        ("shown_c", "f8"),
        ("shown_square", "f8"),
        ("shown_windows", "f8"),
        ("relaxed_m", "f8"),  # elongation of the relaxed spring, for a rig without a force sensor
        ("shortest_m", "f8"),
        ("longest_m", "f8"),
        ("stretched", "i8"),  # 1 once these elongations are known
        ("dragged", "i8", (_WAYS,)),  # 1 once the slide slid in this direction
        ("peak_N", "f8"),  # highest force of this stick, along the motion
        ("slip_from_N", "f8"),  # highest force before the last slip without vibration; 0 once the next stick began
        ("swing_N", "f8", (_WAYS,)),  # fall of the force in a slip
        ("breakaway_N", "f8", (_WAYS,)),
        ("sliding_N", "f8", (_WAYS,)),
        # vibration
        ("phase_rad", "f8"),
        ("in_phase_mps2", "f8"),
        ("quadrature_mps2", "f8"),
        ("vibration_velocity_mps", "f8"),
        ("fast_mps", "f8"),  # v_a of the last block alone
        ("demodulated_Hz", "f8"),
        # policy
        ("mode", "i8"),
        ("mode_s", "f8"),
        ("calm_s", "f8"),  # duration of smooth sliding under vibration since the last stick or slip in it
        ("waiting_s", "f8"),
        ("swing", "f8"),  # relative swing of friction under vibration; decays
        ("even_s", "f8"),  # time in this mode for which v_s stayed within 10 % of v_d
        ("why", "i8"),  # Reason of the present vibration
        ("fade", "f8"),  # v_a / v_d of a trial that begins
        ("fade_per_s", "f8"),
        ("untried_s", "f8", (_WAYS,)),  # vibrated time of motion since the last result of a trial
        ("tried_s", "f8", (_WAYS,)),  # time without vibration in the present trial
        ("compares", "i8"),  # 1: the trial shows whether the vibration helps
        ("random", "i8"),  # of the times between trials
        (
            "crest_N",
            "f8",
        ),  # largest force along the motion in the present window of `controller.policy.fall`, and in the last
        ("crest_before_N", "f8"),
        ("fall_N", "f8"),  # largest fall below the crest in the present window
        ("fall_s", "f8"),
        ("fall_with_N", "f8", (_WAYS,)),  # largest fall with vibration, decays
        ("crest_with_N", "f8", (_WAYS,)),
        ("fall_without_N", "f8"),  # largest fall in a trial that compares
        ("lead", "f8"),  # share of v_d by which the slide is ahead because the ratio rose; decays
        ("swing_level", "i8"),  # level of the windows in which the swing of v_s is measured; -1: no level
        ("wound", "i8"),  # whether the spring was wound up when this move began
        ("slid_N", "f8", (_WAYS,)),  # force of the spring when the vibrated slide last followed v_d
        ("top", "f8"),  # largest share of v_d by which the slide was ahead; decays; -1: not known yet
        ("failed", "i8"),  # number of slips or surges that more vibration could not have prevented
        ("failed_left_s", "f8"),  # time until `failed` restarts from 0
        ("off_s", "f8", (_WAYS,)),
        ("off_left_s", "f8", (_WAYS,)),
        ("ratio", "f8", (_WAYS,)),  # set point of v_a / v_d
        ("edge_ratio", "f8", (_WAYS,)),  # largest ratio that was too small; 0: unknown
        ("edge_held_s", "f8", (_WAYS,)),
        ("proven", "i8", (_WAYS,)),  # 1 if a slip or surge was counted since the ratio last fell
        ("needed_to_mps", "f8", (_WAYS,)),
        ("needless_from_mps", "f8", (_WAYS,)),
        ("ratio_now", "f8"),
        ("wanted_speed_mps", "f8"),
        ("wanted_velocity_mps", "f8"),
        ("wanted_Hz", "f8"),
        ("candidate", "i8"),
        ("tuned", "i8"),
        # amplitude
        ("wanted_m", "f8"),
        ("log_gain", "f8", (MOST_CANDIDATES,)),  # natural logarithm of delivered over commanded v_a
        ("gain_known", "i8", (MOST_CANDIDATES,)),
        ("growth", "f8"),
        ("sent_m", "f8", (REMEMBERED,)),
        ("least_sent_mps", "f8", (SLOTS,)),  # extremes of the commanded v_a over slot_steps
        ("most_sent_mps", "f8", (SLOTS,)),
        ("most_wanted_mps", "f8", (SLOTS,)),
        ("expected_mps", "f8"),
        ("noise_mps", "f8"),  # mean v_a that is measured with the base at rest
        ("noise_steps", "i8"),  # number of steps in this mean
        ("silent_steps", "i8"),
        ("listening", "i8"),
        ("onset_steps", "i8"),
        ("heard_steps", "i8"),
        ("loud_steps", "i8"),
        ("cut_steps", "i8"),
        ("loop_delay_steps", "i8"),  # -1 while unknown
        ("at_limit", "i8"),
        ("weak_s", "f8"),  # time for which the piezo was too weak; negative: for which it was not
        # trips
        ("trip", "i8"),  # Reason of the reported trip; 0: no trip
        ("doubted", "i8"),  # bits of `controller.trips.doubts`
        ("known_gain", "f8", (MOST_CANDIDATES,)),  # delivered over commanded v_a, from which faults are detected
        ("accepted_gain", "f8", (MOST_CANDIDATES,)),  # `known_gain` before it followed a warm exciter; 0: it did not
        ("known_steps", "i8", (MOST_CANDIDATES,)),  # number of steps over which `known_gain` is averaged
        ("checked_blocks", "i8"),  # number of received blocks with a tone of the last loop check
        ("tone_Hz", "f8", (MOST_CANDIDATES, 2)),  # nearest tones of the check below and above a candidate; 0: no tone
        ("tone_gain", "f8", (MOST_CANDIDATES, 2)),  # delivered over commanded v_a at these tones
        ("gain_other_s", "f8"),  # time for which GAIN_OTHER is still reported
        ("banded", "i8"),  # whether the gain band limits the amplitude
        ("even_steps", "i8"),  # steps for which the expected v_a has been even
        ("followed", "i8"),  # candidate of `followed_gain`
        ("followed_gain", "f8"),  # measured gain, averaged over a second
        ("low_steps", "i8"),  # number of successive steps of too small a v_a
        ("high_steps", "i8"),  # successive steps of too large a v_a; negative: RESONANCE, for as many steps
        ("rest_mps2_2", "f8"),  # mean square of the base's acceleration minus its sine, over a second
        ("rest_steps", "i8"),  # number of steps for which it has been far larger
        ("kept_m_per_N", "f8"),  # c when the spring's law last held
        ("stiffest_m_per_N", "f8"),  # least learnt c
        ("kept_mps", "f8", (ROWS,)),  # velocities of slide and drive when the spring's law last held
        ("broken_steps", "i8"),  # steps for which the law is broken
        ("broken_drive", "i8"),  # checks during this break in which mostly the drive changed, minus the others
        ("broken_slide", "i8"),  # checks in which the slide was faster than drive and spring explain, minus the others
        ("shaken_s", "f8"),  # time for which the drive has moved under vibration
        ("confirmed", "f8"),  # share of v_d that slide and force confirm, with a margin; 1: all of it
        ("apart_s", "f8"),  # time for which slide and force do not confirm v_d
        ("apart_by", "i8"),  # row of the signal that alone changed before `apart_s` began; negative: unknown
        ("agreed_mps", "f8", (ROWS,)),  # velocities along the drive's direction when v_d was last confirmed
        ("went_m", "f8", (2,)),  # last two |changes| of the drive's position from block to block; negative: unknown
        ("jumps", "f8"),  # count of jumps of the drive's position, decays with a time constant of 1 s
        ("jumped_s", "f8"),  # time for which the v_d from before the last jump is still used
        ("drops", "f8"),  # count of dropouts of the base accelerometer, decays with a time constant of 1 s
        ("dropped", "i8"),  # whether the base accelerometer dropped out in the last block
        ("grown_steps", "i8"),  # number of successive steps of a slightly too large v_a
        ("spring_level", "i8"),  # level of the windows in which the spring's law is checked
        ("bend_m", "f8"),  # mean second difference of the drive's position
        ("bent", "i8"),  # number of successive checks with a far larger second difference
        ("slip_count", "f8"),  # count of slips, decays with a time constant of 1 s
        ("slips_wound", "f8"),  # count of slips for which the spring could wind up, decays likewise
        ("unbelieved_s", "f8"),  # time for which slips are still ignored as noise
        ("overruled", "i8"),  # 1 if the rig vibrated otherwise than commanded in the last block
        ("quiet_s", "f8"),  # time for which the commands have been in force, without a stall
        ("settled_s", "f8"),  # time of `quiet_s` in which the exciter delivered no far larger v_a than commanded
        ("stalling_s", "f8"),  # time for which blocks have not been compared with commands, because of interruptions
        ("noise_told_s", "f8"),  # time for which grown noise is still reported
        ("slide_accel_unread", "i8"),  # whether samples of the slide's accelerometer are not finite
        ("outside", "i8"),  # whether the drive is outside of its travel
        ("first_sample", "f8", (doubts.CHANNELS,)),  # first sample of the last block, by channel
        ("seen_block", "i8"),  # number of the block of `first_sample`
        ("first_seen", "i8"),  # whether there is a `first_sample`
        ("same_steps", "i8", (doubts.CHANNELS,)),  # successive blocks with the same first sample
        ("lively", "f8", (doubts.CHANNELS, 2)),  # share of `looks` with noise: at rest; in motion (base: vibrated)
        ("looks", "i8", (doubts.CHANNELS, 2)),  # number of checks of the noise, in the same two conditions
        ("looked", "i8"),  # number of checks of all channels together, which selects the next channel
        # limits
        ("allowed_Hz", "f8"),
        ("allowed_m", "f8"),
        ("limit", "i8"),
        ("free_steps", "i8"),  # number of steps since a limit last changed the command
        ("stopped", "i8"),
        ("stale", "i8"),
        # announced drive velocity: `controller.announced`
        ("announced_from_ns", "i8", (MOST_ANNOUNCED,)),
        ("announced_mps", "f8", (MOST_ANNOUNCED,)),
        ("announced_count", "i8"),
        # bookkeeping
        ("steps", "i8"),
        ("block", "i8"),
        ("run", "u8"),
        ("guard_state", "i8"),
        ("missing_blocks", "i8"),  # lost blocks since the last usable block
    ],
    align=True,
)

LAYOUT_ID = hashlib.sha256(repr(STATE).encode()).hexdigest()


def build(config: ControllerConfig) -> tuple[Records, Records]:
    """The parameters and an empty memory for a configuration."""
    params = record(PARAMS)
    p: Any = params[0]

    def steps(time_s: float) -> int:
        return max(math.ceil(time_s / config.block_s - 1e-9), 1)

    estimator, policy, amplitude, limits = config.estimator, config.policy, config.amplitude, config.limits
    p.block_s = config.block_s
    p.sample_s = config.block_s / config.samples_per_block
    p.samples_per_block = config.samples_per_block
    p.bin_samples = _divisor(config.samples_per_block, _BIN_S / p.sample_s)
    p.bin_s = p.bin_samples * p.sample_s
    p.spike_bends = BENDS * math.sqrt(p.bin_samples)
    bins = config.samples_per_block // p.bin_samples
    p.bins_per_tick = _divisor(bins, _TICK_S / p.bin_s)
    p.ticks_per_block = bins // p.bins_per_tick
    p.levels = min(LEVELS, 1 + math.floor(math.log2(_LONGEST_WINDOW_S / (BINS * p.bin_s))))
    for level in range(LEVELS):
        p.window_s[level] = BINS * p.bin_s * 2**level
    p.drive_stiffness_N_per_m = config.drive_stiffness_N_per_m or 0.0
    p.least_feed_mps = estimator.least_feed_mps
    p.use_force, p.use_slide_position = estimator.use_force, estimator.use_slide_position
    p.mode = MODES.index(policy.mode)
    for name in ("trial_every_s", "least_ratio", "most_ratio"):
        p[name] = getattr(policy, name)
    p.enabled_from_ns = round(policy.enabled_from_s * 1e9)
    p.filter_share = 1.0 - math.exp(-config.block_s / amplitude.filter_s)
    p.learn_share = config.block_s / (config.block_s + LEARN_S)
    p.silence_steps, p.settle_steps, p.loud_steps = steps(SILENCE_S), steps(SETTLE_S), steps(LOUD_S)
    shown_steps = 1 + steps(MOST_DELAY_S + TAIL * amplitude.filter_s)
    p.slot_steps = math.ceil(shown_steps / (SLOTS - 1))
    p.slots = 1 + math.ceil(shown_steps / p.slot_steps)
    p.spring_level = max(math.ceil(math.log2(spring.SHORTEST_S / (BINS * p.bin_s))), 0)
    p.confirm_level = max(math.ceil(math.log2(confirmed.WINDOW_S / (BINS * p.bin_s))), 0)
    p.travel_low_m, p.travel_high_m = limits.travel_m or (-math.inf, math.inf)
    p.broken_steps, p.first_steps = steps(spring.HOLD_S), max(steps(spring.FIRST_S), delivered.SOME)
    p.told_gain = amplitude.known_gain or 0.0
    p.gain_band, p.gain_floor = amplitude.gain_band, amplitude.gain_floor
    p.follow_share = min(delivered.SOME * config.block_s / delivered.FOLLOW_S, 1.0)
    p.known_steps, p.low_steps, p.high_steps = (
        steps(band.KNOWN_S),
        steps(delivered.HOLD_S),
        steps(delivered.LOUD_HOLD_S),
    )
    p.passed_steps, p.frozen_steps = steps(delivered.PASSED_S), max(steps(frozen.HOLD_S), frozen.FEWEST)
    p.grown_steps = steps(delivered.GROWN_HOLD_S)
    p.accel_range_mps2 = amplitude.accel_range_mps2
    p.accel_bandwidth_Hz = amplitude.accel_bandwidth_Hz
    for name in ("v_ratio", "amplitude_max_m", "velocity_max_mps", "frequency_min_Hz", "frequency_max_Hz"):
        p[name] = getattr(limits, name)
    p.slew_m_per_step = limits.slew_m_per_s * config.block_s
    candidates = candidate_frequencies_Hz(config)
    p.candidates = len(candidates)
    p.candidate_Hz[: len(candidates)] = candidates
    bands = forbidden_bands_Hz(limits)
    p.bands = len(bands)
    for row, ends_Hz in enumerate(bands):
        p.band_Hz[row] = ends_Hz
    return params, record(STATE)
