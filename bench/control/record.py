"""Parameters and memory of the judge of a run."""

import math
from typing import Any, Final

import numpy as np

from bridge.arrays import Records
from bridge.kernel import record
from plant.config import RigConfig

# Kinds of events, and the columns after the kind:
# STUCK: begin, end, largest |v_d|, time in which 5 sigma show it (-1: never), announcement (-1: none), 1 if begun in EXCITE
# SLIPPED, SURGED: begin, end, peak v_s over v_d, v_a over v_d at the begin, mode, peak v_s [m/s]
# CLAIMED, a false stick: time, state, mode, reason, |v_d|, 0
STUCK, SLIPPED, SURGED, CLAIMED = range(4)
EVENT_COLUMNS: Final = 7
BLOCK_ROWS: Final = ("force_N", "velocity_mps", "drive_mps", "v_a_mps", "state", "mode")

RING = 8192  # samples of the longest window: 0.4 s at 20 kHz
BLOCK_RING = 512  # blocks of the longest loop delay
BINS = 16  # bins of the time over which the drive's largest speed is kept
REASONS = 64  # room for the reasons of the controller; it has fewer
# v_s / v_d above which a pair without a drop of friction slips: at a start its spring alone causes 2
_BESIDE_SPRING = 2.2
_SLIP = 1.5  # v_s / v_d above which a pair with a drop of friction slips
_SIGMAS = 5.0  # sigmas of the noise by which a stick must differ from smooth motion to be seen
_STIFF_BLOCKS = 20.0  # natural stick, in blocks, below which its slip may announce it: a stiff axis
_MOVES, _FLOOR = 0.02, 0.5  # over the slowest feed: speed above which the drive moves; least v_d in v_s / v_d

SUMS: Final = (
    *("moving_s", "standing_s", "enabled_moving_s", "excited_s", "blind_s", "blind_excited_s", "probe_s", "twice_s"),
    *("energy", "drive_energy", "settled_s", "settled_energy", "settled_drive_energy"),  # integrals of v_a^2 and v_d^2
    *("covered", "uncovered"),  # blocks in EXCITE in which v_a can reach v_d, and the part of them in which it does not
    *("above_s", "above_at_s"),  # longest time of v_a above 1.3 times the wanted, and its begin
    *("first_s", "error_square", "error_peak_m"),
    *("turns", "turn_stick_s", "quadrant_m"),  # number of reversals; longest stick and largest quadrant error after one
)
PARAMS = np.dtype(
    [
        (name, "f8")
        for name in (
            *("sample_s", "block_s", "moves_mps", "floor_mps", "k_d", "swing_N", "breakaway_m", "slip_ratio"),
            *("window_s", "natural_s", "hold_s", "seen_m2s", "enabled_from_s", "stiff_stick_s"),
            *("amplitude_max_m", "velocity_max_mps", "slew_m_per_s"),
        )
    ]
    + [("samples", "i8"), ("late_blocks", "i8"), ("blind_reason", "i8")],
    align=True,
)
STATE = np.dtype(
    [(name, "f8", (RING,)) for name in ("x_m", "slid_m", "drive_m")]
    + [("fastest_mps", "f8", (BINS,)), ("wanted_mps", "f8", (BLOCK_RING,)), ("drive_mps", "f8", (BLOCK_RING,))]
    + [(name, "f8", (REASONS,)) for name in ("reason_s", "reason_moving_s", "reason_excited_s")]
    + [
        (name, "f8")
        for name in (
            *("now_s", "drive_now_mps", "speed_mps", "v_mps", "dir", "bin_s", "fastest", "stopped_s", "began_s"),
            *(
                "low_s",
                "dragged_s",
                "stick_s",
                "stick_mps",
                "stick_from_m",
                "needs_s",
                "announced_s",
                "end_s",
                "released_s",
            ),
            *("event_s", "event_ratio", "event_mode", "peak_ratio", "peak_mps", "quiet_s", "late_mps"),
            *("excite_begin_s", "reach_m", "allowed_mps", "above_now_s"),
            *("turn_dir", "turn_s", "follows_s", "turn_peak_m", "stroke_error", "stroke_s"),
            *SUMS,
        )
    ]
    + [
        (name, "i8")
        for name in (
            *("count", "at", "bin", "blocks", "moving", "stuck", "pending", "under_excite", "event"),
            *("mode", "claimed", "excitations"),
        )
    ],
    align=True,
)
_NEVER = -1e9


