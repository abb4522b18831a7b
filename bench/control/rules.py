"""The rivals of the controller: rules of a few lines that a machine builder would try first.

They have the controller's interface without its estimator. v_d is the plain slope of the drive position, in both directions; a
rule that needs the exciter's gain assumes 1. Only `CONSTANT` and `ORACLE` know the truth: they hold a ratio of the
true v_d with the true gain, `CONSTANT` for the search of the least ratio without slips, `ORACLE` for the limit of any controller
(`bench.control.oracle`).
"""

import math
from typing import Any, Final

import numpy as np

from bridge.arrays import Records
from bridge.kernel import Record, kernel, record
from bridge.wire.stickslip_pb2 import EXCITE, HELD, NOTHING_TO_DO, SMOOTH, WATCH
from plant.config import RigConfig
from plant.piezo import delivered_share
from plant.records import build as plant_records

CONTROLLER, NONE, MOVING, ALWAYS, FIXED, BURST, CONSTANT, ORACLE = range(8)
NAMES: Final = {
    CONTROLLER: "controller",
    NONE: "no control",
    MOVING: "1.2 v_d whenever it moves",
    ALWAYS: "always on, at the stroke limit",
    FIXED: "fixed 4 kHz, as in the paper",
    BURST: "acceleration threshold",
    CONSTANT: "constant v_a / v_d",
    ORACLE: "oracle",
}
RIVALS: Final = (NONE, MOVING, ALWAYS, FIXED, BURST)

_RATIO = 1.2  # v_a / v_d of the rules that follow v_d
_WINDOW_S, _LONGEST_WINDOW = 0.04, 64  # window of the slope of the drive position [s]; its limit in blocks
_PAPER_HZ, _PAPER_M = 4000.0, 2e-8  # frequency and amplitude of FIXED, as in the paper
_BURST_SIGMA, _LEAST_BURST_MPS2 = 8.0, 0.2  # threshold of a block's rms acceleration: over its noise, least
_BURST_HOLD_S, _BURST_BLANK_S = 10.0, 0.2  # vibration after a burst; then time without bursts, as the exciter fades
_SIGMAS = 5.0  # sigmas of the noise of the measured v_d from which the drive moves
_ABOVE_RESONANCE = 2.2  # frequency over contact resonance; below, the v_a / v_d needed depends on the damping
_STROKE_SHARE = 0.8  # largest share of the stroke that a chosen frequency may need for the wanted v_a
_CANDIDATES = 128  # most frequencies to choose from
TWO_PI = 2.0 * math.pi

PARAMS = np.dtype(
    [
        (name, "f8")
        for name in (
            *("block_s", "ratio", "amplitude_max_m", "velocity_max_mps", "least_mps", "burst_mps2"),
            *("fixed_Hz", "fixed_m"),
        )
    ]
    + [(name, "i8") for name in ("rule", "samples", "window_blocks", "enabled_from_ns", "hold_steps", "blank_steps")]
    + [("candidates", "i8")]
    + [("candidate_Hz", "f8", (_CANDIDATES,))],
    align=True,
)
STATE = np.dtype(
    [("position_m", "f8", (_LONGEST_WINDOW,)), ("velocity_mps", "f8"), ("frequency_Hz", "f8"), ("amplitude_m", "f8")]
    + [(name, "i8") for name in ("at", "count", "hold", "steps")],
    align=True,
)


def frequencies_Hz(rig: RigConfig, forbidden_Hz: list[tuple[float, float]]) -> list[float]:
    """Multiples of 100 Hz inside the exciter's range and outside the forbidden bands, above the contact resonance if possible."""
    piezo = rig.piezo
    resonance_Hz = math.sqrt(rig.contact.stiffness_N_per_m / rig.slide.mass_kg) / TWO_PI
    first = math.ceil(max(piezo.frequency_min_Hz, 100.0) / 100.0)
    all_Hz = [100.0 * n for n in range(first, math.floor(piezo.frequency_max_Hz / 100.0) + 1)]
    free_Hz = [f_Hz for f_Hz in all_Hz if not any(low <= f_Hz <= high for low, high in forbidden_Hz)]
    above_Hz = [f_Hz for f_Hz in free_Hz if f_Hz >= _ABOVE_RESONANCE * resonance_Hz]
    return (above_Hz or free_Hz[-1:])[:_CANDIDATES]


