"""Features of runs with imperfect logs: another clock, a dead or clipped sensor, no force."""

import math

import numpy as np
import pytest

from diagnosis.features.feature import scales_of
from diagnosis.features.slips import find_slips
from diagnosis.gap.prepare import prepare
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.nuisances import Nuisances
from plant.effects.sensors import LAG_ORDERS
from tests.prepared import prepared


@pytest.fixture(scope="module")
def ladder():
    return prepared("ladder")


LATE = {"frictional-lag": {"form": "dead-time", "delay_s": 1e-3, "share": 1.0}}


@pytest.mark.parametrize("clock_s", [40_000.0, -3.0])
@pytest.mark.slow
def test_time_counts_from_the_first_sample(ladder, clock_s):
    """Seconds of the day, and a trigger in the middle of the run."""
    evidence, _ = ladder
    nuisances = Nuisances(evidence.rig)
    point = nuisances.point(np.zeros(len(nuisances)), LATE)
    ours = evidence._replace(runs=evidence.runs[:1])
    other = ours._replace(runs=tuple(run._replace(t_s=run.t_s + clock_s) for run in ours.runs))
    plain_problem, other_problem = (Problem(evidence.rig, prepare(one)) for one in (ours, other))
    assert np.array_equal(plain_problem.measured, other_problem.measured, equal_nan=True)
    assert np.array_equal(plain_problem.predicted(point), other_problem.predicted(point), equal_nan=True)


def test_a_base_that_shows_no_vibration_is_compared_by_that_alone(ladder):
    evidence, runs = ladder
    run = next(run for run in runs if run.commands.frequency_Hz.any())
    still = {name: np.zeros(len(run.commands.drive)) for name in ("base_accel_mps2", "base_shake_mps2")}
    problem = Problem(evidence.rig, [run._replace(signals=run.signals | still)])
    labelled = zip(problem.labels, problem.measured, strict=True)
    by_name = {label.name: value for (_, label), value in labelled if label.signal == "base_accel_mps2"}
    assert by_name["vibration"] < -5.0
    assert math.isnan(by_name["vibration over time"])
    assert math.isnan(by_name["vibration over force"])


def test_a_clipped_accelerometer_gives_no_vibration(ladder):
    evidence, runs = ladder
    clipped = tuple(run._replace(clipped={"base_accel_mps2": (-math.inf, 3.0)}) for run in evidence.runs)
    for run, plain in zip(prepare(evidence._replace(runs=clipped)), runs, strict=True):
        assert plain.signals.keys() - run.signals.keys() == {"base_shake_mps2"}


@pytest.mark.parametrize("mass_kg", [1.5, 50.0])
def test_without_a_force_a_slip_is_known_by_the_force_it_would_be(ladder, mass_kg):
    """A slip that takes twice the smallest fall out of the spring swings the slide by that fall over sqrt(k m)."""
    rig = ladder[0].rig.model_copy(update={"mass_kg": mass_kg})
    scales = scales_of(rig)
    time = np.arange(20_000) * 1e-3
    phase = (time % 0.3) / scales.slip_s
    swing_mps = 2.0 * scales.drop_N / math.sqrt(mass_kg * scales.stiffness_N_per_m)
    slip = np.where(phase < 1.0, swing_mps * np.pi / scales.slip_s * np.cos(np.pi * phase), 0.0)
    for times, slips in ((1.0, True), (0.2, False)):
        assert (len(find_slips({"mass_accel_mps2": times * slip}, scales).tops) > 5) is slips


@pytest.mark.parametrize(("order", "square"), [("first-order", 1.0), ("second-order", 0.75), ("fourth-order", 0.625)])
def test_the_bend_of_force_over_extension_separates_a_slow_sensor_from_a_late_one(ladder, order, square):
    """A force late by T is F - T F' + T^2 F'' / 2, and n equal low-passes that take T have (n + 1) / 2 n there."""
    evidence, runs = ladder
    problem = Problem(evidence.rig, [run for run in runs if not run.commands.frequency_Hz.any()])
    nuisances = Nuisances(evidence.rig)

    def bends_ms2(effects):
        predicted = problem.predicted(nuisances.point(np.zeros(len(nuisances)), effects))
        bends = [
            value for (_, label), value in zip(problem.labels, predicted, strict=True) if label.name == "spring bend"
        ]
        return np.array(bends) / problem.scales.stiffness_N_per_m * 1e6

    late_s = 1.6e-3
    still, late = bends_ms2({}), bends_ms2({"force-sensor-delay": {"form": "", "delay_s": late_s}})
    slow = bends_ms2({"force-sensor-lag": {"form": order, "lag_s": late_s / LAG_ORDERS[order]}})
    # a difference over a quarter of a slip is not quite F''
    assert late - still == pytest.approx(0.5 * 1.6**2, rel=0.15)
    assert (slow - still) / (late - still) == pytest.approx(square / 0.5, rel=0.03)


def test_a_jump_at_the_start_of_a_segment_does_not_count_as_a_cycle(ladder):
    evidence, runs = ladder
    run = next(run for run in runs if any(segment.slips > 3 for segment in run.commands.segments))
    number = next(i for i, segment in enumerate(run.commands.segments) if segment.slips > 3)
    segment = run.commands.segments[number]
    jumped = run.signals["drive_force_N"].copy()
    jumped[segment.first : segment.first + 2] += 3.0 * segment.sign
    levels = []
    for force_N in (run.signals["drive_force_N"], jumped):
        problem = Problem(evidence.rig, [run._replace(signals=run.signals | {"drive_force_N": force_N})])
        labelled = zip(problem.labels, problem.measured, strict=True)
        levels.append([value for (_, label), value in labelled if "level" in label.name and label.segment == number])
    assert np.isfinite(levels[0]).any()
    assert levels[1] == pytest.approx(levels[0], rel=1e-12, nan_ok=True)
