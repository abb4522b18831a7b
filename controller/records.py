"""The derived numbers of a controller, and all of its memory. A memory of zeros is a controller at its start."""

import hashlib
import math
from typing import Any

import numpy as np

from bridge.arrays import Records
from bridge.guard.config import merged_bands_Hz
from bridge.kernel import record
from controller.announced import MOST_ANNOUNCED
from controller.config import MODES, MOST_BANDS, ControllerConfig, cheapest_frequency_Hz
from controller.estimate import channels
from controller.estimate.windows import BINS, LEVELS, MOST_FRESH, ROWS
from controller.exciter import FOLLOW_S, LEARN_S, MOST_DELAY_S, SLOTS, TAIL
from controller.trips import consistency, doubts

_BIN_S = 1e-4  # longest bin; one sample if samples are longer: four bins resolve the slips of a drive of 50 N/um
_TICK_S = 1e-3  # longest period of the estimate of motion and contact; a longer block holds several periods
_LONGEST_WINDOW_S = 3.3  # drift makes longer windows useless; a feed of 0.5 um/s exceeds 0.5 um of noise in 0.1 s


def _divisor(count: int, wanted: float) -> int:
    """The largest divisor of `count` up to `wanted`, at least 1."""
    return max(n for n in range(1, count + 1) if count % n == 0 and (n <= wanted * (1.0 + 1e-9) or n == 1))


def _parameters(config: ControllerConfig) -> dict[str, Any]:
    """The derived numbers: floats, integers and arrays."""
    estimator, policy, amplitude, limits = config.estimator, config.policy, config.amplitude, config.limits
    block_s, samples = config.block_s, config.samples_per_block
    bin_samples = _divisor(samples, _BIN_S * samples / block_s)
    bin_s, bins = bin_samples * block_s / samples, samples // bin_samples
    bins_per_tick = _divisor(bins, _TICK_S / bin_s)
    shown_s = MOST_DELAY_S + TAIL * amplitude.filter_s
    bands_Hz = merged_bands_Hz(limits.forbidden_Hz)
    travel_low_m, travel_high_m = limits.travel_m or (-math.inf, math.inf)
    return {
        "block_s": block_s,
        "sample_s": block_s / samples,
        "samples_per_block": samples,
        "bin_s": bin_s,
        "bin_samples": bin_samples,
        "bins_per_tick": bins_per_tick,
        "ticks_per_block": bins // bins_per_tick,
        "levels": min(LEVELS, 1 + math.floor(math.log2(_LONGEST_WINDOW_S / (BINS * bin_s)))),
        "window_s": BINS * bin_s * 2.0 ** np.arange(LEVELS),
        "spring_level": max(math.ceil(math.log2(consistency.SHORTEST_S / (BINS * bin_s))), 0),
        "frozen_steps": max(math.ceil(channels.HOLD_S / block_s - 1e-9), 1),
        "drive_stiffness_N_per_m": config.drive_stiffness_N_per_m or 0.0,
        "least_feed_mps": estimator.least_feed_mps,
        "use_force": int(estimator.use_force),
        "use_slide_position": int(estimator.use_slide_position),
        "mode": MODES.index(policy.mode),
        "enabled_from_ns": round(policy.enabled_from_s * 1e9),
        "trial_every_s": policy.trial_every_s,
        "v_ratio": limits.v_ratio,
        "least_ratio": policy.least_ratio,
        "most_ratio": policy.most_ratio,
        "filter_share": 1.0 - math.exp(-block_s / amplitude.filter_s),
        "learn_share": block_s / (block_s + LEARN_S),
        "follow_share": min(block_s / FOLLOW_S, 1.0),
        "slot_steps": math.ceil((1.0 + math.ceil(shown_s / block_s - 1e-9)) / (SLOTS - 1)),
        "configured_gain": amplitude.known_gain or 0.0,
        "gain_band": amplitude.gain_band,
        "gain_leap": math.sqrt(amplitude.gain_band),
        "gain_floor": amplitude.gain_floor,
        "accel_bandwidth_Hz": amplitude.accel_bandwidth_Hz,
        "travel_low_m": travel_low_m,
        "travel_high_m": travel_high_m,
        "amplitude_max_m": limits.amplitude_max_m,
        "velocity_max_mps": limits.velocity_max_mps,
        "slew_m_per_step": limits.slew_m_per_s * block_s,
        "frequency_Hz": cheapest_frequency_Hz(config),
        "frequency_min_Hz": limits.frequency_min_Hz,
        "frequency_max_Hz": limits.frequency_max_Hz,
        "bands": len(bands_Hz),
        "band_Hz": np.array([*bands_Hz, *[(0.0, 0.0)] * (MOST_BANDS - len(bands_Hz))]),
    }


