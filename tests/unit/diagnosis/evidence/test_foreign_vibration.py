"""A vibration is reported where the spring cannot carry it, or where the base moves at multiples of the commanded frequency."""

import numpy as np
import pytest

from diagnosis.evidence.folder import load_evidence
from diagnosis.evidence.foreign_vibration import DISTORTED, PICK_UP, ForeignVibration, foreign_vibrations
from diagnosis.evidence.manifest import RigTable
from tests.evidence_folder import FREQUENCY_HZ, RATE_HZ, Columns, folder, kinds, vibrated

RIG = RigTable(
    drive="spring",
    mass_kg=1.5,
    drive_stiffness_N_per_m=11700.0,
    drive_damping_Ns_per_m=0.0,
    contact_stiffness_N_per_m=77.52e6,
    contact_damping_Ns_per_m=2.15e4,
    viscous_damping_Ns_per_m=0.0,
    coulomb_force_N=14.49,
    static_force_N=17.38,
    stribeck_velocity_mps=0.0005,
)


def found_in(data: Columns, kind: str, rig: RigTable = RIG) -> ForeignVibration | None:
    return next((found for found in foreign_vibrations(rig, data.pop("t_s"), data) if found.kind == kind), None)


def pick_up_in(data: Columns, rig: RigTable = RIG) -> ForeignVibration | None:
    return found_in(data, PICK_UP, rig)


@pytest.mark.parametrize(("force_N", "size"), [(0.15, "0.15 N"), (1.0, "1 N")])
def test_a_pick_up_is_found_with_its_size(force_N, size):
    reported = pick_up_in(vibrated(force_N))
    assert reported is not None
    assert reported.limits == pytest.approx(force_N / (0.005 * RIG.static_force_N), rel=0.02)
    assert reported.frequency_Hz == FREQUENCY_HZ
    # 1 m/s2 at 2.5 kHz is 4 nm, and the spring pulls with 11700 N/m
    assert f"with {size} at 2500 Hz, where the spring carries 47 µN" in reported.text


@pytest.mark.parametrize("frequency_Hz", [400.0, 1200.0, 8000.0])
def test_a_pick_up_is_found_between_the_slips_and_the_sampling_limit(frequency_Hz):
    reported = pick_up_in(
        vibrated(1.0, frequency_Hz=frequency_Hz), RIG.model_copy(update={"drive_stiffness_N_per_m": 1000.0})
    )
    assert reported is not None
    assert float(reported.text.split()[2]) == pytest.approx(1.0, rel=0.05)


def test_the_strongest_of_several_frequencies_is_reported():
    """A cable picks up a voltage that grows with the frequency; the run ends in a sweep."""
    rows = round(RATE_HZ)
    frequency_Hz = np.concatenate([np.repeat([3000.0, 1000.0, 4500.0, 2000.0], rows), np.linspace(500.0, 800.0, rows)])
    t_s = np.arange(frequency_Hz.size) / RATE_HZ
    wave = np.sin(2.0 * np.pi * np.cumsum(frequency_Hz) / RATE_HZ)
    random = np.random.default_rng(1)
    reported = pick_up_in(
        {
            "t_s": t_s,
            "drive_force_N": 15.0 + 0.5 * (frequency_Hz / 3000.0) ** 2 * wave + random.normal(0.0, 0.02, t_s.size),
            "mass_accel_mps2": wave + random.normal(0.0, 0.1, t_s.size),
            "vibration_frequency_Hz": frequency_Hz,
            "vibration_amplitude_m": np.full(t_s.size, 35e-9),
        }
    )
    assert reported is not None
    assert reported.frequency_Hz == 4500.0
    assert reported.limits == pytest.approx(0.5 * 1.5**2 / (0.005 * RIG.static_force_N), rel=0.02)
    assert "where the spring carries 15 µN" in reported.text


@pytest.mark.parametrize("missing", ["mass_accel_mps2", "vibration_amplitude_m", "drive_force_N"])
def test_a_missing_channel_gives_no_finding(missing):
    data = vibrated(1.0)
    del data[missing]
    assert pick_up_in(data) is None


