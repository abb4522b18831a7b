"""Every segment of the model begins with the force that was measured there: stuck, or sliding where nothing slips."""

import numpy as np
import pytest

from diagnosis.nuisance import Nuisances
from diagnosis.problem import Problem
from tests.prepared import prepared


@pytest.fixture(scope="module")
def ladder(tmp_path_factory):
    return prepared(tmp_path_factory.mktemp("entries") / "ladder", "ladder")


def shaken_run(runs):
    return next(run for run in runs if run.commands.frequency_Hz.any())


def test_entries_are_sticks_and_even_sliding(ladder):
    _, runs = ladder
    run = shaken_run(runs)
    segments = {segment.first: segment for segment in run.commands.segments}
    assert any(segment.still for segment in segments.values())
    assert any(segment.slips for segment in segments.values())
    for entry in run.entries:
        segment = segments[entry.block]
        assert (entry.age_s is None) == segment.still
        read_N = run.signals["drive_force_N"][entry.block : entry.block + 3].mean()
        assert entry.force_N == pytest.approx(read_N, abs=0.1)
        if entry.age_s is not None:
            assert 0.0 < entry.age_s < 2.0


@pytest.mark.parametrize(
    "effects",
    [
        {},
        {"drive-backlash": {"gap_m": 1e-4}},
        {"drive-hardening": {"form": "cubic", "ratio": 0.3}},
        {"drive-hardening": {"form": "bilinear", "knee_m": 8e-4, "ratio": 0.5}},
        {"frame-compliance": {"ratio": 0.2, "frequency_Hz": 60.0, "damping_ratio": 0.05}},
        {"force-sensor-gain": {"form": "", "ratio": 0.05}, "force-sensor-bias": {"form": "", "bias_N": 0.8}},
        {"force-sensor-drift": {"form": "settling", "drift_N": 1.0, "settling_s": 4.0}},
    ],
    ids=lambda effects: "+".join(effects) or "none",
)
def test_the_model_shows_the_entrys_force_whatever_its_spring_and_its_sensor(ladder, effects):
    evidence, runs = ladder
    problem, nuisances = Problem(evidence.rig, runs), Nuisances(evidence.rig)
    run = shaken_run(runs)
    tables = {name: {"form": table.get("form", "")} | table for name, table in effects.items()}
    shown = problem.signals(run, nuisances.point(np.zeros(len(nuisances)), tables))["drive_force_N"]
    for entry in run.entries:
        begin = np.polyfit(np.arange(10) + 0.5, shown[entry.block : entry.block + 10], 1)[1]
        assert begin == pytest.approx(entry.force_N, abs=0.03), entry


def test_when_the_vibration_catches_the_slide_changes_no_level(ladder):
    """A climb that starts 0.2 N higher is at another phase of its cycle when the vibration comes on."""
    evidence, runs = ladder
    problem, nuisances = Problem(evidence.rig, runs), Nuisances(evidence.rig)
    run = shaken_run(runs)
    point = nuisances.point(np.zeros(len(nuisances)), {})
    other = run._replace(start=run.start._replace(force_N=run.start.force_N + 0.2))
    still = next(segment for segment in run.commands.segments if segment.still)
    rows = slice(still.first, still.last)

    def apart_N(first, second):
        forces = [problem.signals(one, point)["drive_force_N"][rows] for one in (first, second)]
        return float(np.abs(forces[0] - forces[1]).max())

    assert apart_N(run, other) < 1e-3
    assert apart_N(run._replace(entries=()), other._replace(entries=())) > 0.1
