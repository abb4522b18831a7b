"""The numbers a plant runs on: parameters derived once from the configuration, and everything that changes."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.kernel import record
from plant.config import RigConfig
from plant.effects.formulas import LAG_CELL_S, ageing_N
from plant.effects.library import LAG_ORDERS, LONGEST_DELAY, LONGEST_LAG_S

# Rows of the array that a block fills beside the sensors, one column a sample: what no sensor sees.
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
            *("amplitude_max_m", "frequency_min_Hz", "frequency_max_Hz", "amplitude_slew_m_per_s"),
            *("delivered_ratio", "mount_resonance_Hz", "mount_damping_ratio"),
            *("force_keep", "accel_keep", "accel_highpass_keep", "position_keep"),
            *("force_gain", "force_range_N", "force_noise_N", "force_resolution_N"),
            *("accel_range_mps2", "accel_noise_mps2", "accel_resolution_mps2"),
            *("position_range_m", "position_noise_m", "position_linearity", "position_resolution_m"),
            # the effects of `plant.effects`, all 0 in the nominal rig
            *("age_growth_N", "age_scale_s", "age_exponent", "age_settling_s", "age_length_m", "age_rested_N"),
            *("lag_s", "lag_dead_s", "lag_distance_m", "late_share"),
            "quadratic_Ns2_per_m2",
            *("position_ratio", "position_wavelength_m", "position_phase_rad", "position_sin_2", "position_cos_2"),
            *("position_other_share", "position_other_wavelength_m", "position_other_phase_rad", "position_seed"),
            "position_width",
            *("forward_ratio", "backward_ratio", "kinetic_backward_ratio"),
            *("load_ratio", "load_frequency_Hz", "load_phase_rad", "load_sin_2", "load_cos_2", "load_seed"),
            *("drift_per_s", "drift_ratio", "drift_settling_s", "drift_before_s"),
            *("roughness_ratio", "roughness_length_m", "roughness_seed", "elastic_ratio", "stribeck_tail"),
            *("hardening_per_m2", "knee_m", "knee_ratio", "gap_m", "relaxing_Ns_per_m", "relaxation_s"),
            *("ripple_ratio", "ripple_wavelength_m", "ripple_frequency_Hz", "ripple_phase_rad"),
            *("ripple_sin_2", "ripple_cos_2"),
            *("frame_m_per_N", "frame_Hz", "frame_damping_ratio", "base_m_per_N", "base_Hz", "base_damping_ratio"),
            *("mode_ratio", "rolloff_Hz", "rolloff_order", "sag_ratio", "sag_settling_s"),
            *("force_lag_s", "force_lag_order", "force_delay_s", "force_ratio", "force_bias_N"),
            *("force_drift_N_per_s", "force_drift_N", "force_settling_s", "mass_accel_ratio", "base_accel_ratio"),
        )
    ]
    + [
        (name, "i8")
        for name in (
            *("samples_per_block", "steps_per_sample", "block_ns", "command_timeout_blocks"),
            *("disturbed", "elasto_plastic", "force_driven"),
        )
    ],
    align=True,
)

# an effect that runs in the kernel is off while its switch is 0
_SWITCHES = (
    *("age_growth_N", "lag_s", "lag_dead_s", "lag_distance_m", "quadratic_Ns2_per_m2", "position_ratio"),
    *("forward_ratio", "backward_ratio", "kinetic_backward_ratio"),
    *("load_ratio", "drift_per_s", "drift_ratio", "roughness_ratio", "hardening_per_m2", "knee_ratio", "gap_m"),
    *("relaxing_Ns_per_m", "ripple_ratio"),
    *("frame_m_per_N", "base_m_per_N", "sag_ratio", "force_lag_s", "force_delay_s", "force_ratio"),
    *("force_bias_N", "force_drift_N_per_s", "force_drift_N", "mass_accel_ratio", "base_accel_ratio"),
)

_WAVE_SHAPE = ("phase_rad", "second_sin", "second_cos")
DELAY_LINE = LONGEST_DELAY + 2  # the delayed sample, the one before it, the one of now
LAG_LINE = round(LONGEST_LAG_S / LAG_CELL_S) + 2  # likewise

# x and z are kept half a step before v: the leapfrog of `contact`. `_f` marks what a sensor's filter remembers.
STATE = np.dtype(
    [("steps", "i8"), ("block", "i8"), ("command_block", "i8")]
    + [
        (name, "f8")
        for name in (
            *("s_d", "even_m", "x", "v", "z", "v_r", "g"),
            *("amplitude_m", "frequency_Hz", "phi", "commanded_m", "commanded_Hz"),
            *("force_f", "mass_accel_f", "mass_accel_slow_f", "base_accel_f", "base_accel_slow_f"),
            *("mass_position_f", "drive_position_f"),
            # what the effects remember
            *("age_s", "v_lag", "frame_m", "frame_mps", "base_m", "base_mps", "vibrating_s", "drive_N", "t_s"),
            "arm_N",
        )
    ]
    + [("force_lag", "f8", (max(LAG_ORDERS.values()),))]
    + [("delay_line", "f8", (DELAY_LINE,)), ("delay_at", "i8"), ("lag_line", "f8", (LAG_LINE,)), ("lag_at", "i8")],
    align=True,
)

NO_COMMAND = -1  # as the unsigned number of the wire: bridge.messages.NO_BLOCK


def _keep(bandwidth_Hz: float, period_s: float) -> float:
    """Share of its old value that a first-order low-pass keeps over one period, exact for a held input."""
    return math.exp(-2.0 * math.pi * bandwidth_Hz * period_s)


def build(config: RigConfig) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Derive the parameters and the state at rest, spring unloaded, from a rig configuration."""
    params = record(PARAMS)
    p: Any = params[0]
    contact, drive, piezo, sensors, solver = (
        config.contact,
        config.drive,
        config.piezo,
        config.sensors,
        config.solver,
    )
    p.m = config.slide.mass_kg
    p.k_d, p.h_d = drive.stiffness_N_per_m, drive.damping_Ns_per_m
    p.k_t, p.h_t, p.h_v = (
        contact.stiffness_N_per_m,
        contact.damping_Ns_per_m,
        contact.viscous_damping_Ns_per_m,
    )
    p.F_c, p.F_s, p.v_s = contact.coulomb_force_N, contact.static_force_N, contact.stribeck_velocity_mps
    p.dt_s = solver.step_s
    p.samples_per_block = solver.samples_per_block
    p.steps_per_sample = round(solver.block_s / (solver.step_s * solver.samples_per_block))
    for name in ("amplitude_max_m", "frequency_min_Hz", "frequency_max_Hz", "amplitude_slew_m_per_s"):
        p[name] = getattr(piezo, name)
    for name in ("delivered_ratio", "mount_resonance_Hz", "mount_damping_ratio"):
        p[name] = getattr(piezo, name)
    p.block_ns = round(solver.block_s * 1e9)
    p.command_timeout_blocks = round(piezo.command_timeout_s / solver.block_s)
    p.force_keep = _keep(sensors.force_bandwidth_Hz, solver.step_s)
    p.accel_keep = _keep(sensors.accel_bandwidth_Hz, solver.step_s)
    p.accel_highpass_keep = _keep(sensors.accel_lowest_Hz, solver.step_s)
    p.position_keep = _keep(sensors.position_bandwidth_Hz, solver.step_s)
    for name in ("force_gain", "force_range_N", "force_noise_N", "force_resolution_N"):
        p[name] = getattr(sensors, name)
    for name in ("accel_range_mps2", "accel_noise_mps2", "accel_resolution_mps2"):
        p[name] = getattr(sensors, name)
    for name in ("position_range_m", "position_noise_m", "position_linearity", "position_resolution_m"):
        p[name] = getattr(sensors, name)
    _add_effects(p, config)
    state = record(STATE)
    state[0].g = p.F_s
    state[0].frequency_Hz = p.frequency_max_Hz
    state[0].command_block = NO_COMMAND
    return params, state


