"""Evidence folders made from the plant: a described rig, and measurements of the drawn rig.

The two rigs differ like any rig from its description: rig numbers within their tolerances, a rough surface, a measuring chain,
the start of a run; and by the effects of the case. The folder holds only the description and the measurements.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bridge.config import validate
from bridge.files import write_whole
from bridge.tables.writers import ArrowTable
from diagnosis.evidence.manifest import MANIFEST, RigTable, RunTable
from diagnosis.evidence.manifest_text import manifest_text
from diagnosis.synthetic.protocols import AXIS_PLANS, FORCE_PROTOCOL, PROTOCOLS, AxisPlan
from diagnosis.synthetic.runs import DrawnRig, axis_run, spring_run
from diagnosis.synthetic.sensors import draw_chain
from plant.config import RigConfig

Numbers = Mapping[str, float | str]

TOLERANCES: Mapping[str, float] = {  # relative standard deviations; a damping of 0 has no tolerance
    "mass_kg": 0.005,
    "drive_stiffness_N_per_m": 0.02,
    "contact_stiffness_N_per_m": 0.05,
    "contact_damping_Ns_per_m": 0.10,
    "coulomb_force_N": 0.03,
    "static_force_N": 0.03,
    "stribeck_velocity_mps": 0.10,
}
_MOST_DEVIATION = 3.0  # largest deviation of a drawn rig number, in tolerances; a larger deviation is a gap
_LEAST_STATIC = 1.02  # least static friction, in Coulomb forces; below, the slide does not stick
_PAPER_STATIC_N = 17.38  # static friction of the paper's first pair, to which the noise of the force is scaled
# A lower rate would give the plant too few samples in a block of 1 ms: the plant is then oversampled and averaged.
_FASTEST_BLOCK_HZ = 4000.0
_OVERSAMPLED_HZ = 20_000.0  # rate of the plant in that case


class Case(NamedTuple):
    """A synthetic evidence to make."""

    protocol: str = "ladder"
    effects: Mapping[str, Numbers] = {}  # table `[effects]` of a rig file
    rig: RigConfig | None = None  # described rig; None: the paper's rig, or with the protocol "force" a linear axis
    tolerances: Mapping[str, float] = TOLERANCES
    leave_out: tuple[str, ...] = ()  # columns that are not written
    rate_Hz: float = 20_000.0  # sampling rate; a force-driven axis is sampled with its control, at 1 kHz
    drawn: bool = True  # False: the true parameters equal the described parameters
    spread: float = 1.0  # standard deviation of the drawn rig numbers, in tolerances; cut off at three tolerances
    rough: bool = True  # False: the friction is constant along the track


def paper_rig() -> RigConfig:
    """The paper's stand with its first steel pair."""
    return validate(RigConfig, {"contact": {"pair": "C45-C45 @ 0.063"}}, "the paper's rig")


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


def make_evidence(folder: Path, case: Case, seed: int, progress: Callable[[float], None] = lambda _share: None) -> None:
    """Make an evidence folder; the same case and seed give the same bytes. `progress` is called with the share of finished runs.

    Raises ValueError when the protocol is unknown or the rate does not fit, and Fault CONFIG when the rig is not valid.
    """
    if case.protocol not in {*PROTOCOLS, FORCE_PROTOCOL}:
        known = ", ".join((*PROTOCOLS, FORCE_PROTOCOL))
        raise ValueError(f"protocol = {case.protocol!r}: unknown; known: {known}")
    force_driven = case.protocol == FORCE_PROTOCOL
    described = case.rig or (axis_rig() if force_driven else paper_rig())
    table = _rig_table(described, "force" if force_driven else "spring", case.tolerances)
    of_rig, of_runs = np.random.SeedSequence(seed).spawn(2)
    rig = _draw_rig(np.random.default_rng(of_rig), described, table, case)
    folder.mkdir(parents=True, exist_ok=True)
    plans = AXIS_PLANS if force_driven else PROTOCOLS[case.protocol]
    track_m = np.random.default_rng(of_runs).uniform(0.012, 0.030, len(plans))
    runs: list[RunTable] = []
    before_s = 0.0
    for number, (plan, of_run) in enumerate(zip(plans, of_runs.spawn(len(plans)), strict=True), 1):
        random = np.random.default_rng(of_run)
        file = f"run-{number:02d}.parquet"
        velocity_mps = None
        if isinstance(plan, AxisPlan):
            columns = axis_run(random, _after_earlier_runs(rig, before_s), plan)
        else:
            columns = spring_run(random, _after_earlier_runs(rig, before_s), plan, float(track_m[plan.track]))
            if len(plan.velocity) == 1:
                velocity_mps = plan.velocity[0][1]
        before_s += plan.duration_s
        writer = ArrowTable(folder / file)
        writer.append({name: values for name, values in columns.items() if name not in case.leave_out})
        writer.finish()
        runs.append(RunTable(file=file, drive_velocity_mps=velocity_mps, holdout=plan.holdout))
        progress(number / len(plans))
    write_whole(folder / MANIFEST, manifest_text(table, runs, []))


