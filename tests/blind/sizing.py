"""How visible an effect is: the difference between two evidences of one rig, with it and without, in detection limits.

The difference of the measured features, in floors, compressed and whitened, is freed of what the nuisances can imitate. Its
length is what a matched filter would see. Both have a smooth surface: on a rough one an effect also moves every slip to
another place, which alone looks like two limits. A detection limit is the length at which the log evidence of a single
effect with one parameter reaches the cost of an alarm.
"""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.evidence import load_evidence
from diagnosis.gap import Floor, cell_names, cell_squares, compress, floor_of, replicates
from diagnosis.nuisance import Nuisances
from diagnosis.problem import Prepared, Problem, prepare
from diagnosis.refit import Fitter
from diagnosis.search import Directions
from diagnosis.twin import Roughness
from diagnosis.verdict import COST_OF_EFFECT, JITTER

Floats = npt.NDArray[np.floating[Any]]
_OCCAM = 5.0  # of one parameter, as it comes out of most refits
LIMIT = float(np.sqrt(2.0 * JITTER * (COST_OF_EFFECT + _OCCAM)))
_ROUGHNESS = Roughness(0.003, 1.5e-4, 0)
_REPLICATES = 12
_APPEARED = 4.0  # floors, where one evidence shows a feature that the other lacks


class Bench:
    """A rig without its effects, to compare it with itself under an effect."""

    def __init__(self, without: Path) -> None:
        evidence = load_evidence(without)
        runs = prepare(evidence)
        nuisances = Nuisances(evidence.rig)
        described = np.zeros(len(nuisances))
        point = nuisances.point(described, {})
        self._parts = [
            (problem, floor_of(problem, point, replicates(problem, point, _ROUGHNESS, _REPLICATES, 1)))
            for some in ([run for run in runs if not run.holdout], [run for run in runs if run.holdout])
            if some
            for problem in [Problem(evidence.rig, some)]
        ]
        fitted, floor = self._parts[0]
        fitter = Fitter(fitted, floor, nuisances)
        # about the prediction without the effect, not about what was measured
        measured = fitted.measured
        fitted.measured = fitter.predicted(described, {}) + floor.bias
        self._directions = Directions(fitter.described(described))
        fitted.measured = measured

    def detectability(self, folder: Path) -> float:
        """How many detection limits this evidence's difference is worth, in the runs that are fitted."""
        problem, floor = self._parts[0]
        z = compress(_differences(floor, problem, _runs(folder)))
        return float(np.linalg.norm(self._directions.freed(floor.whitening @ z))) / LIMIT

    def cells(self, folder: Path) -> list[list[Any]]:
        """Where this evidence differs: signal, regime, run, and the root mean square in floors, compressed."""
        runs = _runs(folder)
        squares: dict[tuple[str, str, str], list[float]] = {}
        for problem, floor in self._parts:
            found = cell_squares(floor, _differences(floor, problem, runs))
            for (signal, regime, _, run), square in zip(cell_names(floor), found.tolist(), strict=True):
                squares.setdefault((signal, regime, run), []).append(square)
        return [[*cell, round(float(np.sqrt(np.mean(found))), 3)] for cell, found in squares.items()]


def _runs(folder: Path) -> list[Prepared]:
    return prepare(load_evidence(folder))


def _differences(floor: Floor, without: Problem, runs: list[Prepared]) -> Floats:
    """Features of the runs of the same files less those of the problem, in floors, [compared]."""
    files = {run.file for run in without.runs}
    other = Problem(without.rig, [run for run in runs if run.file in files])
    by_label = dict(zip(other.labels, other.measured.tolist(), strict=True))
    there = np.array([by_label.get(label, np.nan) for label in without.labels])
    here = without.measured
    # measured features hold the noise already that `expected` adds
    apart = (floor.expected(there - floor.bias) - floor.expected(here - floor.bias))[floor.compared]
    z = apart / floor.scatter[floor.compared]
    one_lacks_it = (np.isfinite(there) != np.isfinite(here))[floor.compared]
    return np.where(np.isfinite(z), z, np.where(one_lacks_it, _APPEARED, 0.0))