def _add_effects(p: Any, config: RigConfig) -> None:
    """Fold the effects that only change a number into it; hand the others to the kernel."""
    contact = config.contact
    p.elasto_plastic = contact.backbone == "elasto-plastic"
    for name in ("stribeck_tail", "elastic_ratio", "roughness_ratio", "roughness_length_m", "roughness_seed"):
        p[name] = getattr(contact, name)
    p.position_seed = p.load_seed = -1.0
    p.age_scale_s = 1.0
    # ten reaches of the bristle: creep before breakaway leaves the contact its age, a slip of any size takes it
    p.age_length_m = 10.0 * contact.static_force_N / contact.stiffness_N_per_m
    # in whatever order the file names them: others are relative to these two
    first = ("static-level", "drive-stiffness")
    for name, table in sorted(config.effects.items(), key=lambda item: item[0] not in first):
        _add_effect(p, name, str(table["form"]), {key: float(value) for key, value in table.items() if key != "form"})
    # friction that falls below a third within a step needs the guard that only that kernel has; so does a bristle whose damper,
    # as friction falls, could turn the slide around within a step: at 6.6 times that a slip came 0.37 s late, guarded 0.3 ms
    falls = p.F_s > 3.0 * p.F_c or p.h_t * (p.F_s / p.F_c - 1.0) * p.dt_s > p.m
    p.disturbed = p.elasto_plastic or falls or any(p[name] != 0.0 for name in _SWITCHES)


