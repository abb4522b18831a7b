"""Diagnose rigs of the plant, twenty of every effect, from barely visible to large, twenty of none, and twenty of two.

A rig has 14 s of runs. Results are kept in OUT and not made again by the same version; the scores cover all kept results.
"""

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import joblib
import numpy as np

from bench.blind.oracle import shrinkage_with
from bench.blind.outcomes import Opened, opened
from bench.blind.scoring import score
from bench.blind.table import TOOL, table
from bridge.results import strict_json, write_json
from diagnosis.diagnose import diagnose
from diagnosis.evidence.folder import load_evidence
from diagnosis.version import tool_version
from tests.blind.generators import Plan
from tests.blind.plant_cases import Plant, PlantEffect, drawn
from tests.blind.plant_sizes import EFFECT_SIZES
from tests.blind.sizing import Bench

NONE, TWO = "no-gap", "two-effects"
VISIBLE = 2.0  # detection limits
ORACLE_EVERY = 4  # cases, as the oracle takes half as long as the diagnosis
SOURCE = Plant("short")


def done(out: Path, kind: str, number: int, seed: int, tool: str) -> tuple[Opened, float | None]:
    """One case, kept or newly made, and diagnosed; with the shrinkage of the oracle for every `ORACLE_EVERY`th single effect."""
    path = out / f"{kind}-{number:02d}-of-seed-{seed}.json"
    kept = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    if kept.get("tool") != tool:
        random = np.random.default_rng([seed, number, *kind.encode()])
        kept = {"tool": tool, **_one(kind, random, ask_oracle=kind not in {NONE, TWO} and number % ORACLE_EVERY == 0)}
        write_json(path, kept)
    return opened(path.stem, kept["answer"], kept["said"]), kept["oracle"]


def _one(kind: str, random: np.random.Generator, ask_oracle: bool) -> dict[str, Any]:
    names = {NONE: [], TWO: random.choice(SOURCE.library, 2, replace=False).tolist()}.get(kind, [kind])
    effects = [_effect(random, name) for name in names]
    seed = int(random.integers(1 << 31))
    with tempfile.TemporaryDirectory() as scratch:

        def made(folder: str, plan: Plan) -> Path:
            SOURCE.make(Path(scratch) / folder, plan, seed)
            return Path(scratch) / folder

        case = made("case", Plan(tuple(effects)))
        bench = Bench(made("rough", Plan()), made("smooth", Plan(smooth=True))) if effects else None
        limits = (
            [bench.detectability(made(effect.name, Plan((effect,), smooth=True))) for effect in effects]
            if bench
            else []
        )
        verdict = strict_json(diagnose(load_evidence(case), lambda *_: None))
        oracle = shrinkage_with(case, names) if ask_oracle else None
    answer = {
        "stratum": kind if kind in {NONE, TWO} else "one-effect",
        "verdict": "effect" if effects else "no-gap",
        "effects": [
            {"name": one.name, "formula": SOURCE.formula(one), "detectability": round(worth, 3)}
            for one, worth in zip(effects, limits, strict=True)
        ],
        "tolerances": 1.0,
        "backbone": None,
        "cells": [],
    }
    return {"answer": answer, "said": verdict, "oracle": oracle}


def _effect(random: np.random.Generator, name: str) -> PlantEffect:
    sizes = EFFECT_SIZES[name][random.integers(len(EFFECT_SIZES[name]))]
    weakest = min(sizes.barely / sizes.large, sizes.large / sizes.barely)
    return drawn(random, name, sizes).scaled(weakest ** random.random())


parser = argparse.ArgumentParser(prog="python -m tests.blind.each_effect", description=__doc__)
parser.add_argument("out", type=Path, metavar="OUT", help="folder of the results")
parser.add_argument("--cases", type=int, default=20, help="of each kind")
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--jobs", type=int, default=joblib.cpu_count())

if __name__ == "__main__":
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    version = tool_version("tests/blind")
    work = [
        joblib.delayed(done)(asked.out, kind, number, asked.seed, version)
        for number in range(asked.cases)
        for kind in (*SOURCE.library, NONE, TWO)
    ]
    cases: list[Opened] = []
    oracle: dict[str, float | None] = {}
    for case, closed in joblib.Parallel(asked.jobs, return_as="generator", batch_size=1)(work):
        cases.append(case)
        if closed is not None:
            oracle[case.name] = closed
        verdict = " + ".join(sorted(case.named)) or case.verdict
        print(
            f"{len(cases):4d} of {len(work)}  {case.name:45s} {case.detectability:6.2f} limits: {verdict}", flush=True
        )
    seen = [case for case in cases if case.stratum != "one-effect" or case.detectability >= VISIBLE]
    print(f"\n{len(cases) - len(seen)} single effects of less than {VISIBLE:g} limits are left out.")
    both = [case.set_f1 for case in cases if case.stratum == TWO and case.detectability >= VISIBLE]
    if both:
        print(f"{len(both)} pairs have two effects of {VISIBLE:g} limits or more: mean F1 {np.mean(both):.2f}.")
    print(table({TOOL: score(seen, oracle)}, {}, sealed=False))
