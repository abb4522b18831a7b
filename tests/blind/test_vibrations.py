"""Rigs whose only effect is a vibration that means over 1 ms hide: in a sensor's cable, or at other frequencies."""

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from diagnosis.evidence.folder import load_evidence
from diagnosis.evidence.foreign_vibration import DISTORTED
from tests.blind.generators import Plan
from tests.blind.independent_cases import Independent
from tests.blind.small_set import RUNS


@pytest.mark.slow
@pytest.mark.nightly
def test_cross_talk_is_unexplained_and_reported_with_place_and_next_step(tmp_path):
    source = Independent(RUNS)
    cross_talk = source.draw(np.random.default_rng(1), "piezo-cross-talk")
    source.make(tmp_path, Plan(effects=(cross_talk,)), seed=11)
    diagnosis = diagnose(load_evidence(tmp_path), lambda *_: None)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.effects == ()
    assert diagnosis.where[0].signal == "drive_force_N"
    assert diagnosis.where[0].band_Hz in {
        (2450.0, 2550.0),
        (4450.0, 4550.0),
    }  # the highest of the vibrations of each of RUNS
    assert "drive_force_N vibrates with" in " ".join(diagnosis.summary)
    assert "Uncouple" in diagnosis.next_experiment.what
    assert sum(cell.share for cell in diagnosis.where) == pytest.approx(1.0)


@pytest.mark.slow
def test_harmonics_are_found_where_the_base_vibrates(tmp_path):
    source = Independent(RUNS)
    harmonics = source.draw(np.random.default_rng(1), "piezo-harmonics")
    source.make(tmp_path, Plan(effects=(harmonics,)), seed=11)
    for run in load_evidence(tmp_path).runs:
        lines = [line for line in run.foreign if line.kind == DISTORTED]
        commanded_Hz = run.columns["vibration_frequency_Hz"]
        assert bool(lines) == bool(run.columns["vibration_amplitude_m"].any())
        assert all(np.isin([0.5 * line.frequency_Hz, 2.0 * line.frequency_Hz], commanded_Hz).any() for line in lines)
