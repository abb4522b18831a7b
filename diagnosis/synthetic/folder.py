"""Evidence folders made from the plant: a described rig, and measurements of the drawn rig.

The two rigs differ like any rig from its description: rig numbers within their tolerances, a rough surface, a measuring chain,
the start of a run; and by the effects of the case. The folder holds only the description and the measurements.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from bridge.config import validate
from bridge.files import write_whole
from bridge.tables.writers import ArrowTable
from diagnosis.evidence.manifest import MANIFEST, RigTable, RunTable, manifest_text, rig_file_tables, rig_numbers
from diagnosis.features.grid import BLOCK_S
from diagnosis.synthetic.runs import LADDER, RATE_HZ, DrawnRig, RunPlan, draw_chain
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


class Case(NamedTuple):
    """A synthetic evidence to make."""

    plans: Sequence[RunPlan] = ()  # empty: the ladder
    effects: Mapping[str, Numbers] = {}  # table `[effects]` of a rig file
    rig: RigConfig | None = None  # described rig; None: the paper's rig
    drive: Literal["spring", "force"] = "spring"
    tolerances: Mapping[str, float] = TOLERANCES
    leave_out: tuple[str, ...] = ()  # columns that are not written
    drawn: bool = True  # False: the true parameters equal the described parameters
    spread: float = 1.0  # standard deviation of the drawn rig numbers, in tolerances; cut off at three tolerances
    rough: bool = True  # False: the friction is constant along the track


def paper_rig() -> RigConfig:
    """The paper's rig with its first steel pair."""
    return validate(RigConfig, {"contact": {"pair": "C45-C45 @ 0.063"}}, "the paper's rig")


def make_evidence(folder: Path, case: Case, seed: int, progress: Callable[[float], None] = lambda _share: None) -> None:
    """Make an evidence folder; the same case and seed give the same bytes. `progress` is called with the share of finished runs.

    Raises Fault CONFIG when the rig is not valid.
    """
    described = case.rig or paper_rig()
    table = _rig_table(described, case.drive, case.tolerances)
    of_rig, of_runs = np.random.SeedSequence(seed).spawn(2)
    rig = _draw_rig(np.random.default_rng(of_rig), described, table, case)
    folder.mkdir(parents=True, exist_ok=True)
    plans = case.plans or LADDER
    track_m = np.random.default_rng(of_runs).uniform(0.012, 0.030, len(plans))
    runs: list[RunTable] = []
    before_s = 0.0
    for number, (plan, of_run) in enumerate(zip(plans, of_runs.spawn(len(plans)), strict=True), 1):
        random = np.random.default_rng(of_run)
        file = f"run-{number:02d}.parquet"
        columns = plan.columns(random, _after_earlier_runs(rig, before_s), float(track_m[plan.track]))
        velocity_mps = plan.velocity[0][1] if len(plan.velocity) == 1 else None
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
    values = rig_numbers(rig)
    if drive == "force":
        del values["drive_stiffness_N_per_m"], values["drive_damping_Ns_per_m"]
    known = {name: share for name, share in tolerances.items() if name in values}
    return validate(RigTable, {"drive": drive, **values, "tolerance": known}, "the described rig")


def _draw_rig(random: np.random.Generator, described: RigConfig, table: RigTable, case: Case) -> DrawnRig:
    # drawn for every name, so that other tolerances do not change the rest of the rig
    drawn = {name: random.standard_normal() for name in TOLERANCES}
    true = dict(table.values())
    for name, share in table.tolerance.items():
        value = true[name]
        if case.drawn and value is not None:
            deviation = min(max(case.spread * drawn.get(name, 0.0), -_MOST_DEVIATION), _MOST_DEVIATION)
            true[name] = value * max(1.0 + share * deviation, 0.1)
    tables = rig_file_tables(true)
    contact: dict[str, Any] = (
        described.contact.model_dump()
        | tables["contact"]
        | {
            "pair": "",
            "roughness_ratio": random.uniform(0.001, 0.006) * case.rough,
            "roughness_length_m": math.exp(random.uniform(math.log(5e-5), math.log(5e-4))),
            "roughness_seed": int(random.integers(0, 1_000_000)),
        }
    )
    if case.drawn:
        contact["static_force_N"] = max(contact["static_force_N"], _LEAST_STATIC * contact["coulomb_force_N"])
    chain = draw_chain(random, described.sensors, described.contact.static_force_N / _PAPER_STATIC_N)
    config = described.model_dump() | {
        "contact": contact,
        "slide": tables["slide"],
        "drive": described.drive.model_dump() | tables.get("drive", {}),
        "sensors": chain.sensors.model_dump(),
        "solver": {"step_s": 1e-5, "block_s": BLOCK_S, "samples_per_block": round(RATE_HZ * BLOCK_S)},
        "effects": {name: dict(numbers) for name, numbers in case.effects.items()},
    }
    return DrawnRig(validate(RigConfig, config, "the drawn rig"), chain)
