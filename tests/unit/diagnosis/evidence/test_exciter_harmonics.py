"""A base that vibrates at multiples of the commanded frequency is reported only where it affects the diagnosis."""

import numpy as np
import pytest

from diagnosis.evidence.exciter_harmonics import DISTORTED, Distortion, distortion
from diagnosis.evidence.folder import load_evidence
from tests.evidence_folder import Columns, folder, kinds, vibrated


def shaken(multiple: float, share: float, frequency_Hz: float = 2500.0, noise_mps2: float = 0.05) -> Columns:
    """A base that shakes with 5 m/s2 in the second half of two seconds, and with that share of its velocity at a multiple."""
    data = vibrated(0.0, frequency_Hz=frequency_Hz)
    on = data["vibration_amplitude_m"] > 0.0
    turns = 2.0 * np.pi * frequency_Hz * data["t_s"]
    wave = np.sin(turns + 0.3) + share * multiple * np.sin(multiple * turns + 1.1)
    noise = np.random.default_rng(2).normal(0.0, noise_mps2, on.size)
    return data | {"base_accel_mps2": np.where(on, 5.0 * wave, 0.0) + noise}


def distortion_in(data: Columns) -> Distortion | None:
    return distortion(data.pop("t_s"), data)


@pytest.mark.parametrize("multiple", [0.5, 1.5, 2.0, 3.0])
def test_a_multiple_is_found_with_its_share_of_the_velocity(multiple):
    reported = distortion_in(shaken(multiple, 0.12))
    assert reported is not None
    assert (reported.commanded_Hz, reported.multiple) == (2500.0, multiple)
    assert reported.share == pytest.approx(0.12, rel=0.05)


def test_an_aliased_multiple_is_found():
    reported = distortion_in(shaken(3.0, 0.12, frequency_Hz=4100.0))  # 12.3 kHz of 20 kHz: seen at 7.7 kHz
    assert reported is not None
    assert reported.multiple == 3.0


def test_a_multiple_that_aliases_to_the_vibration_or_to_rest_is_ignored():
    assert distortion_in(shaken(3.0, 0.12, frequency_Hz=5000.0)) is None  # 15 kHz of 20 kHz: seen at 5
    assert distortion_in(shaken(3.0, 0.12, frequency_Hz=6650.0)) is None  # 19.95 kHz: seen at 50 Hz


@pytest.mark.parametrize(("share", "noise_mps2"), [(0.02, 0.05), (0.06, 30.0)])
def test_a_multiple_that_is_small_or_below_the_noise_is_not_reported(share, noise_mps2):
    assert distortion_in(shaken(2.0, share, noise_mps2=noise_mps2)) is None


@pytest.mark.parametrize("missing", ["base_accel_mps2", "vibration_amplitude_m"])
def test_a_missing_channel_gives_no_finding(missing):
    data = shaken(2.0, 0.2)
    del data[missing]
    assert distortion_in(data) is None


def test_the_evidence_reports_it(tmp_path):
    path = folder(tmp_path, shaken(2.0, 0.12))
    reported = kinds(load_evidence(path))[DISTORTED]
    assert (
        "base_accel_mps2: commanded to vibrate at 2500 Hz, moves at 5000 Hz as well, with 12 % of that velocity"
        in reported
    )
