"""The search for a second effect beside a fit that is done."""

import numpy as np
import pytest

from diagnosis.gap import floor_of, replicates
from diagnosis.library import trials
from diagnosis.nuisance import Nuisances
from diagnosis.problem import Problem
from diagnosis.refit import Fitter
from diagnosis.search import pairs_with
from diagnosis.twin import Roughness
from tests.prepared import prepared

EFFECTS = {"coulomb-level": {"ratio": -0.14}, "stribeck-velocity": {"ratio": -0.57}}


def test_a_second_effect_is_found_beside_one_that_is_there(tmp_path):
    evidence, runs = prepared(tmp_path / "two", "ladder", EFFECTS)
    problem, nuisances = Problem(evidence.rig, [run for run in runs if not run.holdout]), Nuisances(evidence.rig)
    described = np.zeros(len(nuisances))
    point = nuisances.point(described, {})
    floor = floor_of(problem, point, replicates(problem, point, Roughness(0.003, 1.5e-4, 0), 12, 1))
    fitter = Fitter(problem, floor, nuisances)
    names = {"coulomb-level", "stribeck-velocity", "static-level"}
    tried = [one for one in trials(problem) if names.intersection(one.form.effects)]
    coulomb = next(one for one in tried if one.form.effects == ("coulomb-level",))
    first = fitter.refit(coulomb.form, described, coulomb.w)
    pairs = pairs_with(fitter, first, tried)
    assert set(pairs[0].form.effects) == set(EFFECTS)
    assert pairs[0].chi2 < 0.5 * first.chi2
    found = {name: table["ratio"] for name, table in pairs[0].effects.items()}
    assert found == {name: pytest.approx(table["ratio"], rel=0.2) for name, table in EFFECTS.items()}
