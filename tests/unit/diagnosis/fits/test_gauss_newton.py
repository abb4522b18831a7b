"""Refits: an effect on a number of the rig table takes over the deviation of that number."""

import time

import numpy as np
import pytest

from diagnosis.fits.batch import together
from diagnosis.fits.fit import step_within
from diagnosis.fits.gauss_newton import FAR_KNEE, Fitter
from diagnosis.gap.measure import floor_of, replicates
from diagnosis.gap.problem import OutOfTimeError, Problem
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import Roughness
from tests.prepared import fitter_of, prepared


def fitter_of_one_run(effects):
    evidence, runs = prepared("ladder", effects)
    problem, nuisances = Problem(evidence.rig, runs[:1]), Nuisances(evidence.rig)
    point = nuisances.point(np.zeros(len(nuisances)), {})
    floor = floor_of(problem, point, replicates(problem, point, Roughness(0.003, 1.5e-4, 0), 12, 1))
    return Fitter(problem, floor, nuisances)


@pytest.fixture
def fitter():
    return fitter_of_one_run({"static-level": {"ratio": -0.1}})


def start_of(fitter, name):
    return next(trial for trial in trials(fitter.problem) if trial.hypothesis.effects == (name,))


@pytest.mark.slow
def test_an_effect_on_a_level_takes_over_the_deviation_of_its_number(fitter):
    """Start at the rig retuned without the effect: the number is at its bound, the effect 0."""
    retuned = together(fitter.predicted_many, [fitter.retuning(np.zeros(len(fitter.nuisances)))])[0]
    static = fitter.nuisances.names.index("static_force_N")
    assert retuned.deviations[static] == pytest.approx(-3.3)
    trial = start_of(fitter, "static-level")
    fit = fitter.refit(trial.hypothesis, retuned.deviations, np.zeros(1))
    # separate derivatives would end at -0.066 and a deviation of -1.3
    assert fit.hypothesis.tables(fit.w)["static-level"]["ratio"] == pytest.approx(-0.1, abs=0.003)
    assert abs(fit.deviations[static]) < 0.2


@pytest.mark.slow
def test_a_prediction_that_would_end_too_late_is_not_begun(fitter):
    problem, (point,) = fitter.problem, [fitter.nuisances.point(np.full(len(fitter.nuisances), 0.1), {})]
    assert 0.0 < problem.pace < 60.0
    problem.until_s = time.monotonic() + 100.0
    problem.pace = 1e3
    with pytest.raises(OutOfTimeError):
        problem.predicted(point)
    problem.pace = 0.0
    assert np.isfinite(problem.predicted(point)).any()


@pytest.mark.slow
def test_a_rig_that_cannot_be_is_further_off_than_any_other(fitter):
    described = np.zeros(len(fitter.nuisances))
    yielding, sliding = start_of(fitter, "base-compliance"), start_of(fitter, "coulomb-level")
    weightless = yielding.w + 20.0  # as soft and as quick as the ranges allow
    rough = np.array([30.0])
    impossible = fitter.predicted(described, yielding.hypothesis.tables(weightless))
    assert not np.isfinite(impossible).any()
    even = fitter.bare(described, fitter.predicted(described, sliding.hypothesis.tables(rough)), FAR_KNEE).chi2
    assert fitter.bare(described, impossible, FAR_KNEE).chi2 > even > 1e3


@pytest.mark.slow
def test_single_numbers_lead_on_where_derivatives_lead_astray():
    """Where friction is late by more than a third of a slip, chi2 is jagged in every number of the rig at once."""
    late = {"frictional-lag": {"form": "dead-time", "delay_s": 5.5e-3, "share": 1.0}}
    fitter = fitter_of(*prepared("short", late))
    form = next(
        trial.hypothesis
        for trial in trials(fitter.problem)
        if trial.hypothesis.forms == {"frictional-lag": "dead-time"}
    )
    described, w = (
        np.zeros(len(fitter.nuisances)),
        np.log([5.5e-3, 1.0]) - np.log([axis.scale for axis in form.coordinates]),
    )
    residual, _ = fitter.whitened(fitter.predicted(described, form.tables(w)))
    assert fitter.refit(form, described, w).chi2 < 0.7 * (residual @ residual)  # without them, as much as there


def predictions_and_fit(fitter, work):
    """How many predictions a fit takes, and the fit."""
    asked = []

    def predicted(points, perhaps=()):
        asked.extend(points)
        return fitter.predicted_many(points, perhaps)

    (fit,) = together(predicted, [work])
    return len(asked), fit


def test_a_coordinate_at_its_bound_stays_only_if_the_step_would_leave_the_bound():
    normal = np.array([[2.0, 1.0], [1.0, 2.0]])
    at, most = np.array([3.3, 0.0]), np.array([3.3])
    outward, free = step_within(normal, np.array([1.0, 0.2]), at, most)
    assert outward == pytest.approx([0.0, 0.1])  # the free coordinate moves as if the first did not exist
    assert free.tolist() == [False, True]
    inward, free = step_within(normal, np.array([-1.0, 0.2]), at, most)
    assert inward == pytest.approx(np.linalg.solve(normal, [-1.0, 0.2]))
    assert free.all()
