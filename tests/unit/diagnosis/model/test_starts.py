"""Start values of refits: waves and ringing found in the evidence, and the screw phase from the drive's sensor."""

import math

import numpy as np
import pytest

from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.starts import wave_trial
from diagnosis.hypotheses.waves import (
    Wave,
    drive_series,
    friction_series,
    ringing_Hz,
    strongest_waves,
    two_waves,
    waves_beside,
)
from diagnosis.model.predict import predict
from diagnosis.model.rig import rig_config
from tests.prepared import prepared

PITCH_M = 1e-3


@pytest.fixture(scope="module")
def screw():
    ripple = {
        "form": "screw",
        "ratio": 0.08,
        "wavelength_m": PITCH_M,
        "phase_rad": 1.0,
        "second_sin": 0.3,
        "second_cos": -0.4,
    }
    return prepared("ladder", {"drive-speed-ripple": ripple})


@pytest.mark.slow
def test_a_wave_of_the_drive_is_found_with_its_second_harmonic(screw):
    _, runs = screw
    wave = max(
        strongest_waves(drive_series(runs, "position"), 4, 2),
        key=lambda wave: wave.ratio * (abs(wave.period - PITCH_M) < 3e-5),
    )
    assert wave.period == pytest.approx(PITCH_M, rel=0.01)
    assert wave.ratio == pytest.approx(0.08, rel=0.1)
    assert (wave.second_sin**2 + wave.second_cos**2) ** 0.5 == pytest.approx(0.5, rel=0.15)


def test_the_phase_of_a_screw_follows_the_drives_position_sensor(screw):
    """A quarter of a turn on the sensor is a quarter of a turn of the phase."""
    evidence, runs = screw
    run = runs[0]
    wave = {"form": "screw", "ratio": 0.08, "wavelength_m": PITCH_M, "second_sin": 0.0, "second_cos": 0.0}

    def drive_m(phase_rad: float, zero_m: float):
        assert run.start.drive_m is not None
        config = rig_config(evidence.rig, {}, {"drive-speed-ripple": wave | {"phase_rad": phase_rad}}, None)
        start = run.start._replace(drive_m=run.start.drive_m + zero_m)
        return predict(config, False, run.commands, start)["drive_position_m"]

    assert drive_m(0.5 + 0.5 * math.pi, 0.0) == pytest.approx(drive_m(0.5, 0.25 * PITCH_M), abs=1e-9)
    assert np.ptp(drive_m(0.5, 0.0) - drive_m(0.5, 0.25 * PITCH_M)) > 1e-6


@pytest.mark.slow
def test_two_waves_along_the_track_are_found_together():
    other = {"other_share": 0.6, "other_wavelength_m": 9e-4, "other_phase_rad": -1.1}
    track = {"form": "two-waves", "ratio": 0.06, "wavelength_m": 4e-3, "phase_rad": 0.7, **other}
    evidence, runs = prepared("ladder", {"position-dependent-friction": track})
    problem = Problem(evidence.rig, runs)
    pairs = two_waves(friction_series(runs, problem.scales, "position"), 4)
    assert any(
        first.period == pytest.approx(4e-3, rel=0.1) and other.period == pytest.approx(9e-4, rel=0.03)
        for first, other in pairs
    )
    assert all(first.ratio >= other.ratio > 0.0 for first, other in pairs)


@pytest.mark.slow
def test_waves_of_neighbouring_periods_keep_the_phase_at_the_slide():
    """The phase at position 0 differs between periods by whole turns; at the position of the slide it must agree."""
    bumps = {"form": "bumps", "ratio": 0.15, "wavelength_m": 3e-3, "phase_rad": 0.7, "width": 0.12}
    evidence, runs = prepared("ladder", {"position-dependent-friction": bumps})
    scales = Problem(evidence.rig, runs).scales
    middle = Wave(3e-3, 0.05, 0.0, spread=0.04)
    shorter, same, longer = waves_beside(friction_series(runs, scales, "position"), [middle], (-0.25, 0.0, 0.25))
    assert [wave.period for wave in (shorter, same, longer)] == pytest.approx([2.97e-3, 3e-3, 3.03e-3])
    at_m = np.concatenate([series.at for series in friction_series(runs, scales, "position")]).mean()
    turns = [at_m / wave.period + wave.phase_rad / (2.0 * math.pi) for wave in (shorter, same, longer)]
    for beside in (turns[0], turns[2]):
        assert math.remainder(beside - turns[1], 1.0) == pytest.approx(0.0, abs=0.15)


def test_a_wave_over_time_turns_once_in_a_run():
    """A slower wave with a free phase in every run could imitate any trend."""
    trial = wave_trial("normal-load-fluctuation", "sine", Wave(5.0, 0.02, 0.0), slowest_Hz=0.1)
    (frequency,) = [axis for axis in trial.hypothesis.coordinates if axis.name == "frequency_Hz"]
    assert frequency.value(0.0) == pytest.approx(0.2)
    assert frequency.value(-2.0) == pytest.approx(0.1)


@pytest.mark.slow
def test_a_base_that_rings_shows_its_frequency():
    """The sticking slide lowers the frequency: it adds 1.5 kg to the base of 1 / (compliance omega^2) = 5 kg."""
    ring = {"compliance_m_per_N": 2e-7, "frequency_Hz": 160.0, "damping_ratio": 0.03}
    evidence, runs = prepared("ladder", {"base-compliance": ring})
    base_kg = 1.0 / (2e-7 * (2.0 * math.pi * 160.0) ** 2)
    stuck_Hz = 160.0 / math.sqrt(1.0 + evidence.rig.mass_kg / base_kg)
    ringing = ringing_Hz(Problem(evidence.rig, runs).runs, "base_accel_mps2", 2)
    assert any(abs(frequency_Hz - stuck_Hz) < 5.0 for frequency_Hz in ringing)
    assert ringing_Hz(runs, "nothing", 2) == []
