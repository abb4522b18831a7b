"""Simulation of a run of a synthetic rig: from a random start, by its plan, to the columns of its file."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from bridge.wire.channels import CHANNELS
from diagnosis.features.grid import BLOCK_S
from diagnosis.synthetic.protocols import AxisPlan, RunPlan
from diagnosis.synthetic.sensors import DrawnChain, measured
from plant.config import RigConfig
from plant.core import advance_disturbed
from plant.effects.drive import even_m, extension_m
from plant.records import TRUTH, build
from plant.simulate import run_blocks

Columns = dict[str, npt.NDArray[Any]]

_SAME_PLACE_M = 2e-5  # standard deviation of the position at which a run starts
_PRIMER_M = 1e-15  # amplitude that turns the exciter's phase without moving the rig


class DrawnRig(NamedTuple):
    """The drawn rig, which is measured."""

    config: RigConfig
    chain: DrawnChain
    rate_Hz: float  # sampling rate of the simulation
    average: int  # samples of the simulation in each sample of the record


def spring_run(random: np.random.Generator, rig: DrawnRig, plan: RunPlan, start_m: float) -> Columns:
    """Drag the slide by a spring, from about `start_m` on; return the columns of the run, [samples] each, SI units."""
    params, state = build(rig.config)
    blocks = round(plan.duration_s / BLOCK_S)
    force_N = random.uniform(0.3, 0.95) * float(params[0].F_c)
    _at_rest(random, params, state, force_N, start_m + random.normal(0.0, _SAME_PLACE_M))
    points = np.array(plan.velocity)
    velocity_mps = np.interp(np.arange(blocks) * BLOCK_S, points[:, 0], points[:, 1])
    frequency_Hz, amplitude_m = np.zeros(blocks), np.zeros(blocks)
    for step in plan.vibration:
        at = round(step.from_s / BLOCK_S)
        frequency_Hz[at:], amplitude_m[at:] = step.frequency_Hz, step.amplitude_m
    analogue = np.empty((len(CHANNELS), blocks * round(rig.rate_Hz * BLOCK_S)))
    truth = np.empty((len(TRUTH), analogue.shape[1]))
    commanded_Hz, commanded_m = _primed(random, frequency_Hz, amplitude_m)
    run_blocks(params, state, velocity_mps, commanded_Hz, commanded_m, analogue, truth)
    rows = _averaged(measured(random, rig.chain, analogue, rig.rate_Hz), rig.average)
    columns: Columns = {"t_s": np.arange(rows.shape[1]) * rig.average / rig.rate_Hz}
    columns |= {name: values.astype(np.float32) for name, values in zip(CHANNELS, rows, strict=True)}
    if plan.vibration:
        block = (columns["t_s"] / BLOCK_S + 1e-6).astype(np.int64)
        columns["vibration_frequency_Hz"] = frequency_Hz[block]
        columns["vibration_amplitude_m"] = amplitude_m[block]
    return columns


def axis_run(random: np.random.Generator, rig: DrawnRig, plan: AxisPlan) -> Columns:
    """Move the mass to and fro by a motor with a PD controller; return the columns, [samples of the controller] each.

    The force of a sample acts from the time of that sample to the next.
    """
    params, state = build(rig.config)
    p: Any = params[0]
    p.disturbed = p.force_driven = 1
    blocks = round(plan.duration_s / BLOCK_S)
    middle_m = random.uniform(0.4, 0.6) * float(p.position_range_m)
    _at_rest(random, params, state, 0.0, middle_m + random.normal(0.0, 1e-3))
    t_s = np.arange(blocks) * BLOCK_S
    swing_m = np.zeros(blocks)
    for size_m, frequency_Hz in plan.sines:
        swing_m += size_m * np.sin(2.0 * math.pi * frequency_Hz * t_s + random.uniform(0.0, 2.0 * math.pi))
    # the motion starts from rest without a jerk
    wanted_m = middle_m + swing_m * np.square(np.sin(0.5 * math.pi * np.minimum(t_s / 1.5, 1.0)))
    omega = 2.0 * math.pi * 3.0  # natural frequency of the closed loop, well damped
    stiffness_N_per_m, damping_Ns_per_m = float(p.m * omega * omega), float(1.4 * p.m * omega)
    limit_N = 0.8 * float(p.force_range_N)
    samples = round(rig.rate_Hz * BLOCK_S)
    analogue, truth = np.empty((len(CHANNELS), samples)), np.empty((len(TRUTH), samples))
    rows = np.empty((len(CHANNELS), blocks))
    wanted_mps = np.gradient(wanted_m, BLOCK_S)
    s: Any = state[0]
    for block in range(blocks):
        force_N = stiffness_N_per_m * (wanted_m[block] - s.x) + damping_Ns_per_m * (wanted_mps[block] - s.v)
        rows[3, block] = s.mass_position_f
        advance_disturbed(params, state, min(max(float(force_N), -limit_N), limit_N), 0.0, 0.0, analogue, truth)
        rows[:3, block] = analogue[:3, -1]
    rows[4] = rows[3]
    columns: Columns = {"t_s": t_s}
    seen = measured(random, rig.chain, rows, 1.0 / BLOCK_S)
    return columns | {"drive_force_N": seen[0].astype(np.float32), "mass_position_m": seen[3].astype(np.float32)}


def _at_rest(random: np.random.Generator, params: Any, state: Any, force_N: float, position_m: float) -> None:
    """Set the state to a slide at rest under a spring force, consistent with springs, sensors and delays."""
    p, s = params[0], state[0]
    s.x, s.z = position_m, force_N / p.k_t
    s.age_s = random.uniform(1.0, 30.0)
    s.frame_m, s.base_m = force_N * p.frame_m_per_N, force_N * p.base_m_per_N
    s.s_d = position_m + s.frame_m + extension_m(p, force_N)
    s.even_m = even_m(p, s.s_d)
    s.drive_N = s.force_f = force_N
    s.force_lag[:] = force_N
    s.delay_line[:] = force_N
    s.mass_position_f, s.drive_position_f = s.x, s.s_d


def _primed(random: np.random.Generator, frequency_Hz: Floats, amplitude_m: Floats) -> tuple[Floats, Floats]:
    """The commands to the piezo, with a block of `_PRIMER_M` before each start, which shifts the phase by a random angle."""
    commanded_Hz, commanded_m = frequency_Hz.copy(), amplitude_m.copy()
    for start in np.flatnonzero((amplitude_m[1:] > 0.0) & (amplitude_m[:-1] == 0.0)):
        commanded_Hz[start] = random.uniform(0.5, 1.5) / BLOCK_S
        commanded_m[start] = _PRIMER_M
    return commanded_Hz, commanded_m


def _averaged(rows: Floats, average: int) -> Floats:
    return rows if average == 1 else rows.reshape(len(rows), -1, average).mean(axis=2)
