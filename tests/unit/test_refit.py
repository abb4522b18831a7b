"""Refits: an effect that changes a number of the rig table takes over what that number was moved by."""

import numpy as np
import pytest

from diagnosis.gap import floor_of, replicates
from diagnosis.library import trials
from diagnosis.nuisance import Nuisances
from diagnosis.problem import Problem
from diagnosis.refit import Fitter
from diagnosis.twin import Roughness
from tests.prepared import prepared


def test_a_level_takes_over_what_its_number_was_moved_by(tmp_path):
    """From where the rig was retuned for want of the effect: the number at its bound, the effect nothing."""
    evidence, runs = prepared(tmp_path / "one", "ladder", {"static-level": {"ratio": -0.1}})
    problem, nuisances = Problem(evidence.rig, runs[:1]), Nuisances(evidence.rig)
    described = np.zeros(len(nuisances))
    point = nuisances.point(described, {})
    floor = floor_of(problem, point, replicates(problem, point, Roughness(0.003, 1.5e-4, 0), 12, 1))
    fitter = Fitter(problem, floor, nuisances)
    retuned = fitter.retuned(described)
    static = nuisances.names.index("static_force_N")
    assert retuned.deviations[static] == pytest.approx(-3.3)
    trial = next(one for one in trials(problem) if one.form.effects == ("static-level",))
    fit = fitter.refit(trial.form, retuned.deviations, np.zeros(1))
    # with a derivative for each, -0.066 and -1.3
    assert fit.form.tables(fit.w)["static-level"]["ratio"] == pytest.approx(-0.1, abs=0.003)
    assert abs(fit.deviations[static]) < 0.2
