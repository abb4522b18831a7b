"""The records of a plant: parameters derived once from the configuration, and the changing state."""

import math
from typing import Any

import numpy as np

from bridge.arrays import Records
from bridge.guard.absent import absent
from bridge.guard.config import GuardConfig, Level
from bridge.guard.core import NO_COMMAND
from bridge.guard.records import DRIVE_WINDOW_S, ExciterLimits
from bridge.guard.records import build as build_guard
from bridge.guard.wide import protection
from bridge.kernel import record
from plant.config import PiezoConfig, RigConfig, SensorsConfig
from plant.effects.library import EFFECTS
from plant.loop_delay import LINE
from plant.piezo import delivered_share

# Rows of the array of quantities without a sensor, one column per sample.
TRUTH = (
    "true_drive_force_N",
    "true_friction_force_N",
    "true_velocity_mps",
    "true_bristle_m",
    "true_position_m",
    "true_drive_position_m",
)

PARAMS = np.dtype(
    [
        (name, "f8")
        for name in (
            *("m", "k_d", "h_d", "k_t", "h_t", "h_v", "F_c", "F_s", "v_s", "dt_s"),
            *("force_keep", "accel_keep", "accel_highpass_keep", "position_keep"),
            # length of the longer steps while the slide sticks, and the filters' shares over such a step
            *("stick_dt_s", "force_keep_stick", "accel_keep_stick", "accel_highpass_keep_stick", "position_keep_stick"),
            *PiezoConfig.model_fields,
            *SensorsConfig.model_fields,
            # numbers of `plant.effects`, then of the contact's extensions; none acts in the nominal rig
            *(name for effect in EFFECTS.values() for name in (*effect.fields.values(), *effect.numbers)),
            *("age_length_m", "roughness_ratio", "roughness_length_m", "roughness_seed"),
            *("elastic_ratio", "stribeck_tail"),
            "always_on",  # 1: a fault makes the exciter vibrate while its enable line is off
        )
    ]
    + [
        (name, "i8")
        for name in (
            *("samples_per_block", "steps_per_sample", "steps_per_stick_sample", "block_ns"),
            *("disturbed", "elasto_plastic", "force_driven"),
        )
    ],
    align=True,
)

# x and z are kept half a step before v: the leapfrog of `contact`. `_f` marks the state of a sensor's filter.
STATE = np.dtype(
    [("block", "i8"), ("command_block", "i8"), ("sticks", "i8")]
    + [
        (name, "f8")
        for name in (
            *("s_d", "x", "v", "z", "v_r", "g", "drive_N", "t_s", "dt_s"),
            *("amplitude_m", "frequency_Hz", "phi", "commanded_m", "commanded_Hz"),
            *("force_f", "mass_accel_f", "mass_accel_slow_f", "base_accel_f", "base_accel_slow_f"),
            *("mass_position_f", "drive_position_f"),
        )
    ]
    + [field for effect in EFFECTS.values() for field in effect.memory]
    # the queue of delayed commands: `plant.loop_delay`
    + [("line_first", "i8"), ("line_count", "i8"), ("line_due", "i8", (LINE,)), ("line_block", "i8", (LINE,))]
    + [("line_Hz", "f8", (LINE,)), ("line_m", "f8", (LINE,))],
    align=True,
)

# Longest step while the slide sticks, in radians of the slide's swing on the bristles. From 2 on the leapfrog is unstable; at 1
# the swing is 4.7 % too fast, 2 asin(1/2) / 1. Smaller: stiff rigs take more steps.
_STICK_STEP_RAD = 1.0
_PEAK_SIGMAS = 6.0  # sigmas of the drive velocity's noise that its peaks reach in a long run
_SLOWEST_MPS = 1e-6  # fastest drive of a rig that never moves, as a limit must be above 0
# Least share of the command that sets the simulated rig's limit of v_a; a weaker exciter cannot help.
_LEAST_SHARE = 0.1


def _keep(bandwidth_Hz: float, period_s: float) -> float:
    """Share of the old value that a first-order low-pass keeps over one period, exact for a held input."""
    return math.exp(-2.0 * math.pi * bandwidth_Hz * period_s)


def set_load(params: Records, config: RigConfig, ratio: float) -> None:
    """Set both friction forces to `ratio` times the forces that `build` makes of `config`."""
    at_start, _ = build(config)
    for name in ("F_c", "F_s"):
        params[name] = ratio * at_start[name]


