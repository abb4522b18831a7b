"""Slopes in windows of every length, and their measured noise."""

import math
from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from bridge.kernel import Record, kernel
from controller.config import ControllerConfig
from controller.estimate.windows import BINS, DRIVE, FORCE, MOST_FRESH, SLIDE, clear_windows, push
from controller.records import build


def _start() -> tuple[Any, Any]:
    params, state = build(validate(ControllerConfig, {}, "test"))
    return params[0], state[0]


@kernel
def _one_by_one(p: Record, s: Record, bins: Any, learn: bool) -> None:
    """Add bins of force, slide and drive, [3, bins]; in a loop of Python each bin takes 60 µs."""
    for n in range(bins.shape[1]):
        for row in range(bins.shape[0]):
            s.fresh[row, 0] = bins[row, n]
        push(p, s, 1, learn)


def _push(p: Any, s: Any, force_N: Any) -> None:
    _one_by_one(p, s, np.stack([force_N, np.zeros_like(force_N), np.zeros_like(force_N)]), True)


def _of_white(p: Any, sigma_N: float, level: int) -> float:
    """The same of white noise of bins of `sigma_N`, from the weights -3, -1, 1, 3 over 10."""
    return math.sqrt(0.2) * sigma_N / math.sqrt(2.0**level) / (p.bin_s * 2.0**level)


def test_a_ramp_has_its_slope_at_every_level() -> None:
    p, s = _start()
    t_s = p.bin_s * np.arange(40000)
    _one_by_one(p, s, np.stack([3.0 + 5.0 * t_s, -2e-3 * t_s, 5e-4 * t_s]), True)
    seen = [level for level in range(p.levels) if s.pushed[level] >= BINS]
    assert max(p.window_s[level] for level in seen) > 3.0
    for level in seen:
        assert s.slope[FORCE, level] == pytest.approx(5.0, rel=1e-6)
        assert s.slope[SLIDE, level] == pytest.approx(-2e-3, rel=1e-6)
        assert s.slope[DRIVE, level] == pytest.approx(5e-4, rel=1e-6)
        assert s.noise[DRIVE, level] < 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_the_noise_of_white_noise_is_found_on_a_ramp(seed: int) -> None:
    p, s = _start()
    chance = np.random.default_rng(seed)
    _push(p, s, 3.0 * p.bin_s * np.arange(60000) + chance.normal(0.0, 0.02, 60000))
    for level in range(8):
        unsure = 1.0 + 10.0 / s.differences[level]
        assert s.noise[FORCE, level] == pytest.approx(
            unsure * _of_white(p, 0.02, level), rel=0.15 if level < 6 else 0.35
        )


def test_slips_do_not_move_the_noise() -> None:
    p, s = _start()
    bins = np.arange(60000) % 10000
    saw_N = 6.0 * np.where(bins < 9600, bins / 9600.0, (10000 - bins) / 400.0)  # climbs in 960 ms, falls in 40
    _push(p, s, saw_N + np.random.default_rng(1).normal(0.0, 0.02, 60000))
    for level in range(5):
        assert s.noise[FORCE, level] == pytest.approx(_of_white(p, 0.02, level), rel=0.2)


def test_hum_is_in_the_noise_of_the_windows_that_see_it() -> None:
    p, s = _start()
    t_s = p.bin_s * np.arange(40000)
    chance = np.random.default_rng(1)
    _push(p, s, 0.1 * np.sin(2.0 * np.pi * 50.0 * t_s) + chance.normal(0.0, 0.02, 40000))
    short, half_a_period = 0, 4
    assert p.window_s[half_a_period] == pytest.approx(6.4e-3)
    assert s.noise[FORCE, short] == pytest.approx(_of_white(p, 0.02, short), rel=0.15)
    assert s.noise[FORCE, half_a_period] > 5.0 * _of_white(p, 0.02, half_a_period)


def test_a_constant_signal_is_known_no_better_than_its_resolution() -> None:
    p, s = _start()
    step_m = 1e-6
    s.resolution[SLIDE] = step_m
    _push(p, s, np.zeros(2000))
    assert s.resolution[SLIDE] == pytest.approx(step_m, rel=1e-3)
    for level in range(4):
        assert s.noise[SLIDE, level] == pytest.approx(0.29 * step_m / p.window_s[level], rel=1e-3)


def test_the_noise_survives_a_restart_and_missing_samples_do_not_count() -> None:
    p, s = _start()
    _push(p, s, np.random.default_rng(1).normal(0.0, 0.02, 10000))
    before = s.noise[FORCE, 2]
    clear_windows(s)
    assert (s.pushed == 0).all()
    _one_by_one(p, s, np.zeros((3, 2000)), False)
    assert s.noise[FORCE, 2] == before


@pytest.mark.parametrize("known", [0, 1])
def test_a_swing_of_the_slide_in_both_force_and_position_does_not_count_as_noise(known: int) -> None:
    """7 Hz of a fifth of 0.5 mm/s."""
    p, s = _start()
    s.compliance_m_per_N = known / 11700.0
    t_s = p.bin_s * np.arange(24_000)
    drive_m = 5e-4 * t_s
    slide_m = drive_m - 1e-4 / (2.0 * np.pi * 7.0) * np.sin(2.0 * np.pi * 7.0 * t_s)
    chance = np.random.default_rng(1)
    noise = chance.normal(0.0, 1.0, (3, len(t_s))) * np.array([[0.014], [3.5e-7], [3.5e-7]])
    _one_by_one(p, s, np.stack([11700.0 * (drive_m - slide_m), slide_m, drive_m]) + noise, True)
    level = next(i for i in range(p.levels) if p.window_s[i] > 0.04)
    assert (s.noise[SLIDE, level] < 5e-6) == bool(known)
    assert (s.noise[FORCE, level] / 11700.0 < 5e-6) == bool(known)


def test_bins_added_together_are_as_bins_added_one_by_one() -> None:
    p, single = _start()
    _, many = _start()
    chance = np.random.default_rng(4)
    for _ in range(300):
        count = int(chance.integers(1, MOST_FRESH + 1))
        bins = chance.normal(0.0, 1.0, (3, count))
        _one_by_one(p, single, bins, True)
        many.fresh[:, :count] = bins
        push(p, many, count, True)
        for name in ("bins", "slope", "slope_before", "pushed", "sigma"):
            np.testing.assert_array_equal(many[name], single[name])
