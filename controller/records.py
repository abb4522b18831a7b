"""The derived numbers of a controller, and all of its memory. A memory of zeros is a controller at its start."""

import hashlib
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.kernel import record
from controller.amplitude import LEARN_S, LOUD_S, MOST_DELAY_S, REMEMBERED, SETTLE_S, SILENCE_S, SLOTS, TAIL
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
from controller.trips import band, confirmed, delivered, doubts, frozen, spring

_BIN_S = 1e-4  # shortest bin: a window of four sees the slips of a drive of 50 N/um
_TICK_S = 1e-3  # period of the estimate of the contact, for any length of a block
_LONGEST_WINDOW_S = 3.3  # a feed of 0.5 um/s exceeds 0.5 um of noise in 0.1 s; drift makes longer windows useless


def _divisor(count: int, wanted: float) -> int:
    """The largest divisor of `count` up to `wanted`, at least 1."""
    return max(n for n in range(1, count + 1) if count % n == 0 and (n <= wanted * (1.0 + 1e-9) or n == 1))


_PARAMS_FLOATS = (
    *("block_s", "sample_s", "bin_s", "spike_bends", "drive_stiffness_N_per_m", "least_feed_mps"),
    *("first_probe_s", "probe_every_s", "probe_every_max_s", "probe_fade_s", "probe_hold_s"),
    *("least_ratio", "most_ratio", "start_s", "settle_s"),
    *("filter_share", "learn_share", "accel_bandwidth_Hz", "accel_range_mps2"),
    *("gain_band", "told_gain", "follow_share", "travel_low_m", "travel_high_m"),
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

_WAYS = 2  # forwards and backwards
STATE = np.dtype(
    [
        # windows: rows FORCE, SLIDE, DRIVE
        ("bins", "f8", (ROWS, LEVELS, BINS)),
        ("fresh", "f8", (ROWS, MOST_FRESH)),  # bins that are being added
        ("slope", "f8", (ROWS, LEVELS)),
        ("slope_before", "f8", (ROWS, LEVELS, 2)),  # slopes of the last window, and of the window before it
        ("sigma", "f8", (ROWS, LEVELS)),  # measured noise of a slope
        (
            "noise",
            "f8",
            (ROWS, LEVELS),
        ),  # noise of a slope: sigma, or the extrapolated sigma of a shorter window, and the resolution; 0: unknown
        ("law_mps", "f8", (LEVELS,)),  # sigma of the slope of x_s + F / k_d - x_d, which is 0 without noise
        ("agreements", "i8", (LEVELS,)),  # number of differences in law_mps
        ("pushed", "i8", (LEVELS,)),  # number of bins since the start
        ("differences", "i8", (LEVELS,)),  # number of differences in sigma
        ("resolution", "f8", (ROWS,)),
        # spikes: single samples far from their neighbours
        ("bends", "f8", (ROWS,)),  # mean second difference of the samples; 0: unknown
        ("most_bend", "f8", (ROWS,)),  # second difference above which a sample is a spike
        ("tail", "f8", (ROWS, 2)),  # last two samples of the block before; NaN: unknown
        ("spiked", "i8"),  # whether any channel has a spike in this block
        ("spike_at", "i8", (ROWS,)),  # sample of the spike; -1: no spike
        ("spike", "f8", (ROWS,)),  # replacement of the spike
        ("spike_step", "i8", (ROWS,)),  # step of the last spike
        # motion
        ("drive_velocity_mps", "f8"),
        ("drive_velocity_sigma_mps", "f8"),
        ("held_mps", "f8"),  # |v_d| that rises at once and falls slowly
        ("rising_mps", "f8"),  # |v_d| extrapolated to the end of its windows while it grows
        ("late_mps", "f8"),  # least |v_s| since the drive began to change its speed
        ("steady_mps", "f8"),
        ("steady_s", "f8"),  # time since v_d last changed
        ("moved_s", "f8"),  # time since the drive started or turned
        ("stood_s", "f8"),
        ("rested", "i8"),  # 1 if the slide must have been at rest when the drive started or turned
        ("measured", "i8"),
        ("moving", "i8"),
        ("direction", "i8"),
        # contact
        ("contact", "i8"),  # ContactState
        ("level", "i8"),  # level of the shortest window that resolves a stick; -1: no level
        ("window_s", "f8"),
        ("sliding_mps", "f8"),  # velocity of the slide along the drive's direction
        ("fine_mps", "f8"),  # sliding_mps over a longer window with less noise
        ("fine_sigma_mps", "f8"),
        ("force_rate", "f8"),
        ("score", "f8"),
        ("stick_s", "f8"),
        ("since_stick_s", "f8"),
        ("smooth_s", "f8"),
        ("slid_s", "f8"),  # duration of sliding in this move, without vibration
        ("expected_stick_s", "f8"),
        ("unseen_s", "f8"),
        ("time_to_slip_s", "f8"),
        ("blind", "i8"),
        ("slipping", "i8"),
        ("slip_began", "i8"),  # in this step
        ("stick_began", "i8"),
        ("slips", "i8"),
        ("surges", "i8"),
        # learnt values of the axis
        ("stiffness_N_per_m", "f8"),
        ("stiffness_sigma", "f8"),  # over the stiffness
        ("stiffness_learnt", "i8"),
        ("taught", "f8"),
        ("taught_ratio", "f8"),
        ("taught_square", "f8"),
        ("relaxed_m", "f8"),  # elongation of the relaxed spring, for a rig without a force sensor
        ("shortest_m", "f8"),
        ("longest_m", "f8"),
        ("stretched", "i8"),  # 1 once an elongation was seen
        ("dragged", "i8", (_WAYS,)),  # 1 once the slide slid in this direction
        ("peak_N", "f8"),  # highest force of this stick
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
        ("reason", "i8"),
        ("mode_s", "f8"),
        ("calm_s", "f8"),  # time without stick or slip since the ratio last changed
        ("waiting_s", "f8"),
        ("swing", "f8"),  # relative swing of friction under vibration; decays
        ("even_s", "f8"),  # time with a small swing in this mode
        ("swung", "f8"),  # mean square of the swing of v_s, over v_d
        ("swung_least", "f8"),  # least `swung` since a trial fade began; infinite in a fade after a wobble
        ("fade", "f8"),  # ratio of a vibration that fades
        ("fade_from_N", "f8"),
        ("fade_per_s", "f8"),
        ("unasked_s", "f8"),  # time of vibration since the last probe or wobble
        ("wobbles", "i8"),  # whether v_a wobbles
        ("wobble_level", "i8"),  # level of the windows for v_s
        ("wobble_s", "f8"),
        ("wobble_period_s", "f8"),
        ("wobble_a", "f8", (3,)),  # sums of v_a: in phase, a quarter of a period later, mean
        ("wobble_v", "f8", (3,)),  # the same sums of v_s
        ("lead", "f8"),  # share of v_d by which the slide is ahead because the ratio rises
        ("swing_level", "i8"),  # level of the windows for the swing; -1: no level
        ("wound", "i8"),  # whether the spring was wound up at the begin of this move
        ("slid_N", "f8", (_WAYS,)),  # force at which the vibrated slide followed
        ("top", "f8"),  # largest share of v_d by which the slide was ahead; decays; -1: at rest
        ("settle_left_s", "f8"),
        ("settle_mps", "f8"),
        ("helpless", "i8"),
        ("failed", "i8"),  # number of slips that more vibration could not have prevented
        ("failed_left_s", "f8"),  # time until this number restarts
        ("roughness", "f8"),
        ("roughness_s", "f8"),
        ("rough_with", "f8", (_WAYS,)),
        ("harmful", "i8", (_WAYS,)),
        ("off_s", "f8", (_WAYS,)),
        ("off_left_s", "f8", (_WAYS,)),
        ("ratio", "f8", (_WAYS,)),  # set point of v_a / v_d
        ("edge_ratio", "f8", (_WAYS,)),  # largest ratio that was too small; 0: unknown
        ("edge_held_s", "f8", (_WAYS,)),
        ("probe_s", "f8", (_WAYS,)),
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
        ("known_gain", "f8", (MOST_CANDIDATES,)),  # delivered over commanded v_a
        ("known_steps", "i8", (MOST_CANDIDATES,)),  # number of steps in the mean `known_gain`
        ("checked_blocks", "i8"),  # blocks with a tone of the loop check
        ("tone_Hz", "f8", (MOST_CANDIDATES, 2)),  # nearest tones of the check below and above a candidate; 0: no tone
        ("tone_gain", "f8", (MOST_CANDIDATES, 2)),  # delivered over commanded v_a at these tones
        ("gain_other_s", "f8"),  # time for which GAIN_OTHER is still reported
        ("banded", "i8"),  # whether the gain band limits the amplitude
        ("even_steps", "i8"),  # steps for which the expected v_a has been even
        ("followed", "i8"),  # candidate of `followed_gain`
        ("followed_gain", "f8"),  # measured gain, averaged over a second
        ("low_steps", "i8"),  # steps of too small a v_a
        ("high_steps", "i8"),  # steps of too large a v_a; negative: reported, until as many steps without
        ("rest_mps2_2", "f8"),  # mean square of the acceleration without the sine, over a second
        ("rest_steps", "i8"),  # steps for which it is far larger
        ("kept_mps", "f8", (ROWS,)),  # velocities of slide and drive when the spring's law last held
        ("kept_N_per_m", "f8"),  # stiffness when the spring's law last held
        ("broken_steps", "i8"),  # steps for which the law is broken
        ("broken_drive", "i8"),  # steps in which the drive changed during this break, minus the other steps
        (
            "broken_slide",
            "i8",
        ),  # steps in which the slide is faster than drive and spring explain, minus the other steps
        ("shaken_s", "f8"),  # time for which the drive has moved under vibration
        ("confirmed", "f8"),  # share of v_d that slide and force confirm, with its margin
        ("apart_s", "f8"),  # time for which slide and force do not confirm v_d
        ("apart_by", "i8"),  # row of the signal that changed at its begin; negative: unknown
        ("agreed_mps", "f8", (ROWS,)),  # velocities along the drive's direction when v_d was last confirmed
        ("stiffest_N_per_m", "f8"),  # largest learnt stiffness
        ("went_m", "f8", (2,)),  # steps of the drive's position in the last two blocks; negative: unknown
        ("jumps", "f8"),  # number of jumps of the drive's position in the last second
        ("jumped_s", "f8"),  # time for which v_d before the last jump is still used
        ("drops", "f8"),  # number of dropouts of the base accelerometer in the last second
        ("dropped", "i8"),  # whether it dropped out in the last block
        ("grown_steps", "i8"),  # steps of a slightly too large v_a
        ("spring_level", "i8"),  # level of the windows in which the spring's law is checked
        ("bend_m", "f8"),  # mean second difference of the drive's position
        ("bent", "i8"),  # number of successive blocks with a far larger one
        ("slip_count", "f8"),  # number of slips in the last second
        ("slips_wound", "f8"),  # number of slips for which the spring could wind up in the last second
        ("unbelieved_s", "f8"),  # time for which slips still count as noise
        ("quiet_s", "f8"),  # time since the last stall of the computer or the link
        ("stalling_s", "f8"),  # time for which blocks have not been compared with commands, because of stalls
        ("noise_told_s", "f8"),  # time for which grown noise is still reported
        ("slide_accel_unread", "i8"),  # whether samples of the slide's accelerometer are not finite
        ("outside", "i8"),  # whether the drive is outside of its travel
        ("first_sample", "f8", (doubts.CHANNELS,)),  # first sample of the last block
        ("seen_block", "i8"),  # block of `first_sample`
        ("first_seen", "i8"),  # whether there is a `first_sample`
        ("same_steps", "i8", (doubts.CHANNELS,)),  # successive blocks with the same first sample
        ("lively", "f8", (doubts.CHANNELS, 2)),  # share of `looks` that showed noise, at rest and in motion
        ("looks", "i8", (doubts.CHANNELS, 2)),  # number of checks of the noise, at rest and in motion
        ("looked", "i8"),  # number of checks of all channels
        # limits
        ("allowed_Hz", "f8"),
        ("allowed_m", "f8"),
        ("limit", "i8"),
        ("free_steps", "i8"),  # steps since a limit last changed the command
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


def build(config: ControllerConfig) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
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
    p.drive_stiffness_N_per_m = config.drive_stiffness_N_per_m
    p.least_feed_mps = estimator.least_feed_mps
    p.use_force, p.use_slide_position = estimator.use_force, estimator.use_slide_position
    p.mode = MODES.index(policy.mode)
    for name in (
        *("first_probe_s", "probe_every_s", "probe_every_max_s", "probe_fade_s", "probe_hold_s"),
        *("least_ratio", "most_ratio", "start_s", "settle_s"),
    ):
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
    p.gain_band, p.follow_share = amplitude.gain_band, min(delivered.SOME * config.block_s / delivered.FOLLOW_S, 1.0)
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
