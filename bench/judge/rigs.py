"""Training rigs: a rig that differs from its description like any rig, and by no effect, one or two; and its measured runs."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from bench.judge.campaigns import Campaign, between, drawn_campaign
from bridge.config import validate
from bridge.faults import Fault
from diagnosis.evidence.folder import examine
from diagnosis.evidence.manifest import RigTable, RunTable, rig_file_tables, rig_numbers
from diagnosis.evidence.run import Evidence, MeasuredRun
from diagnosis.features.grid import BLOCK_S
from diagnosis.hypotheses.catalogue import CATALOGUE
from diagnosis.hypotheses.hypothesis import LEVELS
from diagnosis.synthetic.folder import TOLERANCES, Numbers
from diagnosis.synthetic.runs import RATE_HZ, DrawnRig, draw_chain
from plant.config import RigConfig
from plant.effects.library import EFFECTS

NONE = "none"
_SHARES = {0: 0.2, 1: 0.6, 2: 0.2}  # of rigs without, with one and with two effects
# Size of an effect in the catalogue's scale, which is clearly visible. Smaller: the judge learns to doubt `none`, as
# invisible effects look like it (at 0.3 a rig without a gap has a probability of 0.5 for none). Larger: small effects are not
# learned.
_TIMES = (0.8, 5.0)
_TIMES_OF_LEVEL = (0.8, 3.0)  # of 10 %: a smaller one is within 2.5 tolerances
# Scatter of the friction along the track, of a bench and of any machine, and its length. Narrower: every real surface is an
# effect. Wider: surfaces hide effects.
_SURFACES, _LENGTH_M = ((1e-3, 6e-3), (1e-3, 8e-2)), (3e-5, 1e-3)
_TAIL = 0.4  # spread of the shape of the Stribeck curve, as the diagnosis allows


class Rig(NamedTuple):
    """A training rig: its evidence, and the effects that the measured rig has."""

    evidence: Evidence
    effects: tuple[str, ...]


def drawn_rig(seed: int) -> Rig | None:
    """The training rig of this seed; None where the plant refuses its numbers or its runs show nothing."""
    random = np.random.default_rng(seed)
    campaign = drawn_campaign(random)
    shaken = campaign.sizes.highest_Hz > 0.0
    possible = [name for name, effect in EFFECTS.items() if shaken or effect.acts_on != "piezo"]
    count = int(random.choice(list(_SHARES), p=list(_SHARES.values())))
    names = tuple(str(name) for name in random.choice(possible, count, replace=False))
    numbers = rig_numbers(campaign.described)
    tolerance = {name: share for name, share in TOLERANCES.items() if numbers[name]}
    table = validate(RigTable, {"drive": "spring", **numbers, "tolerance": tolerance}, "a drawn rig")
    try:
        rig = _true_rig(random, campaign, table, {name: _numbers(random, name, campaign) for name in names})
        runs = tuple(_measured(random, campaign, rig, table))
        return Rig(Evidence(Path(), table, runs, ()), names)
    except (Fault, ValidationError, ValueError):
        return None


def _numbers(random: np.random.Generator, name: str, campaign: Campaign) -> Numbers:
    """One form of an effect with drawn parameters."""
    forms = EFFECTS[name].forms
    form = str(random.choice(list(forms)))
    tried = CATALOGUE[name].forms.get(form)
    scales = tried.scale(campaign.sizes) if tried else {}
    result: dict[str, float | str] = {"form": form}
    uneven = EFFECTS[name].acts_on == "drive"
    wave_m = 0.5 * campaign.travel_m
    others = {
        "ratio": between(random, 0.02, 0.4) if uneven else between(random, 0.006, 0.1),
        "wavelength_m": wave_m * between(random, 0.03, 0.6),
        "other_wavelength_m": wave_m * between(random, 0.03, 0.6),
        "frequency_Hz": between(random, 0.3, 15.0),
        "phase_rad": random.uniform(0.0, 2.0 * math.pi),
        "other_phase_rad": random.uniform(0.0, 2.0 * math.pi),
        "other_share": random.uniform(0.4, 1.0),
        "width": random.uniform(0.06, 0.2),
        "seed": float(random.integers(1, 100_000)),
    }
    for number, row in enumerate(forms[form].parameters):
        value = others.get(row.name, row.default)
        if (scale := scales.get(row.name)) is not None:
            times = between(random, *(_TIMES_OF_LEVEL if name in LEVELS else _TIMES))
            beside = math.exp(0.7 * random.standard_normal() * min(scale.prior, 1.0))
            value = scale.scale * (beside if number else times)
            if not scale.logarithmic and not number:
                value *= float(random.choice((-1.0, 1.0)))
        result[row.name] = min(max(value, row.low), row.high)
    return result


def _true_rig(
    random: np.random.Generator, campaign: Campaign, table: RigTable, effects: dict[str, Numbers]
) -> DrawnRig:
    """The rig that is measured: other numbers within the tolerances, a rough surface, a measuring chain, the effects."""
    true = dict(table.values())
    for name, share in table.tolerance.items():
        value = true[name]
        if value is not None:
            true[name] = value * (1.0 + share * min(max(random.standard_normal(), -3.0), 3.0))
    tables, described = rig_file_tables(true), campaign.described
    contact = described.contact.model_dump() | tables["contact"]
    contact |= {
        "pair": "", "stribeck_tail": min(max(_TAIL * random.standard_normal(), -1.0), 1.0),
        "roughness_ratio": between(random, *_SURFACES[int(random.random() < 0.4)]),
        "roughness_length_m": between(random, *_LENGTH_M), "roughness_seed": int(random.integers(1_000_000)),
        "static_force_N": max(contact["static_force_N"], 1.02 * contact["coulomb_force_N"]),
    }  # fmt: skip
    chain = draw_chain(random, described.sensors, table.static_force_N / 17.38)
    config = described.model_dump() | {
        "contact": contact, "slide": tables["slide"], "drive": described.drive.model_dump() | tables["drive"],
        "sensors": chain.sensors.model_dump(), "effects": {name: dict(numbers) for name, numbers in effects.items()},
        "solver": {"step_s": 1e-5, "block_s": BLOCK_S, "samples_per_block": round(RATE_HZ * BLOCK_S)},
    }  # fmt: skip
    return DrawnRig(validate(RigConfig, config, "a drawn rig"), chain)


def _measured(random: np.random.Generator, campaign: Campaign, rig: DrawnRig, table: RigTable) -> list[MeasuredRun]:
    """The runs as an evidence holds them."""
    runs: list[MeasuredRun] = []
    before_s = 0.0
    start_m = random.uniform(0.35, 0.6) * rig.config.sensors.position_range_m
    for number, plan in enumerate(campaign.plans):
        effects = rig.config.effects
        if "before_s" in effects.get("friction-drift", {}):
            drift = effects["friction-drift"] | {"before_s": before_s}
            rig = rig._replace(config=rig.config.model_copy(update={"effects": effects | {"friction-drift": drift}}))
        columns = plan.columns(random, rig, start_m * (1.0 + 0.1 * random.standard_normal()))
        before_s += plan.duration_s
        speed_mps = plan.velocity[0][1] if len(plan.velocity) == 1 else None
        of_run = RunTable(file=f"run-{number + 1:02d}.parquet", drive_velocity_mps=speed_mps, holdout=plan.holdout)
        kept = {name: values.astype(np.float64) for name, values in columns.items() if name not in campaign.leave_out}
        runs.append(examine({**kept}, table, of_run)[0])  # a copy of the wider type of `examine`
    return runs
