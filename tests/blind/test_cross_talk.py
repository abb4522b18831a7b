"""A rig with nothing wrong but the exciter's voltage in the force sensor's cable, which means over 1 ms do not show."""

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from diagnosis.evidence import load_evidence
from tests.blind.generators import Plan
from tests.blind.independent_cases import Independent
from tests.blind.small_set import RUNS


def test_it_is_unexplained_and_told_with_where_and_what_next(tmp_path):
    source = Independent(RUNS)
    cross_talk = source.draw(np.random.default_rng(1), "piezo-cross-talk")
    source.make(tmp_path, Plan(effects=(cross_talk,)), seed=11)
    found = diagnose(load_evidence(tmp_path), lambda *_: None)
    assert found.verdict == "unexplained"
    assert found.effects == ()
    assert found.where[0].signal == "drive_force_N"
    assert found.where[0].band_Hz in {
        (2450.0, 2550.0),
        (4450.0, 4550.0),
    }  # the highest of the vibrations of each of RUNS
    assert "drive_force_N vibrates with" in " ".join(found.summary)
    assert "Uncouple" in found.next_experiment.what
    assert sum(cell.share for cell in found.where) == pytest.approx(1.0)
