"""Counting slips: with noise, at a low rate, at low and high forces, and in records without slips."""

import math

import numpy as np
import pytest

from diagnosis.slips import find_cycles

FALL_S = 0.036  # a slip of the paper's rig


def sawtooth(rate_Hz, high_N, low_N, period_s=1.0, duration_s=20.0):
    """Stick and slip as the paper's Figure 2 shows it: a straight climb, a fall along half a cosine."""
    t_s = np.arange(round(duration_s * rate_Hz)) / rate_Hz
    phase_s = t_s % period_s
    climb = low_N + (high_N - low_N) * phase_s / (period_s - FALL_S)
    fall = low_N + (high_N - low_N) * 0.5 * (1 + np.cos(np.pi * (phase_s - period_s + FALL_S) / FALL_S))
    return t_s, np.where(phase_s < period_s - FALL_S, climb, fall)


@pytest.mark.parametrize("rate_Hz", [100, 1000, 20000])
@pytest.mark.parametrize(("high_N", "low_N"), [(1.2, 0.8), (17.4, 11.6), (14.1, 12.4), (50.0, 30.0)])
@pytest.mark.parametrize("noise_N", [0.0, 0.02])
def test_every_slip_is_found_once_with_its_forces(rate_Hz, high_N, low_N, noise_N):
    t_s, force_N = sawtooth(rate_Hz, high_N, low_N)
    cycles = find_cycles(t_s, force_N + noise_N * np.random.default_rng(1).standard_normal(len(t_s)))
    assert cycles.slips == 20
    # on a slow climb noise moves a peak in time, by about noise over slope; over 19 periods that averages out
    moved_s = noise_N / (high_N - low_N)
    assert cycles.period_s == pytest.approx(1.0, abs=0.002 + 3 * moved_s / 19)
    # 100 Hz meets a 36 ms slip three or four times, so its trough is seen up to one sample late
    slack_N = 3 * noise_N + (0.02 if rate_Hz > 100 else 0.06) * (high_N - low_N)
    assert cycles.force_max_N == pytest.approx(high_N, abs=slack_N)
    assert cycles.force_min_N == pytest.approx(low_N, abs=slack_N)
    assert cycles.swing_N == pytest.approx(high_N - low_N, abs=2 * slack_N)
    assert cycles.stick_s == pytest.approx(1.0 - FALL_S, abs=0.012 + 2 * moved_s)


def test_fast_slips_are_not_taken_for_noise():
    """Slips at 155 Hz, as on a stiff axis of 40 kg: falls below 370 N were noise."""
    t_s = np.arange(40000) / 20000.0
    force_N = 65.0 + 40.0 * np.sin(2.0 * np.pi * 155.0 * t_s) + 0.02 * np.random.default_rng(1).standard_normal(40000)
    assert find_cycles(t_s, force_N).slips == pytest.approx(310, abs=1)


@pytest.mark.parametrize("rate_Hz", [100, 20000])
@pytest.mark.parametrize("level_N", [1.0, 15.0, 50.0])
def test_noise_alone_counts_as_no_slip(rate_Hz, level_N):
    for seed in range(5):
        noise_N = 0.02 * np.random.default_rng(seed).standard_normal(20 * rate_Hz)
        cycles = find_cycles(np.arange(20 * rate_Hz) / rate_Hz, level_N + noise_N)
        assert cycles.slips == 0
        assert cycles.swing_N == 0.0
        assert math.isnan(cycles.force_max_N)
        assert math.isnan(cycles.force_min_N)
        assert math.isnan(cycles.period_s)
        assert math.isnan(cycles.stick_s)


def test_a_slow_fall_counts_as_no_slip():
    t_s = np.arange(20000) / 1000.0
    force_N = np.where(t_s < 3.0, 5.0 * t_s, 12.0 + 3.0 * np.exp(-(t_s - 3.0)))
    assert find_cycles(t_s, force_N).slips == 0
    assert find_cycles(t_s, force_N, slowest_fall_s=3.0).slips == 1


def test_a_slow_fall_that_recovers_before_the_end_counts_as_no_slip():
    t_s = np.arange(9000) / 1000.0
    force_N = np.interp(t_s, [0.0, 3.0, 8.0, 9.0], [0.0, 10.0, 5.0, 9.6])
    assert find_cycles(t_s, force_N, minimum_drop_N=4.8).slips == 0


def test_the_smallest_slip_can_be_set():
    t_s, force_N = sawtooth(1000, 14.0, 13.0)
    assert find_cycles(t_s, force_N).slips == 20
    assert find_cycles(t_s, force_N, minimum_drop_N=1.1).slips == 0


def test_a_record_that_ends_in_a_slip_has_one_restick_less():
    t_s, force_N = sawtooth(1000, 17.4, 11.6, duration_s=2.985)
    cycles = find_cycles(t_s, force_N)
    assert cycles.slips == 3
    assert len(cycles.restick_t_s) == 2
    assert np.all(cycles.restick_t_s > cycles.breakaway_t_s[:2])


def test_between_takes_each_event_by_its_own_time():
    cycles = find_cycles(*sawtooth(1000, 17.4, 11.6)).between(1.98, 5.5)
    assert cycles.slips == 3
    assert len(cycles.restick_t_s) == 4


@pytest.mark.parametrize("samples", [0, 1, 2, 3])
def test_a_record_too_short_for_a_slip_has_none(samples):
    assert find_cycles(np.arange(samples) * 0.001, np.ones(samples)).slips == 0


def test_unequal_lengths_are_refused():
    with pytest.raises(ValueError, match="equal length"):
        find_cycles(np.arange(5.0), np.ones(4))
