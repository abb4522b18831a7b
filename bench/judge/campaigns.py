"""Campaigns to train on: a described rig, the commands of its runs, and the channels that are missing.

Half of them are the paper's rig with the shortest of our protocols. The others have drawn numbers and commands, as sizes relative
to the spring: its reach under the static friction, the duration of a slip, and the dwell between two slips.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from bridge.config import validate
from diagnosis.hypotheses.hypothesis import Sizes
from diagnosis.synthetic.folder import paper_rig
from diagnosis.synthetic.runs import LADDER, RunPlan, Vibration, constant, steps
from plant.config import RigConfig

_PAPER = 0.5  # share of the paper's rig. More: better there. Less: better on rigs of other sizes
_OTHER_LAW = 0.2  # share of rigs with elasto-plastic friction, which no model of the diagnosis has
_MISSING = ((), (), ("mass_accel_mps2",), ("base_accel_mps2",), ("mass_accel_mps2", "base_accel_mps2"))
_DURATION_S = 10.0


class Campaign(NamedTuple):
    """The knowledge of a rig's owner before a run."""

    described: RigConfig
    plans: tuple[RunPlan, ...]
    leave_out: tuple[str, ...]

    @property
    def travel_m(self) -> float:
        """Longest way that the drive could go in a run."""
        return max(abs(speed_mps) * plan.duration_s for plan in self.plans for _, speed_mps in plan.velocity)

    @property
    def sizes(self) -> Sizes:
        """The scales of the catalogue's effects."""
        contact, mass_kg = self.described.contact, self.described.slide.mass_kg
        stiffness = self.described.drive.stiffness_N_per_m
        highest_Hz = max((step.frequency_Hz for plan in self.plans for step in plan.vibration), default=0.0)
        return Sizes(
            contact.static_force_N, stiffness, contact.static_force_N / stiffness, 2.0 * math.sqrt(stiffness * mass_kg),
            math.pi * math.sqrt(mass_kg / stiffness), 0.3 * contact.static_force_N / math.sqrt(stiffness * mass_kg),
            max(plan.duration_s for plan in self.plans), highest_Hz,
        )  # fmt: skip


def drawn_campaign(random: np.random.Generator) -> Campaign:
    """The paper's rig, or a rig of other sizes under other commands."""
    described, plans = paper_rig(), LADDER
    if random.random() > _PAPER:
        described, speed_mps, amplitude_m = _drawn_rig(random)
        plans = _drawn_plans(random, speed_mps, amplitude_m)
    table = described.model_dump()
    table["sensors"] |= {"force_lowest_N": -table["sensors"]["force_range_N"]}
    if random.random() < _OTHER_LAW:
        table["contact"] |= {"backbone": "elasto-plastic", "elastic_ratio": random.uniform(0.5, 0.9)}
    missing = _MISSING[int(random.integers(len(_MISSING)))]
    return Campaign(validate(RigConfig, table, "a drawn rig"), plans, missing)


def _drawn_rig(random: np.random.Generator) -> tuple[RigConfig, float, float]:
    """A rig, a speed of the drive at which it dwells for a second, and an amplitude of vibration that matters to it."""
    static_N = between(random, 1.0, 60.0)
    reach_m = between(random, 3e-4, 4e-3)
    stiffness = static_N / reach_m
    slip_s = between(random, 0.012, 0.08)
    mass_kg = stiffness * (slip_s / math.pi) ** 2
    coulomb_N = static_N / between(random, 1.06, 1.5)
    contact = stiffness * between(random, 300.0, 8000.0)
    slip_mps = (static_N - coulomb_N) / math.sqrt(stiffness * mass_kg)
    viscous = 0.02 * math.sqrt(stiffness * mass_kg) * max(random.uniform(-1.0, 1.0), 0.0)
    speed_mps = 2.0 * (static_N - coulomb_N) / stiffness
    range_m = max(0.05, 40.0 * _DURATION_S * speed_mps)
    table: dict[str, Any] = paper_rig().model_dump()
    table["slide"] = {"mass_kg": mass_kg}
    table["drive"] |= {"stiffness_N_per_m": stiffness}
    table["contact"] |= {
        "pair": "", "stiffness_N_per_m": contact, "viscous_damping_Ns_per_m": viscous, "coulomb_force_N": coulomb_N,
        "damping_Ns_per_m": 2.0 * math.sqrt(contact * mass_kg) * random.uniform(0.6, 1.2), "static_force_N": static_N,
        "stribeck_velocity_mps": slip_mps * between(random, 0.01, 0.06),
    }  # fmt: skip
    amplitude_m = 0.09 * static_N / contact * between(random, 0.5, 2.0)
    table["piezo"] |= {"amplitude_max_m": 1e-3, "amplitude_slew_m_per_s": 50.0 * amplitude_m}
    table["sensors"] |= {
        "force_range_N": 3.0 * static_N, "force_resolution_N": 3.0 * static_N / 2**16,
        "position_range_m": range_m, "position_resolution_m": range_m / 2**18,
    }  # fmt: skip
    return validate(RigConfig, table, "a drawn rig"), speed_mps, amplitude_m


def _drawn_plans(random: np.random.Generator, speed_mps: float, amplitude_m: float) -> tuple[RunPlan, ...]:
    """Two runs or three, even, to and fro with a slow end, or at two speeds; in half of the campaigns one more vibrates.

    The first one is held out.

    Speeds of a run are far apart, as a change of less than a half is not always seen in the drive's position.
    """

    def speed() -> float:
        return speed_mps / between(random, 0.2, 2.0)

    plans: list[RunPlan] = []
    for kind in random.permutation(3)[: int(random.integers(2, 4))].tolist():
        early, late = random.uniform(0.15, 0.4) * _DURATION_S, random.uniform(0.5, 0.7) * _DURATION_S
        first = speed()
        velocity = (
            constant(first),
            steps((0.0, first), (early, -first), (late, -between(random, 0.06, 0.3) * first)),
            steps((0.0, first), (late, between(random, 3.0, 6.0) * first)),
        )[kind]
        plans.append(RunPlan(velocity, duration_s=_DURATION_S, holdout=not plans, track=len(plans)))
    if random.random() < 0.5:
        starts_s = np.sort(random.uniform(0.15, 0.95, int(random.integers(1, 5)))) * _DURATION_S
        shaken = tuple(Vibration(at, between(random, 700.0, 5000.0), amplitude_m) for at in starts_s.tolist())
        plans.append(RunPlan(constant(speed()), shaken, _DURATION_S, track=len(plans)))
    return tuple(plans)


def between(random: np.random.Generator, low: float, high: float) -> float:
    """A number from `low` to `high`, uniform in its logarithm."""
    return low * (high / low) ** random.random()
