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


@pytest.fixture
def fitter(tmp_path):
    evidence, runs = prepared(tmp_path / "one", "ladder", {"static-level": {"ratio": -0.1}})
    problem, nuisances = Problem(evidence.rig, runs[:1]), Nuisances(evidence.rig)
    point = nuisances.point(np.zeros(len(nuisances)), {})
    floor = floor_of(problem, point, replicates(problem, point, Roughness(0.003, 1.5e-4, 0), 12, 1))
    return Fitter(problem, floor, nuisances)


def start_of(fitter, name):
    return next(one for one in trials(fitter.problem) if one.form.effects == (name,))


def test_a_level_takes_over_what_its_number_was_moved_by(fitter):
    """From where the rig was retuned for want of the effect: the number at its bound, the effect nothing."""
    retuned = fitter.retuned(np.zeros(len(fitter.nuisances)))
    static = fitter.nuisances.names.index("static_force_N")
    assert retuned.deviations[static] == pytest.approx(-3.3)
    trial = start_of(fitter, "static-level")
    fit = fitter.refit(trial.form, retuned.deviations, np.zeros(1))
    # with a derivative for each, -0.066 and -1.3
    assert fit.form.tables(fit.w)["static-level"]["ratio"] == pytest.approx(-0.1, abs=0.003)
    assert abs(fit.deviations[static]) < 0.2


def test_a_rig_that_cannot_be_is_further_off_than_any_other(fitter):
    described = np.zeros(len(fitter.nuisances))
    yielding, sliding = start_of(fitter, "base-compliance"), start_of(fitter, "coulomb-level")
    weightless = yielding.w + 20.0  # as soft and as quick as the ranges allow
    rough = np.array([30.0])
    impossible = fitter.predicted(described, yielding.form.tables(weightless))
    assert not np.isfinite(impossible).any()
    even = fitter.far_chi2(sliding.form, (described, rough), fitter.predicted(described, sliding.form.tables(rough)))
    assert fitter.far_chi2(yielding.form, (described, weightless), impossible) > even > 1e3
