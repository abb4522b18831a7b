"""Runs made from the plant and prepared for comparison: shared by the tests of the diagnosis' parts."""

from collections.abc import Mapping

import numpy as np

from diagnosis.evidence.folder import Evidence, load_evidence
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.gap.measure import floor_of, replicates
from diagnosis.gap.prepare import Prepared, prepare
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import Roughness
from diagnosis.synthetic.folder import Numbers
from tests.made_evidence import made_evidence
from tests.made_protocols import case_of


def prepared(
    protocol: str, effects: Mapping[str, Numbers] | None = None, seed: int = 1
) -> tuple[Evidence, list[Prepared]]:
    """A rig that differs from its description by `effects` and by the usual tolerances."""
    evidence = load_evidence(made_evidence(case_of(protocol, effects, drawn=False), seed))
    return evidence, prepare(evidence)


def fitter_of(evidence: Evidence, runs: list[Prepared]) -> Fitter:
    """Of the fitted runs, under the floor of the rig as described."""
    problem, nuisances = Problem(evidence.rig, [run for run in runs if not run.holdout]), Nuisances(evidence.rig)
    point = nuisances.point(np.zeros(len(nuisances)), {})
    return Fitter(
        problem, floor_of(problem, point, replicates(problem, point, Roughness(0.003, 1.5e-4, 0), 12, 1)), nuisances
    )
