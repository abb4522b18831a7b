"""A force-driven axis: the model follows the measured motion, and the forces are compared."""

import math
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from bridge.faults import Fault
from diagnosis.evidence.folder import load_evidence
from diagnosis.gap.measure import differences, floor_of, gap, replicates
from diagnosis.gap.prepare import Prepared, prepare
from diagnosis.gap.problem import Point, Problem
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.hypotheses.waves import axis_waves
from diagnosis.model.rig import Effects, Roughness
from diagnosis.model.sensor_chain import SensorChain, relative, sensed, true_commands
from tests.made_evidence import made_evidence
from tests.made_protocols import case_of

ROUGH = Roughness(0.003, 2e-4, 0)
WAVE: Effects = {"position-dependent-friction": {"form": "wave", "ratio": 0.05, "wavelength_m": 0.02, "phase_rad": 1.0}}
GAIN: Effects = {"force-sensor-gain": {"form": "", "ratio": 0.05}}


def made(effects: Effects) -> tuple[Problem, list[Prepared], Point]:
    """The fitted runs of an axis with the described parameters and these effects."""
    evidence = load_evidence(made_evidence(case_of("force", effects, drawn=False), seed=5))
    runs = [run for run in prepare(evidence) if not run.holdout]
    nuisances = Nuisances(evidence.rig)
    return Problem(evidence.rig, runs), runs, nuisances.point(np.zeros(len(nuisances)), {})


def gap_of(problem: Problem, point: Point, effects: Effects) -> float:
    floor = floor_of(problem, point, replicates(problem, point, ROUGH, 12, 1))
    return gap(floor, differences(floor, problem, problem.predicted(point._replace(effects=effects))))


@pytest.fixture(scope="module")
def plain() -> tuple[Problem, list[Prepared], Point]:
    return made({})


@pytest.mark.slow
def test_a_described_axis_has_no_gap_and_is_followed(plain: tuple[Problem, list[Prepared], Point]) -> None:
    problem, runs, point = plain
    assert 0.4 < gap_of(problem, point, {}) < 1.6
    assert np.isfinite(problem.measured).mean() > 0.9
    for run in runs:
        predicted = problem.signals(run, point)
        assert np.abs(predicted["mass_position_m"] - run.signals["mass_position_m"]).max() < 1e-3
        assert np.std(predicted["drive_force_N"] - run.signals["drive_force_N"]) < 1.0  # the encoder's noise


@pytest.mark.slow
@pytest.mark.parametrize("effects", [WAVE, GAIN], ids=lambda effects: next(iter(effects)))
def test_an_effect_opens_a_gap_that_only_it_closes(effects: Effects) -> None:
    problem, runs, point = made(effects)
    assert gap_of(problem, point, {}) > 2.0
    assert 0.4 < gap_of(problem, point, effects) < 1.6
    if effects is WAVE:
        wave = axis_waves(runs, "position", 1)[0]
        assert wave.period == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize(
    "effects",
    [
        GAIN,
        {"force-sensor-bias": {"form": "", "bias_N": 2.0}},
        {"force-sensor-drift": {"form": "linear", "rate_N_per_s": 0.1}},
        {"force-sensor-drift": {"form": "settling", "drift_N": 1.0, "settling_s": 2.0}},
        {"force-sensor-delay": {"form": "", "delay_s": 3e-3}},
        {"force-sensor-lag": {"form": "first-order", "lag_s": 4e-3}},
        {"force-sensor-lag": {"form": "second-order", "lag_s": 2e-3}},
    ],
    ids=lambda effects: next(iter(effects)),
)
@pytest.mark.slow
def test_the_true_force_yields_the_measured_force_through_the_sensor(
    plain: tuple[Problem, list[Prepared], Point], effects: Effects
) -> None:
    run = plain[1][0]
    chain = relative(SensorChain(force_delay_s=5e-4, position_delay_s=2e-4))
    smooth = 40.0 * np.sin(2.0 * np.pi * 2.0 * np.arange(len(run.commands.drive)) * 1e-3)
    commands = true_commands(run.commands._replace(drive=smooth), effects, chain)
    signals = dict.fromkeys(run.signals | {"drive_position_m": 0, "mass_accel_mps2": 0, "base_accel_mps2": 0}, smooth)
    signals |= dict.fromkeys(("mass_shake_mps2", "base_shake_mps2"), smooth) | {"drive_force_N": commands.drive}
    shown = sensed(signals, run.commands.frequency_Hz, effects, chain)["drive_force_N"]
    inner = slice(100, -100)
    assert shown[inner] == pytest.approx(smooth[inner], abs=0.05)  # N of 40 N: a lag is compensated to second order


def test_an_axis_that_barely_moves_is_refused(plain: tuple[Problem, list[Prepared], Point], tmp_path: Path) -> None:
    """It rests for all but the last 0.3 s."""
    shutil.copytree(made_evidence(case_of("force", drawn=False), seed=5), tmp_path / "rests")
    file = tmp_path / "rests" / "run-01.parquet"
    table = pq.read_table(file)
    position_m = table["mass_position_m"].to_numpy().copy()
    position_m[:-300] = position_m[0] + 1e-7 * np.random.default_rng(1).standard_normal(len(position_m) - 300)
    position_m[-300:] += position_m[0] - position_m[-300]
    at = table.column_names.index("mass_position_m")
    pq.write_table(table.set_column(at, "mass_position_m", pa.array(position_m)), file)
    with pytest.raises(Fault, match=r"run-01.parquet: mass_position_m: moves for 0\.\d+ s: must be 0.5 s at least"):
        prepare(load_evidence(tmp_path / "rests"))


def test_a_clipped_force_is_clipped_in_the_model_too(plain: tuple[Problem, list[Prepared], Point]) -> None:
    problem, runs, point = plain
    force_N = problem.signals(runs[0], point)["drive_force_N"]
    clipped = runs[0]._replace(clipped={"drive_force_N": (-math.inf, 0.5 * float(force_N.max()))})
    assert problem.signals(clipped, point)["drive_force_N"].max() == 0.5 * force_N.max()