def frequency_Hz(rig: RigConfig, candidates_Hz: list[float], ratio: float = _RATIO) -> float:
    """The lowest candidate whose true v_a suffices at the highest speed of the profile; else the candidate of largest v_a.

    Args:
        ratio: v_a / v_d that the stroke must allow.

    """
    p: Any = plant_records(rig)[0][0]
    fastest_mps = max(rig.drive.speeds_mps(), default=0.0)
    stroke_m = _STROKE_SHARE * rig.piezo.amplitude_max_m
    top_mps = {f_Hz: float(delivered_share(p, f_Hz)) * TWO_PI * f_Hz * stroke_m for f_Hz in candidates_Hz}
    enough_Hz = [f_Hz for f_Hz in candidates_Hz if top_mps[f_Hz] >= ratio * fastest_mps]
    return enough_Hz[0] if enough_Hz else max(candidates_Hz, key=lambda f_Hz: top_mps[f_Hz])


def build(
    rule: int,
    rig: RigConfig,
    enabled_from_s: float,
    velocity_max_mps: float,
    candidates_Hz: list[float],
    ratio: float = _RATIO,
) -> tuple[Records, Records]:
    """Parameters and empty memory of a rule.

    Args:
        candidates_Hz: the frequencies that the rule may choose from, lowest first.
        ratio: v_a / v_d, for the rules that follow v_d.

    """
    params, solver, sensors = record(PARAMS), rig.solver, rig.sensors
    p: Any = params[0]
    p.rule, p.block_s, p.samples, p.ratio = rule, solver.block_s, solver.samples_per_block, ratio
    p.amplitude_max_m, p.velocity_max_mps = rig.piezo.amplitude_max_m, velocity_max_mps
    p.window_blocks = min(max(round(_WINDOW_S / solver.block_s), 4), _LONGEST_WINDOW)
    p.enabled_from_ns = round(enabled_from_s * 1e9)
    n = p.window_blocks
    noise_m = math.hypot(sensors.position_noise_m, sensors.position_resolution_m / math.sqrt(12.0))
    p.least_mps = _SIGMAS * noise_m * math.sqrt(12.0 / (solver.samples_per_block * n * (n * n - 1))) / solver.block_s
    p.burst_mps2 = max(_BURST_SIGMA * sensors.accel_noise_mps2, _LEAST_BURST_MPS2)
    p.hold_steps = round(_BURST_HOLD_S / solver.block_s)
    p.blank_steps = round(_BURST_BLANK_S / solver.block_s)
    p.candidates = len(candidates_Hz)
    p.candidate_Hz[: p.candidates] = candidates_Hz
    p.fixed_Hz, p.fixed_m = _PAPER_HZ, _PAPER_M
    state = record(STATE)
    state[0].hold = -p.blank_steps
    return params, state


@kernel
def _velocity_mps(p: Record, s: Record, position_m: float) -> float:
    """Least-squares slope of the mean positions of the last blocks [m/s]; 0 with fewer than 4."""
    s.position_m[s.at] = position_m
    s.at = (s.at + 1) % _LONGEST_WINDOW
    s.count = min(s.count + 1, p.window_blocks)
    n = s.count
    if n < 4:
        return 0.0
    total = 0.0
    for i in range(n):
        total += (i - 0.5 * (n - 1)) * s.position_m[(s.at - n + i) % _LONGEST_WINDOW]
    return 12.0 * total / (p.block_s * n * (n * n - 1.0))


