"""The numbers a plant runs on: parameters derived once from the configuration, and everything that changes."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.kernel import record
from plant.config import RigConfig

# Rows of the array that a block fills, one column a sample. The first five are the sensors of the rig, in the order of
# the wire; the others are what no sensor sees.
CHANNELS = ("drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m")
TRUTH = (
    "true_drive_force_N",
    "true_friction_force_N",
    "true_velocity_mps",
    "true_bristle_m",
    "true_position_m",
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
        )
    ]
    + [(name, "i8") for name in ("samples_per_block", "steps_per_sample", "block_ns", "command_timeout_blocks")],
    align=True,
)

# x and z are kept half a step before v: the leapfrog of `contact`. `_f` marks what a sensor's filter remembers.
STATE = np.dtype(
    [("steps", "i8"), ("block", "i8"), ("command_block", "i8")]
    + [
        (name, "f8")
        for name in (
            *("s_d", "x", "v", "z", "v_r", "g"),
            *("amplitude_m", "frequency_Hz", "phi", "commanded_m", "commanded_Hz"),
            *("force_f", "mass_accel_f", "mass_accel_slow_f", "base_accel_f", "base_accel_slow_f"),
            *("mass_position_f", "drive_position_f"),
        )
    ],
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
    state = record(STATE)
    state[0].g = p.F_s
    state[0].frequency_Hz = p.frequency_max_Hz
    state[0].command_block = NO_COMMAND
    return params, state
