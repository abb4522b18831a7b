"""A wave over time that begins in another phase in every run."""

import math

import numpy as np
import pytest

from diagnosis.fits.batch import together
from diagnosis.fits.estimates import estimate_of
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.gap.measure import floor_of, replicates
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.hypothesis import Coordinate
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.hypotheses.starts import wave_trial
from diagnosis.hypotheses.waves import Wave
from diagnosis.model.per_run import PHASE, as_in_rig_file, has_own_phases, in_run, is_phase, of_run
from diagnosis.model.rig import Roughness
from diagnosis.report.words import estimate_in_words
from diagnosis.result import Estimate
from tests.prepared import prepared

LOAD = {"form": "sine", "ratio": 0.06, "frequency_Hz": 0.9}
LATER = 2.4  # rad, in the second run


@pytest.fixture(scope="module")
def problem():
    """Two runs of one rig under a load that turned on between them."""
    evidence, first = prepared("ladder", {"normal-load-fluctuation": LOAD | {"phase_rad": 0.4}})
    _, second = prepared("ladder", {"normal-load-fluctuation": LOAD | {"phase_rad": 0.4 + LATER}})
    return Problem(evidence.rig, [first[0], second[1]])


def table_of(trial):
    return trial.hypothesis.tables(trial.w)["normal-load-fluctuation"]


def apart(problem):
    """Where refits of a load begin that has a phase in every run."""
    loads = [trial for trial in trials(problem) if trial.hypothesis.effects == ("normal-load-fluctuation",)]
    return [trial for trial in loads if has_own_phases(table_of(trial))]


@pytest.mark.slow
def test_runs_apart_show_the_wave_with_a_phase_for_each(problem):
    name = of_run(PHASE, problem.runs[1].file)
    best = min(map(table_of, apart(problem)), key=lambda table: abs(float(table["frequency_Hz"]) - 0.9))
    assert best["frequency_Hz"] == pytest.approx(0.9, rel=0.1)
    assert best["ratio"] == pytest.approx(0.06, rel=0.3)
    later = float(best[name]) - float(best["phase_rad"])
    assert math.remainder(later - LATER, 2.0 * math.pi) == pytest.approx(0.0, abs=0.8)


@pytest.mark.slow
def test_a_refit_finds_both_phases(problem):
    nuisances = Nuisances(problem.rig)
    described = np.zeros(len(nuisances))
    point = nuisances.point(described, {})
    fitter = Fitter(
        problem, floor_of(problem, point, replicates(problem, point, Roughness(0.003, 1.5e-4, 0), 16, 1)), nuisances
    )
    near = Wave(1.0 / 0.91, 0.05, 0.6, spread=0.06, phases_of={of_run(PHASE, problem.runs[1].file): 2.5})
    trial = wave_trial("normal-load-fluctuation", "sine", near, 0.1)
    going = fitter.going_further(fitter.refit(trial.hypothesis, described, trial.w))
    fit = together(fitter.predicted_many, [going])[0]
    table = fit.effects["normal-load-fluctuation"]
    assert table["ratio"] == pytest.approx(0.06, rel=0.1)
    later = float(table[of_run(PHASE, problem.runs[1].file)]) - float(table["phase_rad"])
    assert math.remainder(later - LATER, 2.0 * math.pi) == pytest.approx(0.0, abs=0.25)
    one_phase = fitter.predicted(fit.deviations, {"normal-load-fluctuation": as_in_rig_file(table)})
    assert np.sum(fitter.whitened(one_phase)[0] ** 2) > 3.0 * fit.chi2


TABLE = LOAD | {"phase_rad": 0.4, of_run(PHASE, "run-02.csv"): 2.8}


def test_every_fitted_run_has_its_phase_and_a_held_out_run_a_random_one():
    assert in_run(TABLE, "run-01.csv", False, None) == LOAD | {"phase_rad": 0.4}
    assert in_run(TABLE, "run-02.csv", False, 5) == LOAD | {"phase_rad": 2.8}
    assert in_run(TABLE, "run-03.csv", True, None) is None  # the mean over the unknown phase
    drawn = [in_run(TABLE, "run-03.csv", True, seed) for seed in range(200)]
    phases = np.array([table["phase_rad"] for table in drawn if table])
    assert len(phases) == 200
    assert abs(np.exp(1j * phases).mean()) < 0.2
    assert in_run(LOAD | {"phase_rad": 0.4}, "run-03.csv", True, None) == LOAD | {"phase_rad": 0.4}  # one phase for all


def test_a_rig_file_has_the_phase_of_the_first_run():
    assert as_in_rig_file(TABLE) == LOAD | {"phase_rad": 0.4}
    assert [is_phase(name) for name in ("phase_rad", of_run(PHASE, "a.csv"), "frequency_Hz")] == [True, True, False]


def test_a_phase_is_named_with_its_run():
    assert estimate_in_words("normal-load-fluctuation", of_run(PHASE, "run-02.csv"), Estimate(1.234, (1.13, 1.33))) == (
        "phase in run-02.csv 1.23 rad (90 %: 1.13 to 1.33)"
    )


def test_the_interval_of_a_phase_holds_it_wherever_it_lies():
    axis = Coordinate("normal-load-fluctuation", "phase_rad", 1.0, False, 3.0, -math.pi, math.pi)
    for w, deviation in ((2.75, 0.5), (-3.1, 0.1), (9.0, 0.2), (0.5, 50.0)):
        value, (low, high) = estimate_of(axis, w, deviation)
        assert low <= value <= high
        assert high - low == pytest.approx(min(2 * 1.645 * deviation, 2 * math.pi))
