"""Protocols of made evidence beside the ladder, and a force-driven axis."""

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from bridge.config import validate
from bridge.wire.channels import CHANNELS
from diagnosis.features.grid import BLOCK_S
from diagnosis.synthetic.folder import Case, Numbers
from diagnosis.synthetic.runs import LADDER, RATE_HZ, DrawnRig, RunPlan, at_rest, constant, measured, steps, vibration
from plant.config import RigConfig
from plant.core import advance_disturbed
from plant.records import TRUTH, build


class AxisPlan(NamedTuple):
    """A run of a force-driven axis: the position follows a sum of sines, [amplitude m, frequency Hz] each."""

    sines: tuple[tuple[float, float], ...]
    duration_s: float = 12.0
    holdout: bool = False
    track: int = 0
    velocity = ()  # it differs all the time

    def columns(self, random: np.random.Generator, rig: DrawnRig, _start_m: float) -> dict[str, Any]:
        return axis_run(random, rig, self)


PROTOCOLS: Final[dict[str, tuple[RunPlan, ...]]] = {
    "ladder": LADDER,
    # "ladder" in a third of the time, with dwells of 0.25 to 0.8 s only
    "short": (
        RunPlan(steps((0.0, 0.002), (2.5, -0.002)), duration_s=5.0, track=0),
        RunPlan(constant(0.0006), vibration((1.5, 3000.0), (2.7, 1200.0), (3.9, 4500.0)), duration_s=5.0, track=1),
        RunPlan(constant(0.0015), vibration((2.5, 2500.0)), duration_s=4.0, holdout=True, track=2),
    ),
    "constant": (
        RunPlan(constant(0.0005), track=0),
        RunPlan(constant(0.002), track=1),
        RunPlan(constant(0.0005), vibration((2.0, 3000.0)), track=2),
        RunPlan(constant(0.001), vibration((2.0, 2000.0)), holdout=True, track=3),
    ),
    # the paper's procedure: the slide returns to the same position before each run
    "paper": (
        RunPlan(constant(0.0005)),
        RunPlan(constant(0.0005), vibration((4.0, 2000.0))),
        RunPlan(constant(0.0005), vibration((4.0, 4000.0))),
        RunPlan(constant(0.0005), vibration((4.0, 3000.0)), holdout=True),
    ),
    "slow": (
        RunPlan(constant(0.0001), duration_s=30.0, track=0),
        RunPlan(constant(0.0005), track=1),
        RunPlan(constant(0.002), duration_s=6.0, track=2),
        RunPlan(constant(0.001), holdout=True, track=3),
    ),
}
# fast and long; fast and short; slow, with a stick at each turn; and a mixture, held out. Peak speeds of 0.04 to 0.16 m/s.
AXIS_PLANS: Final = (
    AxisPlan(((0.1, 0.25),)),
    AxisPlan(((0.02, 1.0),)),
    AxisPlan(((0.05, 0.125),)),
    AxisPlan(((0.07, 0.2), (0.015, 0.7)), holdout=True),
)


def case_of(protocol: str = "ladder", effects: Mapping[str, Numbers] | None = None, **more: Any) -> Case:
    """A case with the runs of a protocol."""
    if protocol == "force":
        return Case(AXIS_PLANS, effects or {}, axis_rig(), "force", **more)
    return Case(PROTOCOLS[protocol], effects or {}, **more)


def axis_rig() -> RigConfig:
    """A linear axis that is moved by a motor force."""
    contact = {
        "stiffness_N_per_m": 2e6,
        "damping_Ns_per_m": 2.0 * math.sqrt(2e6 * 95.0),  # critical damping of the presliding motion, as in the paper
        "viscous_damping_Ns_per_m": 200.0,
        "coulomb_force_N": 20.0,
        "static_force_N": 22.0,
        "stribeck_velocity_mps": 0.005,
    }
    sensors = {
        "force_range_N": 500.0,
        "force_resolution_N": 1000.0 / 2**16,
        "position_range_m": 1.0,
        "position_resolution_m": 1e-7,  # an encoder
        "position_linearity": 1e-5,
    }
    table = {"contact": contact, "slide": {"mass_kg": 95.0}, "sensors": sensors}
    return validate(RigConfig, table, "a linear axis")


def axis_run(random: np.random.Generator, rig: DrawnRig, plan: AxisPlan) -> dict[str, Any]:
    """Move the mass to and fro by a motor with a PD controller; return the columns, [samples of the controller] each.

    The force of a sample acts from the time of that sample to the next.
    """
    params, state = build(rig.config)
    p: Any = params[0]
    p.disturbed = p.force_driven = 1
    blocks = round(plan.duration_s / BLOCK_S)
    middle_m = random.uniform(0.4, 0.6) * float(p.position_range_m)
    at_rest(random, params, state, 0.0, middle_m + random.normal(0.0, 1e-3))
    t_s = np.arange(blocks) * BLOCK_S
    swing_m = np.zeros(blocks)
    for size_m, frequency_Hz in plan.sines:
        swing_m += size_m * np.sin(2.0 * math.pi * frequency_Hz * t_s + random.uniform(0.0, 2.0 * math.pi))
    # the motion starts from rest without a jerk
    wanted_m = middle_m + swing_m * np.square(np.sin(0.5 * math.pi * np.minimum(t_s / 1.5, 1.0)))
    omega = 2.0 * math.pi * 3.0  # natural frequency of the closed loop, well damped
    stiffness_N_per_m, damping_Ns_per_m = float(p.m * omega * omega), float(1.4 * p.m * omega)
    limit_N = 0.8 * float(p.force_range_N)
    samples = round(RATE_HZ * BLOCK_S)
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
    seen = measured(random, rig.chain, rows, 1.0 / BLOCK_S)
    return {"t_s": t_s, "drive_force_N": seen[0].astype(np.float32), "mass_position_m": seen[3].astype(np.float32)}
