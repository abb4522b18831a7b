"""Rigs with effects, run by the block: shared by the tests of the effects."""

import math
from types import SimpleNamespace

import numpy as np

from bridge.config import validate
from bridge.wire.channels import CHANNELS
from plant.config import RigConfig
from plant.core import advance, advance_disturbed
from plant.records import TRUTH, build
from plant.simulate import run_blocks

BLOCK_S = 1e-3
TAU = 2.0 * math.pi
# heavy enough to keep the velocity of the test; light enough to see friction in its inertia
HEAVY_KG = 1e9
NO_FRICTION = {
    "stiffness_N_per_m": 1.0,
    "damping_Ns_per_m": 0.0,
    "coulomb_force_N": 1e-9,
    "static_force_N": 1e-9,
}


def rig(effects=None, **tables):
    """The paper's steel pair, the piezo at once, the sensors' filters wide open."""
    table = {
        "contact": {"pair": "C45-C45 @ 0.063"},
        "piezo": {"amplitude_slew_m_per_s": 0.0},
        "sensors": {"force_bandwidth_Hz": 1e9, "accel_bandwidth_Hz": 1e9, "accel_lowest_Hz": 1e-9},
        "effects": effects or {},
    }
    return validate(RigConfig, table | tables, "test")


def run(config, drive, start=None, frequency_Hz=0.0, amplitude_m=0.0, force_driven=False):
    """Run a block for every value of `drive`, from the state `start`; returns every row by its name, and the time."""
    params, state = build(config)
    if force_driven:
        params[0].force_driven = params[0].disturbed = 1
    for name, value in (start or {}).items():
        state[0][name] = value
    drive = np.asarray(drive, float)
    samples = config.solver.samples_per_block * len(drive)
    analogue, truth = np.empty((len(CHANNELS), samples)), np.empty((len(TRUTH), samples))
    on = np.ones(len(drive))
    run_blocks(params, state, drive, on * frequency_Hz, on * amplitude_m, analogue, truth)
    t_s = (np.arange(samples) + 1) * config.solver.block_s / config.solver.samples_per_block
    return SimpleNamespace(
        t_s=t_s, **dict(zip(CHANNELS, analogue, strict=True)), **dict(zip(TRUTH, truth, strict=True))
    )


def towed(effects, velocity_mps, duration_s, contact=None):
    """Steady sliding at a velocity, towed by a slack spring: the friction at every moment after the first 20 ms.

    Without the bristle's damping, which leads a changing friction by h_t / k_t = 0.28 ms.
    """
    pair = {"pair": "C45-C45 @ 0.063", "damping_Ns_per_m": 0.0} | (contact or {})
    config = rig(effects, slide={"mass_kg": HEAVY_KG}, contact=pair)
    start = {"v": velocity_mps, "v_r": velocity_mps, "v_lag": velocity_mps}
    result = run(config, np.full(round(duration_s / BLOCK_S), velocity_mps), start)
    for name, row in vars(result).items():
        setattr(result, name, row[400:])
    return result


def stribeck_N(contact, v_mps):
    """The nominal friction of steady sliding."""
    F_c, F_s, v_s = contact.coulomb_force_N, contact.static_force_N, contact.stribeck_velocity_mps
    return F_c + (F_s - F_c) * np.exp(-((v_mps / v_s) ** 2))


def advance_by(kernel, config, blocks, drive, frequency_Hz=0.0, amplitude_m=0.0):
    """The bytes of every row after `blocks` blocks in one of the two kernels."""
    params, state = build(config)
    samples = config.solver.samples_per_block
    analogue, truth = np.empty((len(CHANNELS), samples)), np.empty((len(TRUTH), samples))
    rows = []
    for _ in range(blocks):
        kernel(params, state, drive, frequency_Hz, amplitude_m, analogue, truth)
        rows.append(np.concatenate([analogue, truth]))
    return np.concatenate(rows, axis=1)


NOMINAL, DISTURBED = advance, advance_disturbed
