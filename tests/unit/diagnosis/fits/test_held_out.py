"""The gap on held-out runs."""

import math

import numpy as np
import pytest

from diagnosis.fits.fit import Fit
from diagnosis.fits.held_out import HeldOut
from diagnosis.gap.measure import Floor
from diagnosis.hypotheses.hypothesis import NOTHING, Coordinate, Hypothesis

ONES = np.ones(1)
LOAD = Hypothesis(
    {"normal-load-fluctuation": "sine"},
    (Coordinate("normal-load-fluctuation", "phase_rad of b.csv", 1.0, False, 1.0, -4.0, 4.0),),
)


def fit_of(hypothesis: Hypothesis) -> Fit:
    return Fit(hypothesis, ONES, np.zeros(len(hypothesis.coordinates)), 0.0, ONES, np.ones((1, 1)))


def test_a_wave_of_unknown_phase_is_measured_by_its_wider_floor() -> None:
    """A cell that differs by the level of its floor, 1 or 2, is 1 floor off with either floor."""
    narrow = Floor(0 * ONES, ONES < 0, ONES, ONES > 0, np.eye(1), (("force", "stick", (0.0, 20.0), "a"),), 1.0)
    held_out = HeldOut.__new__(HeldOut)
    held_out.floor, held_out._wider = narrow, narrow._replace(level=2.0)
    held_out._differences = lambda fits: [np.array([held_out._floor_of(fits[0]).level])] * len(fits)
    (exactly,) = held_out._squares([fit_of(NOTHING)])
    assert held_out._squares([fit_of(LOAD)])[0] == pytest.approx(exactly, rel=0.1)


def test_without_compared_features_the_shrinkage_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    held_out = HeldOut.__new__(HeldOut)
    monkeypatch.setattr(HeldOut, "_squares", lambda _self, _fits: [np.zeros(0)])
    held_out.retuned = HeldOut._gap(np.zeros(0))
    closed = held_out.closed_by(fit_of(NOTHING))
    assert math.isnan(closed.gap)
    assert closed.shrinkage is closed.interval_90 is None
