"""Starts on top of a fit, on a linear model: a promise is then exact."""

import numpy as np
import pytest

from diagnosis.fits.fit import Fit
from diagnosis.fits.screening import Screening
from diagnosis.hypotheses.hypothesis import NOTHING, Coordinate, Hypothesis
from diagnosis.hypotheses.starts import Trial

RANDOM = np.random.default_rng(5)
COLUMNS = RANDOM.normal(size=(200, 3)) * 30.0
CHANGE = RANDOM.normal(size=200) * 30.0
EFFECT = Coordinate("force-sensor-gain", "ratio", 0.05, logarithmic=False, prior=1e6, low=-1.0, high=1.0)
TRIAL = Trial(Hypothesis({"force-sensor-gain": ""}, (EFFECT,)), np.array([0.5]))


def rig(residual: np.ndarray, deviations: np.ndarray) -> Fit:
    return Fit(NOTHING, deviations, np.zeros(0), float(residual @ residual), residual, COLUMNS)


def test_a_promise_has_the_size_of_the_effect_and_the_nuisances_that_the_effect_had_moved() -> None:
    true, moved = np.array([0.2, -1.0, 0.5]), np.array([2.0, 2.5, -2.0])
    start = Screening(rig(COLUMNS @ (true - moved) - 3.0 * CHANGE, moved)).promised(TRIAL, CHANGE)
    assert start is not None
    assert start.w == pytest.approx([-1.5], rel=1e-3)  # three times the trial, of the other sign
    assert start.deviations == pytest.approx(true, abs=1e-2)
    assert start.chi2 < 3.0  # the priors of the nuisances


def test_a_promise_is_no_larger_than_eight_trials_and_three_tolerances() -> None:
    start = Screening(rig(COLUMNS @ np.array([9.0, 0.0, 0.0]) + 20.0 * CHANGE, np.zeros(3))).promised(TRIAL, CHANGE)
    assert start is not None
    assert start.w[0] == 4.0
    assert start.deviations[0] == 3.0


def test_a_trial_that_changes_nothing_promises_nothing() -> None:
    screening = Screening(rig(CHANGE, np.zeros(3)))
    assert screening.promised(TRIAL, np.zeros(200)) is None
    assert screening.promised(TRIAL, 1e-5 * COLUMNS[:, 1]) is None  # a nuisance does it
