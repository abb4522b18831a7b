"""Random effects: the random load, the rough surface, and the noise behind both."""

import numpy as np
import pytest

from plant.effects.waves import smooth_noise
from tests.effects_rig import rig, towed

CONTACT = rig().contact


@pytest.fixture(scope="module")
def noise():
    at = np.arange(0, 20_000, 0.1)
    return np.array([smooth_noise(x, 7.0) for x in at])


def test_noise_has_mean_0_and_variance_1(noise):
    assert noise.mean() == pytest.approx(0.0, abs=0.02)
    assert noise.var() == pytest.approx(1.0, rel=0.02)
    for seed in (0.0, 1.0, 123456.0):
        numbers = np.array([smooth_noise(x, seed) for x in np.arange(0, 4000, 0.37)])
        assert numbers.var() == pytest.approx(1.0, rel=0.08)


def test_noise_is_smooth_and_forgets_itself_after_two_cells(noise):
    """One cell later 9/70, the mean of s (1 - s), over 26/35, the mean of its variance; 0 after two."""
    correlation = np.array([np.mean(noise[: -10 * cells] * noise[10 * cells :]) for cells in (1, 2, 3, 7)])
    assert correlation[0] == pytest.approx((9 / 70) / (26 / 35), abs=0.03)
    assert correlation[1:] == pytest.approx(0.0, abs=0.03)
    # no step where one cell meets the next, and its steepest is 1.5 differences of two values
    assert np.abs(np.diff(noise)).max() < 0.1 * 1.5 * np.sqrt(12) / np.sqrt(26 / 35) * 1.01


def test_noise_goes_through_its_lattice_smoothly():
    for point in (3.0, 100.0, 2500.0):
        left = smooth_noise(point, 1.0) - smooth_noise(point - 1e-4, 1.0)
        right = smooth_noise(point + 1e-4, 1.0) - smooth_noise(point, 1.0)
        assert left == pytest.approx(0.0, abs=1e-6)
        assert right == pytest.approx(0.0, abs=1e-6)


def test_a_random_load_is_the_noise_at_twice_its_frequency():
    values = {"form": "random", "ratio": 0.1, "frequency_Hz": 20.0, "seed": 5}
    result = towed({"normal-load-fluctuation": values}, 0.005, 2.0)
    noise = np.array([smooth_noise(40.0 * t, 5.0) for t in result.t_s])
    assert result.true_friction_force_N == pytest.approx(CONTACT.coulomb_force_N * (1 + 0.1 * noise), rel=2e-3)


def test_a_random_track_is_the_noise_at_half_its_wavelength():
    values = {"form": "random", "ratio": 0.1, "wavelength_m": 4e-4, "seed": 5}
    result = towed({"position-dependent-friction": values}, 0.005, 1.0)
    noise = np.array([smooth_noise(x / 2e-4, 5.0) for x in result.true_position_m])
    assert result.true_friction_force_N == pytest.approx(CONTACT.coulomb_force_N * (1 + 0.1 * noise), rel=2e-3)


def test_a_rough_surface_is_the_noise_along_the_track():
    surface = {"roughness_ratio": 0.05, "roughness_length_m": 2e-4, "roughness_seed": 3}
    result = towed({}, 0.005, 1.0, surface)
    noise = np.array([smooth_noise(x / 2e-4, 3.0) for x in result.true_position_m])
    assert result.true_friction_force_N == pytest.approx(CONTACT.coulomb_force_N * (1 + 0.05 * noise), rel=2e-3)


def test_the_same_track_at_another_velocity_is_the_same_and_another_seed_is_not():
    def friction_N(velocity_mps, seed):
        surface = {"roughness_ratio": 0.05, "roughness_seed": seed}
        result = towed({}, velocity_mps, 0.005 / velocity_mps, surface)
        return np.interp(np.linspace(1e-3, 4e-3, 100), result.true_position_m, result.true_friction_force_N)

    assert friction_N(0.005, 1) == pytest.approx(friction_N(0.01, 1), rel=2e-3)
    assert np.abs(friction_N(0.005, 1) - friction_N(0.005, 2)).max() > 1.0
