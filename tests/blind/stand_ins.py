"""A generator and a bench that take no time: an effect of strength s makes the force s larger and is worth 4 s limits."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests import made_up
from tests.blind.generators import Plan


class Bump(NamedTuple):
    """An effect."""

    name: str
    strength: float = 1.0

    def scaled(self, strength: float) -> "Bump":
        return self._replace(strength=strength)


class StandIn:
    """A generator of two effects and one that nobody knows."""

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

    def make(self, folder: Path, plan: Plan, seed: int) -> None:  # noqa: ARG002
        made_up.evidence_folder(folder)
        path = folder / "run-01.csv"
        rows = path.read_text().splitlines()
        more_N = sum(effect.strength for effect in plan.effects)
        values = [(t, float(force) + more_N) for t, force in (row.split(",") for row in rows[1:])]
        path.write_text("\n".join([rows[0], *(f"{t},{force:.6f}" for t, force in values)]) + "\n")


class StandInBench:
    """Reads the strength off the force."""

    def __init__(self, _rough: Path, smooth: Path) -> None:
        self.force_N = _first_N(smooth)

    def detectability(self, folder: Path) -> float:
        return 4.0 * (_first_N(folder) - self.force_N)

    def cells(self, folder: Path) -> list[list[object]]:  # noqa: ARG002
        return [["drive_force_N", "slip", "run-01.csv", 3.0], ["drive_force_N", "stick", "run-01.csv", 0.1]]


def _first_N(folder: Path) -> float:
    return float((folder / "run-01.csv").read_text().splitlines()[1].split(",")[1])