def test_a_small_pick_up_is_not_reported():
    assert pick_up_in(vibrated(0.05)) is None


def test_a_force_that_the_spring_carries_is_not_reported():
    """A stiff drive carries 0.5 N at 1 m/s2."""
    stiff = RIG.model_copy(update={"drive_stiffness_N_per_m": 0.5 * (2.0 * np.pi * FREQUENCY_HZ) ** 2})
    assert pick_up_in(vibrated(0.5), stiff) is None


def test_an_aliased_vibration_is_ignored():
    assert pick_up_in(vibrated(1.0, frequency_Hz=9500.0)) is None


def test_too_short_a_vibration_is_ignored():
    assert pick_up_in(vibrated(1.0, seconds=0.19)) is None


def test_the_evidence_reports_it(tmp_path):
    path = folder(tmp_path, vibrated(0.3))
    assert (
        "drive_force_N: vibrates with 0.3 N at 2500 Hz, where the spring carries 47 µN"
        in kinds(load_evidence(path))[PICK_UP]
    )


def test_a_run_of_an_axis_sampled_slowly_is_ignored():
    data = {name: values[::1000] for name, values in vibrated(1.0).items()}  # 20 Hz
    assert pick_up_in(data) is None


def shaken(multiple: float, share: float, frequency_Hz: float = 2500.0, noise_mps2: float = 0.05) -> Columns:
    """A base that shakes with 5 m/s2 in the second half of two seconds, and with that share of its velocity at a multiple."""
    data = vibrated(0.0, frequency_Hz=frequency_Hz)
    on = data["vibration_amplitude_m"] > 0.0
    turns = 2.0 * np.pi * frequency_Hz * data["t_s"]
    wave = np.sin(turns + 0.3) + share * multiple * np.sin(multiple * turns + 1.1)
    noise = np.random.default_rng(2).normal(0.0, noise_mps2, on.size)
    return data | {"base_accel_mps2": np.where(on, 5.0 * wave, 0.0) + noise}


def distortion_in(data: Columns) -> ForeignVibration | None:
    return found_in(data, DISTORTED)


@pytest.mark.parametrize("multiple", [0.5, 1.5, 2.0, 3.0])
def test_a_multiple_is_found_with_its_share_of_the_velocity(multiple):
    reported = distortion_in(shaken(multiple, 0.12))
    assert reported is not None
    assert reported.frequency_Hz == multiple * 2500.0
    assert reported.limits == pytest.approx(0.12 / 0.05, rel=0.05)


def test_an_aliased_multiple_is_found():
    reported = distortion_in(shaken(3.0, 0.12, frequency_Hz=4100.0))  # 12.3 kHz of 20 kHz: seen at 7.7 kHz
    assert reported is not None
    assert reported.frequency_Hz == 3.0 * 4100.0


def test_a_multiple_that_aliases_to_the_vibration_or_to_rest_is_ignored():
    assert distortion_in(shaken(3.0, 0.12, frequency_Hz=5000.0)) is None  # 15 kHz of 20 kHz: seen at 5
    assert distortion_in(shaken(3.0, 0.12, frequency_Hz=6650.0)) is None  # 19.95 kHz: seen at 50 Hz


@pytest.mark.parametrize(("share", "noise_mps2"), [(0.02, 0.05), (0.06, 30.0)])
def test_a_multiple_that_is_small_or_below_the_noise_is_not_reported(share, noise_mps2):
    assert distortion_in(shaken(2.0, share, noise_mps2=noise_mps2)) is None


@pytest.mark.parametrize("missing", ["base_accel_mps2", "vibration_amplitude_m"])
def test_a_missing_channel_gives_no_line(missing):
    data = shaken(2.0, 0.2)
    del data[missing]
    assert distortion_in(data) is None


def test_the_evidence_reports_a_line(tmp_path):
    path = folder(tmp_path, shaken(2.0, 0.12))
    reported = kinds(load_evidence(path))[DISTORTED]
    assert (
        "base_accel_mps2: commanded to vibrate at 2500 Hz, moves at 5000 Hz as well, with 12 % of that velocity"
        in reported
    )
