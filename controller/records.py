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
from controller.trips import consistency

_BIN_S = 1e-4  # longest bin; one sample if samples are longer: four bins resolve the slips of a drive of 50 N/um
_TICK_S = 1e-3  # longest period of the estimate of motion and contact; a longer block holds several periods
_LONGEST_WINDOW_S = 3.3  # drift makes longer windows useless; a feed of 0.5 um/s exceeds 0.5 um of noise in 0.1 s


def _divisor(count: int, wanted: float) -> int:
    """The largest divisor of `count` up to `wanted`, at least 1."""
    return max(n for n in range(1, count + 1) if count % n == 0 and (n <= wanted * (1.0 + 1e-9) or n == 1))


def _parameters(config: ControllerConfig) -> dict[str, Any]:
    """The numbers of the file by their keys, and the numbers derived from them: floats, integers and arrays."""
    tables = config.estimator, config.policy, config.amplitude, config.limits
    block_s, samples, limits = config.block_s, config.samples_per_block, config.limits
    bin_samples = _divisor(samples, _BIN_S * samples / block_s)
    bin_s, bins = bin_samples * block_s / samples, samples // bin_samples
    bins_per_tick = _divisor(bins, _TICK_S / bin_s)
    shown_s = MOST_DELAY_S + TAIL * config.amplitude.filter_s
    bands_Hz = merged_bands_Hz(limits.forbidden_Hz)
    travel_low_m, travel_high_m = limits.travel_m or (-math.inf, math.inf)
    return {key: value for table in tables for key, value in table if isinstance(value, bool | float)} | {
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
        "mode": MODES.index(config.policy.mode),
        "enabled_from_ns": round(config.policy.enabled_from_s * 1e9),
        "filter_share": 1.0 - math.exp(-block_s / config.amplitude.filter_s),
        "learn_share": block_s / (block_s + LEARN_S),
        "follow_share": min(block_s / FOLLOW_S, 1.0),
        "slot_steps": math.ceil((1.0 + math.ceil(shown_s / block_s - 1e-9)) / (SLOTS - 1)),
        "configured_gain": config.amplitude.known_gain or 0.0,
        "gain_leap": math.sqrt(config.amplitude.gain_band),
        "travel_low_m": travel_low_m,
        "travel_high_m": travel_high_m,
        "slew_m_per_step": limits.slew_m_per_s * block_s,
        "frequency_Hz": cheapest_frequency_Hz(config),
        "bands": len(bands_Hz),
        "band_Hz": np.array([*bands_Hz, *[(0.0, 0.0)] * (MOST_BANDS - len(bands_Hz))]),
    }


def _field(name: str, value: Any) -> tuple[str, str, tuple[int, ...]]:
    return name, "i8" if isinstance(value, int) else "f8", np.shape(value)


PARAMS = np.dtype([_field(name, value) for name, value in _parameters(ControllerConfig()).items()], align=True)

_WAYS = (2,)  # a value that is learnt for each direction of the drive, forwards and backwards


def _f8(*names: str, shape: tuple[int, ...] = ()) -> list[tuple[str, str, tuple[int, ...]]]:
    return [(name, "f8", shape) for name in names]


def _i8(*names: str, shape: tuple[int, ...] = ()) -> list[tuple[str, str, tuple[int, ...]]]:
    return [(name, "i8", shape) for name in names]


