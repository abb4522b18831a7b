"""How visible an effect is, in detection limits: the part that the baseline cannot imitate.

The baseline is fitted to two evidences of one rig, with the effect and without. The additional chi2 with the effect is the
square of the length that a matched filter would see. Both evidences have a smooth surface: on a rough surface an effect also
moves every slip to another place, which alone looks like two detection limits. The noise floor belongs to the rough surface. A
detection limit is the length at which the log evidence of a single effect with one parameter reaches 8.

A linear estimate, the difference without the nuisances' directions, is not enough (docs/method/diagnosis.md).
"""

import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.evidence.folder import load_evidence
from diagnosis.features.feature import POWERS
from diagnosis.fits.batch import together
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.surface import ROUGHNESS, surface_of
from diagnosis.gap.measure import Floor, cell_names, cell_squares, floor_of, replicates
from diagnosis.gap.prepare import Prepared, prepare
from diagnosis.gap.problem import Point, Problem
from diagnosis.hypotheses.hypothesis import NOTHING
from diagnosis.hypotheses.nuisances import Nuisances

Floats = npt.NDArray[np.floating[Any]]
# These numbers stay when the diagnosis' own threshold moves; otherwise scores of two versions could not be compared.
_ALARM = 8.0  # log evidence of a detection limit
_JITTER = 1.5  # of chi2, by which refits end in other valleys
_OCCAM = 5.0  # log evidence that one parameter costs in most refits
LIMIT = math.sqrt(2.0 * _JITTER * (_ALARM + _OCCAM))
# Chi2 per compared feature above which a refit goes on. Larger: a refit that stopped early counts as visible. Smaller: time.
_MUCH = 0.6
_FIRST_REPLICATES, _REPLICATES = 12, 32  # for the roughness, and for the floor
_APPEARED = 4.0  # difference, in floors, of a feature that only one of two evidences shows


class Bench:
    """A rig without effects, to compare it with the same rig under an effect.

    Args:
        rough: evidence of the rig without effects on its rough surface.
        smooth: the same on a smooth surface.

    """

    def __init__(self, rough: Path, smooth: Path) -> None:
        evidence = load_evidence(smooth)
        runs = prepare(evidence)
        self._rig = evidence.rig
        self._nuisances = Nuisances(evidence.rig)
        self._described = self._nuisances.point(np.zeros(len(self._nuisances)), {})
        scattered = Problem(evidence.rig, [run for run in _runs(rough) if not run.holdout])
        self._roughness = surface_of(scattered, replicates(scattered, self._described, ROUGHNESS, _FIRST_REPLICATES, 1))
        self._parts = [
            (problem, self._floor(problem))
            for some in ([run for run in runs if not run.holdout], [run for run in runs if run.holdout])
            if some
            for problem in [Problem(evidence.rig, some)]
        ]
        self._fitter = Fitter(*self._parts[0], self._nuisances)
        self._without: Fit | None = None

    def detectability(self, folder: Path) -> float:
        """Detection limits that the effect of this evidence is worth in the fitted runs."""
        without = self._without or _refitted(self._fitter, np.zeros(len(self._nuisances)))
        problem = Problem(self._rig, [run for run in _runs(folder) if not run.holdout])
        fitter = Fitter(problem, self._floor(problem), self._nuisances)
        fit = _refitted(fitter, without.deviations)
        # a better fit of only one of the two refits does not show the effect
        again = self._fitter.refit(NOTHING, fit.deviations, np.zeros(0))
        self._without = min(without, again, key=lambda one: one.chi2)
        as_before = self._without.chi2 / len(self._without.residual) * len(fit.residual)
        return math.sqrt(max(fit.chi2 - as_before, 0.0)) / LIMIT

    def _floor(self, problem: Problem) -> Floor:
        """The noise floor; each evidence has its own, as replicates depend on the forces at the starts of its segments."""
        return floor_of(problem, self._described, replicates(problem, self._described, self._roughness, _REPLICATES, 1))

    def cells(self, folder: Path) -> list[list[Any]]:
        """The cells of this evidence: signal, regime, run, and difference in compressed floors.

        The mean squares of the bands of a cell are added up, as shares of a gap are.
        """
        runs = _runs(folder)
        squares: dict[tuple[str, str, str], float] = defaultdict(float)
        for problem, floor in self._parts:
            predicted = _measured(problem, runs, self._described)
            found = cell_squares(floor, _differences(floor, problem, predicted))
            for (signal, regime, _, run), square in zip(cell_names(floor), found.tolist(), strict=True):
                squares[signal, regime, run] += square
        return [[*cell, round(math.sqrt(total), 3)] for cell, total in squares.items()]


def _refitted(fitter: Fitter, deviations: Floats) -> Fit:
    """The baseline, refitted further where much chi2 is left, as a single refit may stop early (docs/method/diagnosis.md)."""
    fit = fitter.refit(NOTHING, deviations, np.zeros(0))
    return (
        fit
        if fit.chi2 <= _MUCH * len(fit.residual)
        else together(fitter.predicted_many, [fitter.going_further(fit)])[0]
    )


def _runs(folder: Path) -> list[Prepared]:
    return prepare(load_evidence(folder))


def _measured(without: Problem, runs: list[Prepared], described: Point) -> Floats:
    """The features of `without` in runs of the same files [features]; NaN where a run lacks a feature.

    The difference that the described rig predicts is subtracted, as if each segment began in the same phase of its cycle.
    """
    files = {run.file for run in without.runs}
    other = Problem(without.rig, [run for run in runs if run.file in files])
    predicted, expected = (
        dict(zip(other.labels, values.tolist(), strict=True)) for values in (other.measured, other.predicted(described))
    )
    found: list[float] = []
    for (file, label), value_without in zip(without.labels, without.predicted(described).tolist(), strict=True):
        value = predicted.get((file, label), math.nan)
        begun = expected.get((file, label), math.nan) - value_without
        found.append(value - begun if math.isfinite(begun) and label.name not in POWERS else value)
    return np.array(found)


def _differences(floor: Floor, without: Problem, predicted: Floats) -> Floats:
    """Features [features] less the features of the problem, in floors, [compared]."""
    measured_without = without.measured
    # `expected` adds noise that measured features hold already, so its bias is subtracted first
    apart = (floor.expected(predicted - floor.bias) - floor.expected(measured_without - floor.bias))[floor.compared]
    z = apart / floor.scatter[floor.compared]
    one_lacks_it = (np.isfinite(predicted) != np.isfinite(measured_without))[floor.compared]
    return np.where(np.isfinite(z), z, np.where(one_lacks_it, _APPEARED, 0.0))
