"""A base that vibrates at other frequencies than the commanded one: told where it matters, and only there."""

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


def found(data: Columns) -> Distortion | None:
    return distortion(data.pop("t_s"), data)


@pytest.mark.parametrize("multiple", [0.5, 1.5, 2.0, 3.0])
def test_a_multiple_is_told_with_its_share_of_the_velocity(multiple):
    told = found(shaken(multiple, 0.12))
    assert told is not None
    assert (told.commanded_Hz, told.multiple) == (2500.0, multiple)
    assert told.share == pytest.approx(0.12, rel=0.05)


def test_a_multiple_that_the_sampling_folds_down_is_found_there():
    told = found(shaken(3.0, 0.12, frequency_Hz=4100.0))  # 12.3 kHz of 20 kHz: seen at 7.7 kHz
    assert told is not None
    assert told.multiple == 3.0


def test_what_folds_onto_the_vibration_or_to_rest_is_left_alone():
    assert found(shaken(3.0, 0.12, frequency_Hz=5000.0)) is None  # 15 kHz of 20 kHz: seen at 5
    assert found(shaken(3.0, 0.12, frequency_Hz=6650.0)) is None  # 19.95 kHz: seen at 50 Hz


@pytest.mark.parametrize(("share", "noise_mps2"), [(0.02, 0.05), (0.06, 30.0)])
def test_a_small_one_or_one_below_the_noise_is_ordinary(share, noise_mps2):
    assert found(shaken(2.0, share, noise_mps2=noise_mps2)) is None


@pytest.mark.parametrize("missing", ["base_accel_mps2", "vibration_amplitude_m"])
def test_nothing_is_said_of_what_cannot_be_known(missing):
    data = shaken(2.0, 0.2)
    del data[missing]
    assert found(data) is None


def test_it_is_a_finding_of_the_evidence(tmp_path):
    path = folder(tmp_path, shaken(2.0, 0.12))
    told = kinds(load_evidence(path))[DISTORTED]
    assert (
        "base_accel_mps2: commanded to vibrate at 2500 Hz, moves at 5000 Hz as well, with 12 % of that velocity" in told
    )