def _after_earlier_runs(rig: DrawnRig, before_s: float) -> DrawnRig:
    """The rig after `before_s` seconds of earlier runs."""
    effects = rig.config.effects
    if "before_s" not in effects.get("friction-drift", {}):
        return rig
    drift = effects["friction-drift"] | {"before_s": before_s}
    return rig._replace(config=rig.config.model_copy(update={"effects": effects | {"friction-drift": drift}}))


def _rig_table(rig: RigConfig, drive: str, tolerances: Mapping[str, float]) -> RigTable:
    contact = rig.contact
    values: dict[str, Any] = {
        "mass_kg": rig.slide.mass_kg,
        "contact_stiffness_N_per_m": contact.stiffness_N_per_m,
        "contact_damping_Ns_per_m": contact.damping_Ns_per_m,
        "viscous_damping_Ns_per_m": contact.viscous_damping_Ns_per_m,
        "coulomb_force_N": contact.coulomb_force_N,
        "static_force_N": contact.static_force_N,
        "stribeck_velocity_mps": contact.stribeck_velocity_mps,
    }
    if drive == "spring":
        values["drive_stiffness_N_per_m"] = rig.drive.stiffness_N_per_m
        values["drive_damping_Ns_per_m"] = rig.drive.damping_Ns_per_m
    known = {name: share for name, share in tolerances.items() if name in values}
    return validate(RigTable, {"drive": drive, **values, "tolerance": known}, "the described rig")


def _draw_rig(random: np.random.Generator, described: RigConfig, table: RigTable, case: Case) -> DrawnRig:
    slow = case.rate_Hz < _FASTEST_BLOCK_HZ
    rate_Hz = _OVERSAMPLED_HZ if slow else case.rate_Hz
    average = round(rate_Hz / case.rate_Hz)
    if abs(average * case.rate_Hz - rate_Hz) > 1e-6 or abs(rate_Hz / 1000.0 % 1.0) > 1e-9:
        raise ValueError(f"rate_Hz = {case.rate_Hz:g}: must be whole kHz, or divide {_OVERSAMPLED_HZ:g} Hz")
    # drawn for every name, so that other tolerances do not change the rest of the rig
    drawn = {name: random.standard_normal() for name in TOLERANCES}
    true = dict(table.values())
    for name, share in table.tolerance.items():
        value = true[name]
        if case.drawn and value is not None:
            deviation = min(max(case.spread * drawn.get(name, 0.0), -_MOST_DEVIATION), _MOST_DEVIATION)
            true[name] = value * max(1.0 + share * deviation, 0.1)
    static_N, coulomb_N = true["static_force_N"] or 0.0, true["coulomb_force_N"] or 0.0
    contact: dict[str, Any] = described.contact.model_dump() | {
        "pair": "",
        "stiffness_N_per_m": true["contact_stiffness_N_per_m"],
        "damping_Ns_per_m": true["contact_damping_Ns_per_m"],
        "coulomb_force_N": coulomb_N,
        "static_force_N": max(static_N, _LEAST_STATIC * coulomb_N) if case.drawn else static_N,
        "stribeck_velocity_mps": true["stribeck_velocity_mps"],
        "roughness_ratio": random.uniform(0.001, 0.006) * case.rough,
        "roughness_length_m": math.exp(random.uniform(math.log(5e-5), math.log(5e-4))),
        "roughness_seed": int(random.integers(0, 1_000_000)),
    }
    drive = described.drive.model_dump()
    if table.drive == "spring":
        drive["stiffness_N_per_m"] = true["drive_stiffness_N_per_m"]
        drive["damping_Ns_per_m"] = true["drive_damping_Ns_per_m"]
    chain = draw_chain(random, described.sensors, described.contact.static_force_N / _PAPER_STATIC_N)
    config = described.model_dump() | {
        "contact": contact,
        "slide": {"mass_kg": true["mass_kg"]},
        "drive": drive,
        "sensors": chain.sensors.model_dump(),
        "solver": {"step_s": 1e-5, "block_s": 1e-3, "samples_per_block": round(rate_Hz / 1000.0)},
        "effects": {name: dict(numbers) for name, numbers in case.effects.items()},
    }
    return DrawnRig(validate(RigConfig, config, "the drawn rig"), chain, rate_Hz, average)
