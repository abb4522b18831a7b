"""Substitutes without delay: a generator and a bench, where a strength s adds s to the force and is worth 4 s limits; cases."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from bench.blind.outcomes import Opened, opened
from tests import made_up
from tests.blind.generators import Plan
from tests.blind.making import VERDICTS

MANIFEST = made_up.MANIFEST.replace("\n[[run]]", "\n[rig.tolerance]\ncoulomb_force_N = 0.03\n\n[[run]]")


class Bump(NamedTuple):
    """An effect."""

    name: str
    strength: float = 1.0

    def scaled(self, strength: float) -> "Bump":
        return self._replace(strength=strength)


class StandIn:
    """A generator of two effects of the library and one outside."""

    library = ("drive-backlash", "force-sensor-gain")
    outside = ("loose-screw",)
    usual = "lugre"
    backbones = ("other",)
    strongest = 1.5
    wide = 1.1

    def draw(self, random: np.random.Generator, name: str) -> Bump:  # noqa: ARG002
        return Bump(name)

    def formula(self, effect: Bump) -> str:
        return f"bump {effect.strength}"

    def true_numbers(self, plan: Plan, seed: int) -> dict[str, float]:  # noqa: ARG002
        return {"coulomb_force_N": 14.2}

    def make(self, folder: Path, plan: Plan, seed: int) -> None:  # noqa: ARG002
        made_up.evidence_folder(folder)
        (folder / "manifest.toml").write_text(MANIFEST)  # the same whatever the folder's name
        path = folder / "run-01.csv"
        rows = path.read_text().splitlines()
        more_N = sum(effect.strength for effect in plan.effects)
        values = [(t, float(force) + more_N) for t, force in (row.split(",") for row in rows[1:])]
        path.write_text("\n".join([rows[0], *(f"{t},{force:.6f}" for t, force in values)]) + "\n")


class StandInBench:
    """A bench that reads the strength from the force."""

    def __init__(self, _rough: Path, smooth: Path) -> None:
        self.force_N = _first_N(smooth)

    def detectability(self, folder: Path) -> float:
        return 4.0 * (_first_N(folder) - self.force_N)

    def cells(self, folder: Path) -> list[list[object]]:  # noqa: ARG002
        return [["drive_force_N", "slip", "run-01.csv", 3.0], ["drive_force_N", "stick", "run-01.csv", 0.1]]


def _first_N(folder: Path) -> float:
    return float((folder / "run-01.csv").read_text().splitlines()[1].split(",")[1])


def case(stratum, there, probabilities, named=None, groups=(), detectability=3.0, verdict=None, **more) -> Opened:
    """A case; by default `named` is the leading candidate."""
    answer = {
        "stratum": stratum,
        "verdict": VERDICTS.get(stratum, "effect"),
        "effects": [{"name": name, "detectability": detectability} for name in there],
        "number": more.pop("number", None),
        "tolerances": 1.0,
        "backbone": "lugre",
        "counterfactual_seed": more.pop("seed", 1),
        "cells": more.pop("cells", []),
    }
    top = max(probabilities, key=probabilities.get)
    if named is None:
        named = [] if top in {"none", "unexplained"} else [top]
    said = {
        "verdict": verdict or {"none": "no-gap", "unexplained": "unexplained"}.get(top, "effect"),
        "effects": list(named),
        "candidates": [{"effect": name, "probability": p} for name, p in probabilities.items()],
        "not_distinguishable": [list(group) for group in groups],
        "where": more.pop("where", []),
        "gap": {"shrinkage": 0.8, "interval_90": [0.7, 0.9]},
        "cpu_s": 10.0,
    }
    return opened(more.pop("name", "a"), answer, said | more)
