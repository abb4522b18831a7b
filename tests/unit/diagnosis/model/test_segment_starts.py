"""Every segment of the model begins with the force that was measured there: stuck, or sliding where nothing slips."""

import numpy as np
import pytest

from diagnosis.features.feature import scales_of
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import CommandedRun, Segment
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.per_run import is_of_run, of_run
from diagnosis.model.segment_starts import entries_of
from tests.prepared import prepared


@pytest.fixture(scope="module")
def ladder():
    return prepared("ladder")


def shaken_run(runs):
    return next(run for run in runs if run.commands.frequency_Hz.any())


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_contact_that_no_slip_has_renewed_keeps_its_age(ladder):
    evidence, runs = ladder
    begun = [entry for run in runs for entry in run.entries if entry.from_before]
    run = shaken_run(runs)
    assert begun == [run.entries[0]]
    problem, nuisances = Problem(evidence.rig, runs), Nuisances(evidence.rig)
    first, *_ = run.commands.segments
    ageing = {"form": "log", "ratio": 0.02, "age_scale_s": 0.1}

    def breakaway(age_before_s, file=run.file):
        table = ageing | {of_run("age_before_s", file): age_before_s}
        point = nuisances.point(np.zeros(len(nuisances)), {"static-friction-ageing": table})
        force_N = problem.signals(run, point)["drive_force_N"][: first.last]
        return float(force_N.max()), float(force_N.argmax()) * BLOCK_S

    (young_N, young_s), (old_N, old_s) = breakaway(1.0), breakaway(10.0)
    grown_N = ageing["ratio"] * evidence.rig.static_force_N * np.log((10.1 + old_s) / (1.1 + young_s))
    assert old_N - young_N == pytest.approx(grown_N, rel=0.06)  # the bristle takes some of the age before it breaks
    assert breakaway(1.0, file="another") == (old_N, old_s)
    axes = [
        trial.hypothesis.coordinates for trial in trials(problem) if "static-friction-ageing" in trial.hypothesis.forms
    ]
    assert {axis.name for of_form in axes for axis in of_form if is_of_run(axis.name)} == {
        of_run("age_before_s", run.file)
    }


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_age_counts_from_the_last_slip_under_whichever_drive(ladder, sign):
    """At 5 mm/s slips end at 180, 380, ...; at 0.5 mm/s from 1000 on the same climb takes ten times as long."""
    evidence, _ = ladder
    rows = np.arange(6000)
    tops = np.arange(150, 1000, 200)
    at = [0, *np.stack([tops, tops + 30], axis=1).ravel(), 2700, 2730, 4400, 4430, 6000]
    force_N = sign * np.interp(rows, at, [13.0, *[17.0, 11.0] * 7, 17.0])
    drive = np.where(rows < 1000, sign * 5e-3, sign * 5e-4)
    segments = (
        Segment(400, 1000, sign * 5e-3, 0.0, 0.0, slips=3),
        Segment(1100, 6000, sign * 5e-4, 0.0, 0.0, slips=1),
    )
    commands = CommandedRun(drive, np.zeros(6000), np.zeros(6000), segments)
    first, second = entries_of({"drive_force_N": force_N}, commands, scales_of(evidence.rig))
    assert (first.age_s, second.age_s) == pytest.approx((0.02, 0.12))
    assert not first.from_before
    assert not second.from_before


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
        forces = [problem.signals(part, point)["drive_force_N"][rows] for part in (first, second)]
        return float(np.abs(forces[0] - forces[1]).max())

    assert apart_N(run, other) < 1e-3
    assert apart_N(run._replace(entries=()), other._replace(entries=())) > 0.1
