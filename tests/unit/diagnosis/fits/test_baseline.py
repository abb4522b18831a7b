"""The rig without effects: errors of the sensor chain are fitted, and a right model leaves noise."""

import numpy as np
import pytest

from diagnosis.features.feature import BOW
from diagnosis.fits.baseline import baseline_of
from diagnosis.fits.fit import NOISE
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import rig_config
from tests.prepared import prepared


def untold(_what, _share):
    """No progress."""


@pytest.fixture(scope="module")
def evidence_and_runs():
    evidence, runs = prepared("short", {})
    return evidence, [run for run in runs if not run.holdout]


@pytest.fixture(scope="module")
def straight(evidence_and_runs):
    evidence, runs = evidence_and_runs
    return baseline_of(Problem(evidence.rig, runs), untold)


@pytest.mark.slow
@pytest.mark.nightly  # 6 s of CPU; the next has the same fit of a chain as described
def test_a_bent_displacement_sensor_causes_no_gap(evidence_and_runs, straight):
    evidence, runs = evidence_and_runs

    def bent(run):
        drive_m = run.signals["drive_position_m"]
        return run._replace(signals=run.signals | {"drive_position_m": drive_m * (1.0 + 0.008 - 0.4 * drive_m)})

    problem = Problem(evidence.rig, [bent(run) for run in runs])
    bent_rig = baseline_of(problem, untold)
    slope, bow = (bent_rig.fitter.nuisances.names.index(name) for name in ("drive_slope", "drive_bow_per_m"))
    change = bent_rig.fit.deviations - straight.fit.deviations
    at_m = float(np.mean([run.signals["drive_position_m"].mean() for run in runs]))
    bow_per_m = 4.0 * change[bow] * BOW / problem.travel_m
    assert change[slope] * 0.006 + bow_per_m * at_m == pytest.approx(0.008 - 0.8 * at_m, abs=0.002)
    assert bent_rig.fit.chi2 < straight.fit.chi2 + 30.0


@pytest.mark.slow
def test_evidence_without_a_gap_leaves_about_the_noise(straight):
    expected = NOISE * len(straight.fit.residual)
    assert 0.5 * expected < straight.fit.chi2 < 2.0 * expected


@pytest.mark.slow
def test_the_reported_numbers_equal_the_numbers_of_the_model(evidence_and_runs):
    """Where the friction levels cross, the static force is raised to the Coulomb force."""
    evidence, _ = evidence_and_runs
    rig = evidence.rig.model_copy(update={"tolerance": {"coulomb_force_N": 0.1, "static_force_N": 0.1}})
    nuisances = Nuisances(rig)
    deviations = np.zeros(len(nuisances))
    deviations[nuisances.rig_names.index("coulomb_force_N")] = 3.0
    reported = {parameter.name: parameter.retuned for parameter in nuisances.parameters(deviations)}
    contact = rig_config(rig, nuisances.point(deviations, {}).values, {}, None).contact
    assert reported["coulomb_force_N"] == pytest.approx(1.3 * rig.coulomb_force_N)
    assert reported["static_force_N"] == contact.static_force_N == reported["coulomb_force_N"]