def _field(name: str, value: Any) -> tuple[str, str, tuple[int, ...]]:
    return name, "i8" if isinstance(value, int) else "f8", np.shape(value)


PARAMS = np.dtype([_field(name, value) for name, value in _parameters(ControllerConfig()).items()], align=True)

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
        # channels
        ("last", "f8", (ROWS,)),  # last conditioned bin
        ("rate", "f8", (ROWS,)),  # change from bin to bin
        ("off", "f8", (ROWS,)),  # deviation of the last bin from the line of the bins before it
        ("far", "i8", (ROWS,)),  # number of replaced bins in a row
        ("scatter", "f8", (ROWS,)),  # mean of its absolute value: the noise
        ("usual", "f8", (ROWS,)),  # `scatter` with a time constant of 1 s; 0: unknown
        ("grown_s", "f8"),  # time for which the drive position's noise has grown, then for which this is reported
        ("spikes", "f8", (ROWS,)),  # count of spikes, and of steps of the drive position; decays with 1 s
        ("stepped", "i8"),  # bits of the rows that stepped in this block
        ("offset_m", "f8"),  # sum of the steps of the drive position
        ("block_sum", "f8", (doubts.CHANNELS,)),  # weighted sum of the samples of the last block
        ("repeats", "f8", (doubts.CHANNELS,)),  # count of blocks that repeated the block before them; decays with 1 s
        # motion
        ("drive_velocity_mps", "f8"),
        ("drive_velocity_sigma_mps", "f8"),
        ("held_mps", "f8"),  # |v_d| whose rises count at once and whose falls with a time constant of 0.1 s
        ("rising_mps", "f8"),  # lower bound of |v_d| at the end of its windows
        ("steady_mps", "f8"),  # |v_d| after its last change by 4 % or more
        ("steady_s", "f8"),  # time since that change
        ("moved_s", "f8"),  # time since the drive started or turned; 0 at rest
        ("stood_s", "f8"),
        ("moving", "i8"),
        ("direction", "i8"),
        # contact
        ("contact", "i8"),  # ContactState
        ("level", "i8"),  # level of the shortest windows that resolve a stick at the present v_d; -1: no level
        ("window_s", "f8"),
        ("sliding_mps", "f8"),  # velocity of the slide along the drive's direction
        ("force_rate", "f8"),
        ("since_stick_s", "f8"),
        ("expected_stick_s", "f8"),
        ("unseen_s", "f8"),
        ("time_to_slip_s", "f8"),
        ("blind", "i8"),
        ("drive_unseen", "i8"),  # whether the slide moves while the drive position is constant
        ("slipping", "i8"),
        ("slipped_s", "f8"),  # time since the last slip ended
        ("slip_began", "i8"),  # 1 if a slip began in this step
        ("stick_began", "i8"),
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
        ("breakaway_N", "f8", (_WAYS,)),
        # vibration
        ("phase_rad", "f8"),
        ("in_phase_mps2", "f8"),
        ("quadrature_mps2", "f8"),
        ("vibration_velocity_mps", "f8"),
        ("fast_mps", "f8"),  # v_a of the last block alone
        # policy
        ("mode", "i8"),
        ("mode_s", "f8"),
        ("waiting_s", "f8"),  # time in which slips still release force that was stored before
        ("swing", "f8"),  # relative swing of friction under vibration; decays
        ("memory_s", "f8"),  # least time constant of this decay, after slips
        ("even_s", "f8"),  # time in this mode for which v_s stayed within 10 % of v_d
        ("why", "i8"),  # Reason of the present vibration
        ("fade", "f8"),  # v_a / v_d of a trial that begins
        ("fade_per_s", "f8"),
        ("trials", "i8"),  # number of trials
        # largest force along the motion in the present window of `controller.policy.trial`, and in the last
        ("crest_N", "f8"),
        ("crest_before_N", "f8"),
        ("fall_N", "f8"),  # largest fall below the crest in the present window
        ("fall_s", "f8"),
        ("top", "f8"),  # largest share of v_d by which the slide was ahead; decays; -1: not known yet
        ("untried_s", "f8", (_WAYS,)),  # vibrated time of motion since the last result of a trial
        ("tried_s", "f8", (_WAYS,)),  # time without vibration in the present trial
        ("fall_with_N", "f8", (_WAYS,)),  # largest fall with vibration; decays
        ("failed", "f8"),  # count of slips and surges under vibration; decays
        ("off_s", "f8", (_WAYS,)),
        ("off_left_s", "f8", (_WAYS,)),
        ("ratio", "f8", (_WAYS,)),  # set point of v_a / v_d
        ("proven", "i8", (_WAYS,)),  # 1 if a slip or surge was counted since the ratio last fell
        ("needed_to_mps", "f8", (_WAYS,)),
        ("needless_from_mps", "f8", (_WAYS,)),
        ("ratio_now", "f8"),
        ("wanted_speed_mps", "f8"),
        ("wanted_velocity_mps", "f8"),
        # amplitude
        ("wanted_m", "f8"),
        ("gain", "f8"),  # delivered over applied v_a
        ("known_gain", "f8"),  # the gain from which faults are detected; 0: unknown
        ("accepted_share", "f8"),  # share of `known_gain` to which a warm exciter was followed
        ("check_least", "f8"),  # least and largest gain of the tones of the last loop check
        ("check_most", "f8"),
        ("checked_blocks", "i8"),  # number of received blocks with a tone of it
        ("applied_mps", "f8"),  # v_a of a rigid mount at the applied amplitude
        ("least_mps", "f8", (SLOTS,)),  # extremes of the applied v_a over slot_steps
        ("most_mps", "f8", (SLOTS,)),
        ("listened", "i8"),  # number of blocks in these extremes
        ("noise_mps", "f8"),  # v_a that is measured with the base at rest
        ("unheard", "i8"),  # whether the vibration is not measured, with an unknown gain
        ("unexplained", "i8"),  # 1, -1: the last block showed far more, far less v_a than the gain explains
        ("followed_gain", "f8"),  # gain, averaged over FOLLOW_S
        ("gain_off_s", "f8"),  # time for which the gain is outside of its bounds
        ("resonates", "i8"),  # whether the gain is above its bounds, for long
        ("silent_s", "f8"),  # time for which no vibration has been commanded
        ("loop_delay_steps", "i8"),
        ("at_limit", "i8"),
        ("banded", "i8"),  # whether the gain band limits the amplitude
        ("in_force_s", "f8"),  # time for which the commands have been in force
        ("weak_s", "f8"),  # time for which the exciter, at its end, was too weak
        # trips
        ("trip", "i8"),  # Reason of the reported trip; 0: no trip
        ("doubted", "i8"),  # bits of `controller.trips.doubts`
        ("kept_mps", "f8", (ROWS,)),  # c F', velocities of slide and drive when the spring's law last held
        ("agreed_mps", "f8"),  # |v_d| when it last held and the slide moved, in this move; 0: not yet
        ("agreed", "i8"),  # 1 once it held while the slide moved
        ("evidence_s", "f8"),  # integral of the law's relative error beyond its limit
        ("changed", "i8"),  # Reason for the channel that changed when the evidence began
        ("spring_level", "i8"),  # level of the windows in which the spring's law is checked
        ("most_drive_mps", "f8"),  # largest v_d that v_a follows while there is evidence
        ("slide_accel_unread", "i8"),  # whether samples of the slide's accelerometer are not finite
        ("outside", "i8"),  # whether the drive is outside of its travel
        # limits
        ("allowed_Hz", "f8"),
        ("allowed_m", "f8"),
        ("limit", "i8"),
        ("stopped", "i8"),
        ("stale", "i8"),
        # announced drive velocity: `controller.announced`
        ("announced_from_ns", "i8", (MOST_ANNOUNCED,)),
        ("announced_mps", "f8", (MOST_ANNOUNCED,)),
        ("announced_count", "i8"),
        # bookkeeping
        ("slips", "i8"),
        ("surges", "i8"),
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
    for name, value in _parameters(config).items():
        params[name] = value
    return params, record(STATE)
