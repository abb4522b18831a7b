"""The derived numbers of a controller, and all of its memory. A memory of zeros is a controller at its start."""

import hashlib
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.kernel import record
from controller.announced import MOST_ANNOUNCED
from controller.config import (
    LONGEST_WINDOW_BLOCKS,
    MOST_BANDS,
    MOST_CANDIDATES,
    ControllerConfig,
    candidate_frequencies_Hz,
    forbidden_bands_Hz,
)

_PARAMS_FLOATS = (
    *("block_s", "sample_s", "drive_stiffness_N_per_m"),
    *("stick_force_rate", "slip_drop_N", "slip_burst_mps2", "standstill_mps", "breakaway_force_N"),
    *("gentle_ratio", "gentle_from", "too_late_from", "probe_fade_s"),
    *("loop_gain", "filter_share", "accel_bandwidth_Hz"),
    *(
        "v_ratio",
        "amplitude_max_m",
        "velocity_max_mps",
        "slew_m_per_step",
        "frequency_min_Hz",
        "frequency_max_Hz",
    ),
)
_PARAMS_INTS = (
    *("samples_per_block", "window_blocks", "velocity_window_blocks", "probe_steps", "probe_steps_max"),
    *("probe_hold_steps", "enabled_from_ns", "candidates", "bands"),
)
PARAMS = np.dtype(
    [(name, "f8") for name in _PARAMS_FLOATS]
    + [(name, "i8") for name in _PARAMS_INTS]
    + [("candidate_Hz", "f8", (MOST_CANDIDATES,)), ("band_Hz", "f8", (MOST_BANDS, 2))],
    align=True,
)

STATE = np.dtype(
    [
        # onset
        ("force_N", "f8", (LONGEST_WINDOW_BLOCKS,)),  # means of the last blocks, newest at force_at - 1
        ("position_m", "f8", (LONGEST_WINDOW_BLOCKS,)),
        ("force_at", "i8"),
        ("force_count", "i8"),
        ("position_at", "i8"),
        ("position_count", "i8"),
        ("force_rate", "f8"),
        ("score", "f8"),
        ("peak_N", "f8"),  # highest force since the last slip
        ("breakaway_N", "f8"),  # learnt; 0 while unknown
        ("drive_velocity_mps", "f8"),
        ("drive_velocity_held_mps", "f8"),  # rises at once, falls slowly
        ("burst_mps2", "f8"),
        ("burst_held_mps2", "f8"),
        ("time_to_slip_s", "f8"),
        ("contact", "i8"),  # ContactState
        ("slipping", "i8"),
        ("slips", "i8"),
        # vibration
        ("phase_rad", "f8"),
        ("in_phase_mps2", "f8"),
        ("quadrature_mps2", "f8"),
        ("vibration_velocity_mps", "f8"),
        ("demodulated_Hz", "f8"),
        # policy
        ("mode", "i8"),
        ("reason", "i8"),
        ("steps_in_mode", "i8"),
        ("smooth_steps", "i8"),
        ("gentle", "i8"),
        ("slips_at_wait", "i8"),
        ("probe_steps", "i8"),
        ("fade", "f8"),
        ("log_gain", "f8"),  # natural logarithm of the correction of the commanded amplitude
        ("wanted_velocity_mps", "f8"),
        ("wanted_Hz", "f8"),
        ("wanted_m", "f8"),
        ("weak_steps", "i8"),  # steps in a row in which the piezo was too weak; below 0: in which it was not
        # limits
        ("allowed_Hz", "f8"),
        ("allowed_m", "f8"),
        ("limit", "i8"),
        ("free_steps", "i8"),  # steps since a limit last changed the command
        ("stopped", "i8"),
        ("stale", "i8"),
        # what the rig has announced of the drive: `controller.announced`
        ("announced_from_ns", "i8", (MOST_ANNOUNCED,)),
        ("announced_mps", "f8", (MOST_ANNOUNCED,)),
        ("announced_count", "i8"),
        # bookkeeping
        ("steps", "i8"),
        ("block", "i8"),
        ("missing_blocks", "i8"),  # lost blocks since the last usable block
    ],
    align=True,
)

LAYOUT_ID = hashlib.sha256(repr(STATE).encode()).hexdigest()


def build(config: ControllerConfig) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Derive the parameters and an empty memory from a configuration."""
    params = record(PARAMS)
    p: Any = params[0]
    onset, policy, amplitude, limits = config.onset, config.policy, config.amplitude, config.limits

    def steps(time_s: float) -> int:
        return round(time_s / config.block_s)

    p.block_s = config.block_s
    p.sample_s = config.block_s / config.samples_per_block
    p.samples_per_block = config.samples_per_block
    p.drive_stiffness_N_per_m = config.drive_stiffness_N_per_m
    for name in ("stick_force_rate", "slip_drop_N", "slip_burst_mps2", "standstill_mps", "breakaway_force_N"):
        p[name] = getattr(onset, name)
    p.window_blocks = steps(onset.window_s)
    p.velocity_window_blocks = steps(onset.velocity_window_s)
    for name in ("gentle_ratio", "gentle_from", "too_late_from", "probe_fade_s"):
        p[name] = getattr(policy, name)
    p.enabled_from_ns = round(policy.enabled_from_s * 1e9)
    p.probe_steps = steps(policy.probe_every_s)
    p.probe_steps_max = steps(policy.probe_every_max_s)
    p.probe_hold_steps = steps(policy.probe_hold_s)
    p.loop_gain = amplitude.gain
    p.filter_share = 1.0 - math.exp(-config.block_s / amplitude.filter_s)
    p.accel_bandwidth_Hz = amplitude.accel_bandwidth_Hz
    for name in ("v_ratio", "amplitude_max_m", "velocity_max_mps", "frequency_min_Hz", "frequency_max_Hz"):
        p[name] = getattr(limits, name)
    p.slew_m_per_step = limits.slew_m_per_s * config.block_s
    candidates = candidate_frequencies_Hz(config)
    p.candidates = len(candidates)
    p.candidate_Hz[: len(candidates)] = candidates
    bands = forbidden_bands_Hz(limits)
    p.bands = len(bands)
    for row, band in enumerate(bands):
        p.band_Hz[row] = band
    return params, record(STATE)