STATE = np.dtype(
    [
        # windows; the rows are FORCE [N], SLIDE [m] and DRIVE [m]
        *_f8("bins", shape=(ROWS, LEVELS, BINS)),
        *_f8("fresh", shape=(ROWS, MOST_FRESH)),  # means of the bins that are added next
        *_f8("slope_before", shape=(ROWS, LEVELS, 2)),  # slopes of the last window, and of the window before it
        # sigma: measured noise of a slope; noise: sigma, extrapolated from a shorter window until it is measured, and
        # quantisation; 0: unknown
        *_f8("slope", "sigma", "noise", shape=(ROWS, LEVELS)),
        *_f8("law_mps", shape=(LEVELS,)),  # sigma of the slope of x_s + F / k_d - x_d, which is 0 without noise
        # bins since the windows were last emptied; slope differences from which law_mps and sigma were learnt
        *_i8("pushed", "differences", shape=(LEVELS,)),
        # channels: quantisation step of a sample, 0: unknown; last conditioned bin; change from bin to bin; deviation of the last
        # bin from the line of the bins before it; mean of its absolute value, the noise; the same with a time constant of 1 s
        *_f8("resolution", "last", "rate", "off", "scatter", "usual", shape=(ROWS,)),
        *_i8("far", "learnt", shape=(ROWS,)),  # numbers of replaced bins in a row, and of bins in `scatter`
        *_f8("grown_s"),  # time for which the drive position's noise has grown, then for which this is reported
        *_f8("jumps"),  # count of steps of the drive position; decays with 1 s
        *_i8("stepped"),  # bits of the rows that stepped in this block
        *_f8("offset_m"),  # sum of the steps of the drive position
        # weighted sum of the samples of the last block; count of blocks that repeated the block before them, decays with 1 s
        *_f8("block_sum", "repeats", shape=(channels.BASE + 1,)),
        # motion
        *_f8("drive_velocity_mps", "drive_velocity_sigma_mps"),
        *_f8("held_mps"),  # |v_d| whose rises count at once and whose falls with a time constant of 0.1 s
        *_f8("rising_mps"),  # lower bound of |v_d| at the end of its windows
        *_f8("steady_mps", "steady_s"),  # |v_d| after its last change by 4 % or more, and the time since that change
        *_f8("moved_s", "stood_s"),  # time since the drive started or turned, 0 at rest; time since it stopped
        *_i8("moving", "direction"),
        # contact
        *_i8("contact"),  # ContactState
        *_i8("level"),  # level of the shortest windows that resolve a stick at the present v_d; -1: no level
        *_f8("sliding_mps"),  # velocity of the slide along the drive's direction
        *_f8("window_s", "force_rate", "since_stick_s", "expected_stick_s", "unseen_s", "time_to_slip_s"),
        *_i8("drive_unseen"),  # whether the slide moves while the drive position is constant
        *_f8("slipped_s"),  # time since the last slip ended
        *_i8("blind", "slipping", "slip_began", "stick_began"),  # began: 1 in the step in which it began
        # learnt values of the axis
        *_f8("compliance_m_per_N", "compliance_sigma"),  # 1 / k_d; [m/N], infinite while k_d is unknown
        *_i8("stiffness_learnt"),  # 1 once c is known from windows within 20 %
        # sums over the windows that show c: weight, weight c, weight (c - mean)^2, number
        *_f8("shown", "shown_c", "shown_square", "shown_windows"),
        # elongations of a rig without a force sensor: relaxed, shortest and longest; `stretched`: known
        *_f8("relaxed_m", "shortest_m", "longest_m"),
        *_i8("stretched"),
        *_i8("dragged", shape=_WAYS),  # 1 once the slide slid in this direction
        *_f8("peak_N"),  # highest force of this stick, along the motion
        *_f8("breakaway_N", shape=_WAYS),
        # vibration; fast: v_a of the last block alone
        *_f8("phase_rad", "in_phase_mps2", "quadrature_mps2", "vibration_velocity_mps", "fast_mps"),
        # policy
        *_i8("mode", "why"),  # `why`: Reason of the present vibration
        *_f8("mode_s"),
        *_f8("waiting_s"),  # time in which slips still release force that was stored before
        *_f8("swing", "memory_s"),  # relative swing of friction, which decays; least time constant of it after slips
        *_f8("even_s"),  # time in this mode for which v_s stayed within 10 % of v_d
        *_f8("fade"),  # v_a / v_d of a trial that begins
        # largest force along the motion in the present window of `controller.policy.trial`, and in the last; largest fall below
        # it; time in the window
        *_f8("crest_N", "crest_before_N", "fall_N", "fall_s"),
        *_f8("top"),  # largest share of v_d by which the slide was ahead; decays; -1: not known yet
        *_f8("untried_s"),  # vibrated time of motion since the last result of a trial
        *_f8("tried_s", "tried_mps"),  # time without vibration in the present trial, and the fastest |v_d| in it
        *_f8("fall_with_N"),  # largest fall in the last window with vibration
        *_f8("failed"),  # count of slips and surges under vibration; decays
        *_f8("off_left_s", "ratio"),  # ratio: set point of v_a / v_d
        *_f8("needed_to_mps", "needless_from_mps", "ratio_now", "wanted_speed_mps", "wanted_velocity_mps"),
        # amplitude
        *_f8("wanted_m", "gain"),  # gain: delivered over applied v_a
        *_f8("known_gain"),  # the gain from which faults are detected; 0: unknown
        *_f8("accepted_share"),  # share of `known_gain` to which a warm exciter was followed
        *_f8("followed_gain"),  # gain, averaged over FOLLOW_S
        *_f8(
            "gain_off_s", "low_s"
        ),  # time for which the gain is outside of its bounds; and below the known gain by a factor
        *_f8("check_least", "check_most"),  # least and largest gain of the tones of the last loop check
        *_i8("checked_blocks"),  # number of received blocks with a tone of it
        *_f8("applied_mps"),  # v_a of a rigid mount at the applied amplitude
        *_f8("least_mps", "most_mps", shape=(SLOTS,)),  # extremes of the applied v_a over slot_steps
        *_i8("listened"),  # number of blocks in these extremes
        *_f8("noise_mps"),  # v_a that is measured with the base at rest
        *_i8("unexplained"),  # 1, -1: the last block showed far more, far less v_a than the gain explains
        *_i8("resonates"),  # whether the gain is above its bounds, for long
        *_i8("loop_delay_steps", "at_limit", "banded"),  # banded: whether the gain band limits the amplitude
        # time without a commanded vibration; with the commands in force; with an exciter too weak at its end
        *_f8("silent_s", "in_force_s", "weak_s"),
        # trips: Reason of the reported trip, 0: no trip; bits of `controller.trips.doubts`
        *_i8("trip", "doubted"),
        *_f8("kept_mps", shape=(ROWS,)),  # c F', velocities of slide and drive when the spring's law last held
        *_f8("agreed_mps"),  # |v_d| when it last held and the slide moved, in this move; 0: not yet
        *_i8("agreed"),  # 1 once it held while the slide moved
        *_f8("evidence_s"),  # integral of the law's relative error beyond its limit
        *_i8("changed"),  # Reason for the channel that changed when the evidence began
        *_f8("most_drive_mps"),  # largest v_d that v_a follows while there is evidence
        *_i8("slide_accel_unread"),  # whether samples of the slide's accelerometer are not finite
        *_i8("outside"),  # whether the drive is outside of its travel
        # limits
        *_f8("allowed_Hz", "allowed_m"),
        *_i8("limit", "stopped"),
        # announced drive velocity: `controller.announced`
        *_i8("announced_from_ns", shape=(MOST_ANNOUNCED,)),
        *_f8("announced_mps", shape=(MOST_ANNOUNCED,)),
        *_i8("announced_count"),
        # bookkeeping; missing_blocks: lost blocks since the last usable block
        *_i8("slips", "surges", "steps", "block", "guard_state", "missing_blocks"),
        ("run", "u8"),
    ],
    align=True,
)

LAYOUT_ID = hashlib.sha256(repr(STATE).encode()).hexdigest()


def build(config: ControllerConfig) -> tuple[Records, Records]:
    """The parameters and an empty memory for a configuration."""
    params, values = record(PARAMS), _parameters(config)
    for name in PARAMS.names or ():
        params[name] = values[name]
    return params, record(STATE)
