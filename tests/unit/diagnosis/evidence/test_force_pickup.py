"""A vibration in the force signal: told where no spring can carry it, and only there."""

import numpy as np
import pytest

from diagnosis.evidence.folder import load_evidence
from diagnosis.evidence.force_pickup import PICK_UP, PickUp, pick_up
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


def found(data: Columns, rig: RigTable = RIG) -> PickUp | None:
    return pick_up(rig, data.pop("t_s"), data)


@pytest.mark.parametrize("force_N", [0.15, 1.0])
def test_it_is_found_with_its_size(force_N):
    told = found(vibrated(force_N))
    assert told is not None
    assert told.force_N == pytest.approx(force_N, rel=0.02)
    assert told.frequency_Hz == FREQUENCY_HZ
    # 1 m/s2 at 2.5 kHz is 4 nm, and the spring pulls with 11700 N/m
    assert told.spring_N == pytest.approx(11700.0 / (2.0 * np.pi * FREQUENCY_HZ) ** 2, rel=0.05)


@pytest.mark.parametrize("frequency_Hz", [400.0, 1200.0, 8000.0])
def test_it_is_found_above_the_slips_and_below_what_the_sampling_shows(frequency_Hz):
    told = found(vibrated(1.0, frequency_Hz=frequency_Hz), RIG.model_copy(update={"drive_stiffness_N_per_m": 1000.0}))
    assert told is not None
    assert told.force_N == pytest.approx(1.0, rel=0.05)


def test_of_several_frequencies_the_one_that_stands_out_is_told():
    """A cable picks up a voltage that grows with the frequency; the run ends in a sweep."""
    rows = round(RATE_HZ)
    frequency_Hz = np.concatenate([np.repeat([3000.0, 1000.0, 4500.0, 2000.0], rows), np.linspace(500.0, 800.0, rows)])
    t_s = np.arange(frequency_Hz.size) / RATE_HZ
    wave = np.sin(2.0 * np.pi * np.cumsum(frequency_Hz) / RATE_HZ)
    random = np.random.default_rng(1)
    told = found(
        {
            "t_s": t_s,
            "drive_force_N": 15.0 + 0.5 * (frequency_Hz / 3000.0) ** 2 * wave + random.normal(0.0, 0.02, t_s.size),
            "mass_accel_mps2": wave + random.normal(0.0, 0.1, t_s.size),
            "vibration_frequency_Hz": frequency_Hz,
            "vibration_amplitude_m": np.full(t_s.size, 35e-9),
        }
    )
    assert told is not None
    assert told.frequency_Hz == 4500.0
    assert told.force_N == pytest.approx(0.5 * 1.5**2, rel=0.02)
    assert told.spring_N == pytest.approx(11700.0 / (2.0 * np.pi * 4500.0) ** 2, rel=0.05)


@pytest.mark.parametrize("missing", ["mass_accel_mps2", "vibration_amplitude_m", "drive_force_N"])
def test_nothing_is_said_of_what_cannot_be_known(missing):
    data = vibrated(1.0)
    del data[missing]
    assert found(data) is None


def test_a_small_one_is_ordinary():
    assert found(vibrated(0.05)) is None


def test_what_the_spring_carries_is_no_pick_up():
    """A stiff drive: 0.5 N are what it carries at 1 m/s2."""
    stiff = RIG.model_copy(update={"drive_stiffness_N_per_m": 0.5 * (2.0 * np.pi * FREQUENCY_HZ) ** 2})
    assert found(vibrated(0.5), stiff) is None


def test_a_vibration_that_the_sampling_folds_down_is_left_alone():
    assert found(vibrated(1.0, frequency_Hz=9500.0)) is None


def test_too_short_a_vibration_is_left_alone():
    assert found(vibrated(1.0, seconds=0.19)) is None


def test_it_is_a_finding_of_the_evidence(tmp_path):
    path = folder(tmp_path, vibrated(0.3))
    assert (
        "drive_force_N: vibrates with 0.3 N at 2500 Hz, where the spring carries 47 µN"
        in kinds(load_evidence(path))[PICK_UP]
    )


def test_a_run_of_an_axis_sampled_slowly_is_left_alone():
    data = {name: values[::1000] for name, values in vibrated(1.0).items()}  # 20 Hz
    assert found(data) is None
