"""Removal of a vibration of unknown phase from means over 1 ms."""

import numpy as np
import pytest

from diagnosis.features.grid import averaged, without_vibration

SAMPLES = 20  # a block
BLOCKS = 400
AMPLITUDE_mps2 = 16.0
SLOW_mps2 = 0.3


def reduced(frequency_Hz: float, phase_rad: float) -> dict[str, np.ndarray]:
    """Block means and rms about them, of a vibration on a slow acceleration."""
    t_s = (np.arange(BLOCKS * SAMPLES) + 0.5) / SAMPLES * 1e-3
    accel = SLOW_mps2 * t_s + AMPLITUDE_mps2 * np.cos(2.0 * np.pi * frequency_Hz * t_s + phase_rad)
    rows = accel.reshape(BLOCKS, SAMPLES)
    return {"base_accel_mps2": rows.mean(axis=1), "base_shake_mps2": rows.std(axis=1)}


@pytest.mark.parametrize("frequency_Hz", [450.0, 900.0, 1130.0, 1500.0, 2300.0, 2500.0, 2750.0, 4500.0])
@pytest.mark.parametrize("phase_rad", [0.0, 0.7, 1.5])
def test_the_vibration_is_removed_from_the_means(frequency_Hz: float, phase_rad: float) -> None:
    blocks = reduced(frequency_Hz, phase_rad)
    cleaned = without_vibration(blocks, averaged(np.full(BLOCKS, frequency_Hz)))
    middle = slice(5, -5)  # at the ends a neighbour is missing
    slow = SLOW_mps2 * (np.arange(BLOCKS) + 0.5) * 1e-3
    assert cleaned["base_accel_mps2"][middle] == pytest.approx(slow[middle], abs=1e-9)
    rms = float(np.sqrt(np.mean(cleaned["base_shake_mps2"][middle] ** 2)))
    assert rms == pytest.approx(AMPLITUDE_mps2 / np.sqrt(2.0), rel=1e-3)


def test_uncorrected_means_depend_on_the_phase() -> None:
    kept = [abs(reduced(4500.0, phase_rad)["base_accel_mps2"][9]) for phase_rad in (0.0, np.pi / 2.0)]
    assert min(kept) < 0.01
    assert max(kept) == pytest.approx(AMPLITUDE_mps2 / (np.pi * 4.5), rel=0.1)


def test_only_blocks_with_vibration_are_corrected() -> None:
    blocks = reduced(4500.0, 0.7)
    frequency_Hz = np.where(np.arange(BLOCKS) < 200, 0.0, 4500.0)
    cleaned = without_vibration(blocks, averaged(frequency_Hz))
    for name, values in blocks.items():
        assert np.array_equal(cleaned[name][:200], values[:200])
    assert np.abs(cleaned["base_accel_mps2"][205:-5]).max() < 0.2 < np.abs(blocks["base_accel_mps2"][205:]).min()


def test_a_whole_number_of_periods_changes_nothing() -> None:
    blocks = reduced(3000.0, 0.7)
    cleaned = without_vibration(blocks, averaged(np.full(BLOCKS, 3000.0)))
    assert all(np.array_equal(cleaned[name], values) for name, values in blocks.items())