@kernel
def _burst_mps2(mass_accel_mps2: Record) -> float:
    """Rms of the slide's acceleration over a block."""
    total = 0.0
    for i in range(mass_accel_mps2.shape[0]):
        total += float(mass_accel_mps2[i]) * float(mass_accel_mps2[i])
    return math.sqrt(total / mass_accel_mps2.shape[0])


@kernel
def step(
    params: Records,
    state: Records,
    sensors: Records,
    t_ns: int,
    known_mps: float,
    gain: float,
    command: Records,
    trace: Records,
) -> None:
    """Answer one sensor block by a rule, in place of `controller.core.step`.

    Args:
        params, state: one record each of `PARAMS` and `STATE`, the state is advanced.
        sensors, command, trace: one message record each; the last two are filled.
        known_mps: true |v_d| for which to vibrate, used by `CONSTANT` and `ORACLE` alone.
        gain: true v_a for one metre of commanded amplitude [1/s], used by these two alone.

    """
    p: Record = params[0]
    s: Record = state[0]
    block: Record = sensors[0]
    position_m = 0.0
    for i in range(p.samples):
        position_m += float(block.drive_position_m[i])
    v_d = math.fabs(_velocity_mps(p, s, position_m / p.samples))
    v_d = v_d if v_d > p.least_mps else 0.0
    wanted_mps = 0.0
    amplitude_m = -1.0
    if t_ns >= p.enabled_from_ns:
        if p.rule == MOVING:
            wanted_mps = p.ratio * v_d
        elif p.rule >= CONSTANT:
            v_d = known_mps
            wanted_mps = p.ratio * v_d
        elif p.rule == ALWAYS:
            s.frequency_Hz = p.candidate_Hz[0]
            amplitude_m = min(p.amplitude_max_m, p.velocity_max_mps / (TWO_PI * s.frequency_Hz))
            wanted_mps = TWO_PI * s.frequency_Hz * amplitude_m
        elif p.rule == FIXED:
            s.frequency_Hz, amplitude_m = p.fixed_Hz, p.fixed_m
            wanted_mps = TWO_PI * p.fixed_Hz * p.fixed_m
        elif p.rule == BURST:
            s.hold -= 1
            if s.hold < -p.blank_steps and v_d > 0.0 and _burst_mps2(block.mass_accel_mps2) > p.burst_mps2:
                s.hold = p.hold_steps
            wanted_mps = p.ratio * v_d if s.hold > 0 else 0.0
    if amplitude_m < 0.0 and wanted_mps > 0.0:
        if s.amplitude_m == 0.0 or p.rule >= CONSTANT:
            s.frequency_Hz = p.candidate_Hz[p.candidates - 1]
            for i in range(p.candidates - 1, -1, -1):
                if wanted_mps / (TWO_PI * p.candidate_Hz[i]) <= _STROKE_SHARE * p.amplitude_max_m:
                    s.frequency_Hz = p.candidate_Hz[i]
        amplitude_m = wanted_mps / (gain if p.rule >= CONSTANT else TWO_PI * s.frequency_Hz)
        largest_m = min(p.amplitude_max_m, p.velocity_max_mps / (TWO_PI * s.frequency_Hz))
        amplitude_m = min(amplitude_m, largest_m)
    s.amplitude_m = max(amplitude_m, 0.0)
    mode = EXCITE if s.amplitude_m > 0.0 else WATCH

    c: Record = command[0]
    c.sequence = s.steps
    c.t_ns = t_ns
    c.block = block.sequence
    c.run = block.run
    c.frequency_Hz = s.frequency_Hz if s.frequency_Hz > 0.0 else p.candidate_Hz[0]
    c.amplitude_m = s.amplitude_m
    c.mode = mode
    c.reason = HELD if s.amplitude_m > 0.0 else NOTHING_TO_DO
    t: Record = trace[0]
    t.sequence = s.steps
    t.t_ns = t_ns
    t.block = block.sequence
    t.events = 1
    t.state = SMOOTH
    t.mode = mode
    t.reason = c.reason
    t.drive_velocity_mps = v_d
    t.wanted_velocity_mps = wanted_mps
    s.steps += 1