def build(config: RigConfig) -> tuple[Records, Records]:
    """Derive the parameters and the state at rest, spring unloaded, from a rig configuration."""
    params = record(PARAMS)
    p: Any = params[0]
    contact, drive, piezo = config.contact, config.drive, config.piezo
    sensors, solver = config.sensors, config.solver
    p.m = config.slide.mass_kg
    p.k_d, p.h_d = drive.stiffness_N_per_m, drive.damping_Ns_per_m
    p.k_t, p.h_t = contact.stiffness_N_per_m, contact.damping_Ns_per_m
    p.h_v = contact.viscous_damping_Ns_per_m
    p.F_c, p.F_s, p.v_s = contact.coulomb_force_N, contact.static_force_N, contact.stribeck_velocity_mps
    p.dt_s = solver.step_s
    p.samples_per_block = solver.samples_per_block
    p.steps_per_sample = round(solver.block_s / (solver.step_s * solver.samples_per_block))
    for table in (contact, piezo, sensors):
        for name in {*type(table).model_fields} & {*(PARAMS.names or ())}:
            p[name] = getattr(table, name)
    p.block_ns = round(solver.block_s * 1e9)
    sample_s = solver.block_s / solver.samples_per_block
    stiffest_per_s = math.sqrt((p.k_t + p.k_d) / p.m)
    p.steps_per_stick_sample = min(max(math.ceil(stiffest_per_s * sample_s / _STICK_STEP_RAD), 1), p.steps_per_sample)
    p.stick_dt_s = sample_s / p.steps_per_stick_sample
    for name, bandwidth_Hz in (
        ("force_keep", sensors.force_bandwidth_Hz),
        ("accel_keep", sensors.accel_bandwidth_Hz),
        ("accel_highpass_keep", sensors.accel_lowest_Hz),
        ("position_keep", sensors.position_bandwidth_Hz),
    ):
        p[name], p[f"{name}_stick"] = _keep(bandwidth_Hz, solver.step_s), _keep(bandwidth_Hz, p.stick_dt_s)
    _add_effects(p, config)
    state = record(STATE)
    state[0].g = p.F_s
    state[0].frequency_Hz = p.frequency_max_Hz
    state[0].command_block = NO_COMMAND
    return params, state


def simulated_guard(config: RigConfig) -> GuardConfig:
    """The guard of a simulated rig: an absolute limit that the rig file leaves out follows from its drive and its exciter."""
    guard, piezo, sensors = config.guard, config.piezo, config.sensors
    p: Any = build(config)[0][0]
    noise_m = math.hypot(sensors.position_noise_m, sensors.position_resolution_m) / math.sqrt(
        config.solver.samples_per_block
    )
    noise_mps = math.sqrt(2.0) * noise_m / DRIVE_WINDOW_S
    ripple = p.ripple_ratio + p.ripple_per_N * p.F_s
    driven_mps = (1.0 + ripple) * max(config.drive.speeds_mps(), default=0.0) + _PEAK_SIGMAS * noise_mps
    fastest_mps = guard.fastest_drive_mps or max(driven_mps, _SLOWEST_MPS)
    # An exciter that delivers less needs a larger command for the same v_a.
    frequencies_Hz = np.linspace(piezo.frequency_min_Hz, piezo.frequency_max_Hz, 50)
    least = (1.0 - p.sag_ratio) * min(delivered_share(p, frequency_Hz) for frequency_Hz in frequencies_Hz)
    largest_mps = fastest_mps / min(max(least, _LEAST_SHARE), 1.0)
    ratio = guard.velocity_ratio
    velocity = guard.velocity_mps or Level(alarm=ratio.alarm * largest_mps, abort=ratio.abort * largest_mps)
    return guard.model_copy(update={"fastest_drive_mps": fastest_mps, "velocity_mps": velocity})


def guard_records(config: RigConfig, run: int, arm: bool) -> tuple[Records, Records]:
    """Parameters and memory of the rig's guard; the other arguments are passed to `bridge.guard.records.build`."""
    return build_guard(simulated_guard(config), _exciter(config), run, arm, absent(config.channels))


def notes(config: RigConfig) -> list[tuple[str, str]]:
    """Codes and texts of the events at the start of a run: the limits and channels of a rig that protect less than usual."""
    return protection(
        config.guard, _exciter(config), simulated_guard(config).fastest_drive_mps or 0.0, absent(config.channels)
    )


def _exciter(config: RigConfig) -> ExciterLimits:
    return ExciterLimits.of(config.piezo, config.solver.block_s, config.solver.samples_per_block)


def _add_effects(p: Any, config: RigConfig) -> None:
    """Fold effects that only change a number into that number; pass the others to the kernel."""
    contact = config.contact
    p.elasto_plastic = contact.backbone == "elasto-plastic"
    # ten times the bristle's largest deflection: creep before breakaway keeps the age of the contact, any slip resets it
    p.age_length_m = 10.0 * contact.static_force_N / contact.stiffness_N_per_m
    for effect in EFFECTS.values():
        for name, number in effect.off.items():
            p[name] = number
    for name, table in sorted(config.effects.items(), key=lambda item: not EFFECTS[item[0]].first):
        value = {key: float(number) for key, number in table.items() if key != "form"}
        EFFECTS[name].apply(p, str(table["form"]), value)
    switches = (name for effect in EFFECTS.values() for name in (*effect.switches, *effect.sizes))
    # Friction that falls below a third within a step needs the guarded step of the disturbed kernel; so does a bristle whose
    # damper could reverse the slide within a step while friction falls: at 6.6 times this limit a slip is 0.37 s late, guarded
    # 0.3 ms.
    falls = p.F_s > 3.0 * p.F_c or p.h_t * (p.F_s / p.F_c - 1.0) * p.dt_s > p.m
    of_contact = p.elasto_plastic or p.roughness_ratio != 0.0
    p.disturbed = of_contact or falls or any(p[name] != 0.0 for name in switches)