def _add_effect(p: Any, name: str, form: str, value: dict[str, float]) -> None:
    if name == "static-friction-ageing":
        p.age_growth_N = value["ratio"] * p.F_s
        p.age_scale_s, p.age_exponent = value.get("age_scale_s", 1.0), value.get("exponent", 0.0)
        p.age_settling_s = value.get("settling_s", 0.0)
        p.age_rested_N = ageing_N(p, value.get("rested_s", 0.0))
    elif name == "frictional-lag":
        p.lag_s, p.lag_dead_s = value.get("lag_s", 0.0), value.get("delay_s", 0.0)
        p.lag_distance_m = value.get("distance_m", 0.0)
        p.late_share = value.get("share", 0.0) * (p.lag_dead_s > 0.0 or p.lag_distance_m > 0.0)
    elif name == "viscous-friction":
        p.h_v += value.get("damping_Ns_per_m", 0.0)
        p.quadratic_Ns2_per_m2 = value.get("damping_Ns2_per_m2", 0.0)
    elif name == "position-dependent-friction":
        p.position_ratio, p.position_wavelength_m = value["ratio"], value["wavelength_m"]
        p.position_phase_rad, p.position_sin_2, p.position_cos_2 = (value.get(key, 0.0) for key in _WAVE_SHAPE)
        p.position_width = value.get("width", 0.0)
        p.position_other_share = value.get("other_share", 0.0)
        p.position_other_wavelength_m = value.get("other_wavelength_m", 0.0)
        p.position_other_phase_rad = value.get("other_phase_rad", 0.0)
        p.position_seed = value.get("seed", -1.0)
    elif name == "direction-dependent-friction":
        if form == "kinetic":
            p.kinetic_backward_ratio = value["ratio"]
        else:
            p.forward_ratio = 0.5 * value["ratio"] if form == "both" else 0.0
            p.backward_ratio = -0.5 * value["ratio"] if form == "both" else value["ratio"]
    elif name == "normal-load-fluctuation":
        p.load_ratio, p.load_frequency_Hz = value["ratio"], value["frequency_Hz"]
        p.load_phase_rad, p.load_sin_2, p.load_cos_2 = (value.get(key, 0.0) for key in _WAVE_SHAPE)
        p.load_seed = value.get("seed", -1.0)
    elif name == "friction-drift":
        p.drift_per_s = value.get("rate_per_s", 0.0)
        p.drift_ratio, p.drift_settling_s = value.get("ratio", 0.0), value.get("settling_s", 0.0)
        p.drift_before_s = value.get("before_s", 0.0)
    elif name == "coulomb-level":
        p.F_c *= 1.0 + value["ratio"]
    elif name == "static-level":
        p.F_s *= 1.0 + value["ratio"]
    elif name == "stribeck-velocity":
        p.v_s *= 1.0 + value["ratio"]
    elif name == "drive-damping":
        if form == "viscous":
            p.h_d += value["damping_Ns_per_m"]
        else:
            p.relaxing_Ns_per_m, p.relaxation_s = value["damping_Ns_per_m"], value["relaxation_s"]
    elif name == "drive-stiffness":
        p.k_d *= 1.0 + value["ratio"]
    elif name == "drive-hardening":
        p.hardening_per_m2 = value["ratio"] * 1e6 if form == "cubic" else 0.0
        p.knee_m, p.knee_ratio = value.get("knee_m", 0.0), value["ratio"] if form == "bilinear" else 0.0
    elif name == "drive-backlash":
        p.gap_m = value["gap_m"]
    elif name == "drive-speed-ripple":
        p.ripple_ratio = value["ratio"]
        p.ripple_phase_rad, p.ripple_sin_2, p.ripple_cos_2 = (value[key] for key in _WAVE_SHAPE)
        p.ripple_wavelength_m, p.ripple_frequency_Hz = value.get("wavelength_m", 0.0), value.get("frequency_Hz", 0.0)
    elif name == "frame-compliance":
        p.frame_m_per_N = value["ratio"] / p.k_d
        p.frame_Hz, p.frame_damping_ratio = value["frequency_Hz"], value["damping_ratio"]
    elif name == "base-compliance":
        p.base_m_per_N = value["compliance_m_per_N"]
        p.base_Hz, p.base_damping_ratio = value["frequency_Hz"], value["damping_ratio"]
    elif name == "piezo-roll-off":
        p.rolloff_Hz, p.rolloff_order = value["corner_Hz"], 1.0 if form == "first-order" else 2.0
    elif name == "piezo-resonance":
        p.mount_resonance_Hz, p.mount_damping_ratio = value["resonance_Hz"], value["damping_ratio"]
        if form == "mode":
            p.mode_ratio = value["ratio"]
            p.mount_resonance_Hz *= value["ratio"] > 0.0  # a mode that takes no part leaves a rigid mount
    elif name == "piezo-sag":
        p.sag_ratio, p.sag_settling_s = value["ratio"], value.get("settling_s", 0.0)
    elif name == "force-sensor-gain":
        p.force_ratio = value["ratio"]
    elif name == "force-sensor-bias":
        p.force_bias_N = value["bias_N"]
    elif name == "force-sensor-drift":
        p.force_drift_N_per_s = value.get("rate_N_per_s", 0.0)
        p.force_drift_N, p.force_settling_s = value.get("drift_N", 0.0), value.get("settling_s", 0.0)
    elif name == "force-sensor-lag":
        p.force_lag_s, p.force_lag_order = value["lag_s"], LAG_ORDERS[form]
    elif name == "force-sensor-delay":
        p.force_delay_s = value["delay_s"]
    elif name == "accelerometer-gain":
        p.mass_accel_ratio = 0.0 if form == "base" else value["ratio"]
        p.base_accel_ratio = 0.0 if form == "mass" else value["ratio"]
