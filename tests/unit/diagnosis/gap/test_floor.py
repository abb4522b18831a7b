"""The noise floor of features that a model does not show."""

import warnings
from types import SimpleNamespace
from typing import Any

import numpy as np

from diagnosis.gap.measure import floor_of


def test_a_floor_that_compares_nothing_warns_of_nothing() -> None:
    label = SimpleNamespace(name="rest", signal="drive_force_N", regime="steady", band_Hz=None, segment=-1)
    rig, scales = SimpleNamespace(drive="spring"), (1.0, 1.0, 1.0, 1.0, 1.0)
    fields = {"labels": [("a.csv", label)], "runs": [], "measured": np.array([1.0]), "rig": rig, "scales": scales}
    problem: Any = SimpleNamespace(predicted=lambda _point: np.array([np.nan]), **fields)
    point: Any = None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        floor = floor_of(problem, point, np.full((12, 1), np.nan))
    assert not floor.compared.any()
    assert np.isnan(floor.level)