def seen_m2s(rig: RigConfig) -> float:
    """Drive travel squared times the time at which a stick differs from smooth motion by 5 sigma; independent of the speed.

    A slope over T has sigma^2 = 12 sigma_1^2 sample_s / T^3; 5 sigma equal the drive's velocity. The slope is the better one of
    two: force over k_d, or slide position against drive position.
    """
    sensors = rig.sensors
    force_noise_N = math.hypot(sensors.force_noise_N, sensors.force_resolution_N / math.sqrt(12.0))
    position_noise_m = math.hypot(sensors.position_noise_m, sensors.position_resolution_m / math.sqrt(12.0))
    noise_m2 = min((force_noise_N / rig.drive.stiffness_N_per_m) ** 2, 2.0 * position_noise_m**2)
    return 12.0 * _SIGMAS**2 * noise_m2 * rig.solver.block_s / rig.solver.samples_per_block


def build(
    rig: RigConfig, slowest_mps: float, enabled_from_s: float, velocity_max_mps: float, blind: int
) -> tuple[Records, Records]:
    """Parameters and empty memory of the judge of one run.

    Args:
        slowest_mps: slowest feed of the run.
        enabled_from_s: time from which the controller may vibrate.
        velocity_max_mps: largest v_a that the controller may command.
        blind: number of the reason BLIND; -1 where the controller has none.

    """
    params, state = record(PARAMS), record(STATE)
    p: Any = params[0]
    s: Any = state[0]
    contact, solver, piezo = rig.contact, rig.solver, rig.piezo
    p.samples, p.block_s, p.sample_s = (
        solver.samples_per_block,
        solver.block_s,
        solver.block_s / solver.samples_per_block,
    )
    p.moves_mps, p.floor_mps, p.k_d = _MOVES * slowest_mps, _FLOOR * slowest_mps, rig.drive.stiffness_N_per_m
    p.swing_N = contact.static_force_N - contact.coulomb_force_N
    p.breakaway_m = contact.static_force_N / contact.stiffness_N_per_m
    p.slip_ratio = _SLIP if contact.static_force_N > 1.01 * contact.coulomb_force_N else _BESIDE_SPRING
    p.natural_s = 2.0 * math.pi * math.sqrt(rig.slide.mass_kg / p.k_d)
    p.window_s = min(1e-3, max(0.25 * p.natural_s, 4.0 * p.sample_s))
    p.hold_s = max(0.01, p.natural_s)
    p.seen_m2s = seen_m2s(rig)
    p.enabled_from_s = enabled_from_s
    p.late_blocks = round(rig.loop.longest_s(p.block_s) / p.block_s) + 1  # from a measurement to the block it acts on
    p.stiff_stick_s = _STIFF_BLOCKS * p.block_s
    p.amplitude_max_m, p.velocity_max_mps = piezo.amplitude_max_m, velocity_max_mps
    p.slew_m_per_s = piezo.amplitude_slew_m_per_s if piezo.amplitude_slew_m_per_s > 0.0 else math.inf
    p.blind_reason = blind
    s.dir, s.first_s, s.announced_s = 1.0, -1.0, -1.0
    for name in ("stopped_s", "began_s", "dragged_s", "end_s", "released_s", "quiet_s", "excite_begin_s"):
        s[name] = _NEVER
    s.reason_s[:] = -1.0
    return params, state
