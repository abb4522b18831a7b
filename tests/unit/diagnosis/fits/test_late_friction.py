"""Friction that is late by much: found from the runs without vibration, then on the right tooth of the comb."""

import numpy as np
import pytest

from diagnosis.fits.late_friction import late_starts
from diagnosis.hypotheses.catalogue import trials
from tests.prepared import fitter_of, prepared

pytestmark = pytest.mark.slow

DELAY_S, HALF_PERIOD_S = 5.5e-3, 1.0 / (2.0 * 4500.0)


@pytest.fixture(scope="module")
def late():
    """Late by 50 half periods of the fastest vibration."""
    effects = {"frictional-lag": {"form": "dead-time", "delay_s": DELAY_S, "share": 1.0}}
    return fitter_of(*prepared("short", effects))


def test_a_refit_begins_at_the_right_tooth(late):
    starts = late_starts(late, trials(late.problem))
    tables = [form.tables(w)["frictional-lag"] for form, _, w in starts]
    delays_s = [table["delay_s"] for table in tables if table["form"] == "dead-time"]
    assert min(abs(delay_s - DELAY_S) for delay_s in delays_s) < 0.3 * HALF_PERIOD_S
    assert len(starts) <= 6


def test_it_needs_runs_with_vibration_and_without(late):
    fitted_trials = trials(late.problem)
    still, vibrating = {"run-01.parquet"}, {"run-02.parquet"}
    assert late_starts(late.of_runs(vibrating), fitted_trials) == []
    assert late_starts(late.of_runs(still), fitted_trials) == []


def test_runs_add_up(late):
    """The chi2 of two parts of the runs adds up to the chi2 of all."""
    described = np.zeros(len(late.nuisances))

    def left(fitter):
        residual, _ = fitter.whitened(fitter.predicted(described, {}))
        return residual @ residual

    parts = [late.of_runs({"run-01.parquet"}), late.of_runs({"run-02.parquet"})]
    assert sum(left(part) for part in parts) == pytest.approx(left(late))


def test_runs_without_vibration_of_which_nothing_is_compared_start_nothing(late, monkeypatch):
    nothing = late.of_runs({"run-01.parquet"})
    nothing.floor = nothing.floor._replace(compared=np.zeros_like(nothing.floor.compared))
    monkeypatch.setattr(late, "of_runs", lambda _files: nothing)
    assert late_starts(late, trials(late.problem)) == []
