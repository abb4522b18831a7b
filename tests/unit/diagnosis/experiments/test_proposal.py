"""The next experiment: another speed or dwell separates two effects, or a check by hand where no run can."""

import numpy as np
import pytest

from diagnosis.experiments.candidate_runs import plans
from diagnosis.experiments.proposal import advice, next_experiment
from diagnosis.features.grid import BLOCK_S
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.gap.measure import floor_of, replicates
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import Roughness
from plant.effects.library import EFFECTS
from tests.prepared import prepared


@pytest.fixture(scope="module")
def one_speed():
    """A run at one speed, whose ageing looks like another static friction."""
    ageing = {"static-friction-ageing": {"form": "log", "ratio": 0.04}}
    evidence, runs = prepared("constant", ageing)
    problem, nuisances = Problem(evidence.rig, runs[:1]), Nuisances(evidence.rig)
    start = np.zeros(len(nuisances))
    point = nuisances.point(start, {})
    fitter = Fitter(
        problem, floor_of(problem, point, replicates(problem, point, Roughness(0.003, 2e-4, 0), 8, 1)), nuisances
    )
    fits = {}
    for trial in trials(problem):
        name = trial.hypothesis.effects[0]
        if name in {"static-friction-ageing", "static-level"} and name not in fits:
            fits[name] = fitter.refit(trial.hypothesis, start, trial.w)
    return problem, nuisances, fits


@pytest.mark.slow
def test_speed_or_dwell_separates_ageing_from_static_level(one_speed):
    problem, nuisances, fits = one_speed
    leaders = [fits["static-friction-ageing"], fits["static-level"]]
    proposal = next_experiment(problem, nuisances, leaders)
    assert proposal.gain is not None
    assert proposal.gain > 3.0
    assert "hold the drive" in proposal.what or "0.5 mm/s" not in proposal.what
    assert "static-friction-ageing and static-level" in proposal.why
    assert next_experiment(problem, nuisances, leaders) == proposal


@pytest.mark.slow
def test_effects_with_equal_predictions_get_a_check_by_hand(one_speed):
    problem, nuisances, fits = one_speed
    fit = fits["static-level"]
    # the same model plus a second effect of size 0
    axis = fit.hypothesis.coordinates[0]
    nothing = axis._replace(effect="force-sensor-gain", scale=1e-9)
    form = fit.hypothesis._replace(forms=fit.hypothesis.forms | {"force-sensor-gain": ""}, coordinates=(axis, nothing))
    columns = np.column_stack([fit.columns, np.zeros(len(fit.columns))])
    twin = fit._replace(hypothesis=form, w=np.append(fit.w, 0.0), columns=columns)
    proposal = next_experiment(problem, nuisances, [fit, twin])
    assert proposal.what == advice(("static-level", "force-sensor-gain"), "spring")
    # a check by hand has no gain from a run
    assert proposal.gain is None
    assert "no run separates them by more than 0.0 standard deviations: this is a check by hand" in proposal.why


@pytest.mark.slow
def test_one_explanation_needs_no_comparison(one_speed):
    problem, nuisances, fits = one_speed
    assert next_experiment(problem, nuisances, [fits["static-level"]]).gain is None


def at_speed(problem, speed_mps: float, seconds: float) -> Problem:
    """The same rig with one run at this speed."""
    (run,) = problem.runs
    (segment, *_) = run.commands.segments
    alone = segment._replace(first=0, last=round(seconds / BLOCK_S), drive_velocity_mps=speed_mps)
    return Problem(problem.rig, [run._replace(commands=run.commands._replace(segments=(alone,)))])


@pytest.mark.parametrize(
    ("seconds", "speeds"), [(1.5, {"6 mm/s", "15 mm/s"}), (9.5, {"6 mm/s", "15 mm/s", "60 mm/s", "150 mm/s"})]
)
def test_no_run_is_shorter_than_evidence_may_be_or_goes_further_than_its_runs_did(one_speed, seconds, speeds):
    problem, _, _ = one_speed
    single = [plan for plan in plans(at_speed(problem, 0.03, seconds)) if "without vibration" in plan.what]
    assert {plan.what.split(" for ")[0].removeprefix("Drag at ") for plan in single} == speeds
    assert all(plan.steps[0].seconds >= 1.0 for plan in single)


def test_every_pair_of_effects_has_advice():
    for a in EFFECTS:
        for b in EFFECTS:
            if a != b:
                for drive in ("spring", "force"):
                    assert advice((a, b), drive).endswith(".")
    assert "weight" in advice(("coulomb-level", "force-sensor-gain"), "spring")
    assert "tap" in advice(("drive-damping", "force-sensor-delay"), "spring")
