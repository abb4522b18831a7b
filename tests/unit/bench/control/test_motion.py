"""Sticks, slips and surges of made motions, and motions that only look like them."""

import numpy as np
import pytest

from bench.control import record
from plant.config import RigConfig
from tests.unit.bench.control.made import PAPER, SAMPLE_S, along, at_speed, judged, times


def test_even_motion_has_no_event() -> None:
    seen = judged(at_speed(2.0), at_speed(2.0))
    assert [len(events) for events in seen[:4]] == [0, 0, 0, 0]
    assert seen.state.moving_s == pytest.approx(2.0, abs=2e-3)


def stuck_from(begin_s: float, end_s: float, duration_s: float = 2.0, slip_mps: float = 0.01):
    """A slide that follows the drive, rests, and catches up fast."""
    drive_m, t_s = at_speed(duration_s), times(duration_s)
    velocity = np.full(len(t_s), 5e-4)
    velocity[(t_s > begin_s) & (t_s <= end_s)] = 0.0
    caught_s = (end_s - begin_s) * 5e-4 / (slip_mps - 5e-4)
    velocity[(t_s > end_s) & (t_s <= end_s + caught_s)] = slip_mps
    return along(velocity), drive_m


def test_a_stick_and_its_slip() -> None:
    seen = judged(*stuck_from(0.5, 1.2))
    assert len(seen.sticks) == len(seen.slips) == 1
    assert len(seen.surges) == 0
    begin_s, end_s, speed_mps, needs_s, announced_s, under_excite = seen.sticks[0]
    assert begin_s == pytest.approx(0.5, abs=2e-3)
    assert end_s == pytest.approx(1.2, abs=2e-3)
    assert speed_mps == pytest.approx(5e-4, rel=1e-3)
    assert (announced_s, under_excite) == (-1.0, 0.0)
    # of the worse of two positions and of the force: way^2 T = 300 sigma^2 / f_s, and two blocks
    noise_m = np.hypot(PAPER.sensors.position_noise_m, PAPER.sensors.position_resolution_m / np.sqrt(12))
    closed_s = (300.0 * 2.0 * noise_m**2 * SAMPLE_S / 5e-4**2) ** (1 / 3)
    assert needs_s == pytest.approx(closed_s + 2e-3, abs=2e-4)
    assert seen.slips[0, 0] == pytest.approx(1.2, abs=2e-3)
    assert seen.slips[0, 2] == pytest.approx(20.0, rel=0.01)
    assert seen.slips[0, 5] == pytest.approx(0.01, rel=0.01)


def test_the_judgement_is_the_same_backwards() -> None:
    slide_m, drive_m = stuck_from(0.5, 1.2)
    forth, back = judged(slide_m, drive_m), judged(-slide_m, -drive_m)
    np.testing.assert_allclose(forth.sticks, back.sticks)
    np.testing.assert_allclose(forth.slips, back.slips)


def test_fast_motion_without_a_stick_is_a_surge() -> None:
    velocity = np.full(len(times(2.0)), 5e-4)
    velocity[20000:20400] = 1e-3
    seen = judged(along(velocity), at_speed(2.0))
    assert (len(seen.slips), len(seen.surges)) == (0, 1)
    assert seen.surges[0, 2] == pytest.approx(2.0, rel=0.01)


def test_a_slide_that_swings_after_an_event_makes_no_second_one() -> None:
    velocity = np.full(len(times(2.0)), 5e-4)
    for begin in (20000, 20800):  # 40 ms apart, within a natural period of 71 ms
        velocity[begin : begin + 400] = 1e-3
    assert len(judged(along(velocity), at_speed(2.0)).surges) == 1


def test_a_drive_that_slows_down_makes_no_surge() -> None:
    t_s = times(2.0)
    drive = np.where(t_s < 1.0, 2e-3, 2e-4)
    slide = np.where(t_s < 1.0, 2e-3, 2e-4 + 1.8e-3 * np.exp(-(t_s - 1.0) / 0.02))
    seen = judged(along(slide), along(drive), slowest_mps=2e-4)
    assert (len(seen.slips), len(seen.surges)) == (0, 0)
    # late for longer than a natural period, 71 ms, as a strong vibration makes it
    late = np.where(t_s < 1.0, 2e-3, 2e-4 + 1.8e-3 * np.exp(-(t_s - 1.0) / 0.1))
    assert len(judged(along(late), along(drive), slowest_mps=2e-4).surges) == 0
    late[22000:22400] = 3e-3
    assert len(judged(along(late), along(drive), slowest_mps=2e-4).surges) == 1


def test_a_reversal_is_a_stick_and_no_slip() -> None:
    t_s = times(3.0)
    drive = np.interp(t_s, [0, 1, 1.1, 3], [5e-4, 5e-4, -5e-4, -5e-4])
    slide = np.where((t_s > 1.05) & (t_s < 1.5), 0.0, drive)
    seen = judged(along(slide), along(drive))
    assert (len(seen.slips), len(seen.surges)) == (0, 0)
    assert len(seen.sticks) == 1
    assert seen.sticks[0, 0] == pytest.approx(1.05, abs=5e-3)


def test_a_stick_that_goes_on_through_a_reversal_is_two() -> None:
    t_s = times(3.0)
    drive = np.interp(t_s, [0, 1, 1.1, 3], [5e-4, 5e-4, -5e-4, -5e-4])
    slide = np.where((t_s > 0.5) & (t_s < 1.5), 0.0, drive)
    begins_s = judged(along(slide), along(drive)).sticks[:, 0]
    np.testing.assert_allclose(begins_s, [0.5, 1.05], atol=5e-3)


def test_a_ripple_of_the_exciter_does_not_count_as_motion() -> None:
    t_s = times(2.0)
    shaken_m = at_speed(2.0) + 2e-7 * np.sin(2 * np.pi * 2600.0 * t_s)
    assert [len(events) for events in judged(shaken_m, at_speed(2.0), v_a_mps=6e-4)[:4]] == [0, 0, 0, 0]
    assert len(judged(shaken_m, at_speed(2.0)).surges) > 0  # without v_a the window holds a broken period


def test_a_pair_without_a_drop_may_overshoot_to_twice_the_drive() -> None:
    ptfe = PAPER.model_copy(update={"contact": PAPER.contact.model_copy(update={"static_force_N": 14.49})})
    t_s = times(2.0)
    swing = 5e-4 * (1.0 - np.cos(2 * np.pi * np.maximum(t_s - 0.5, 0.0) / 0.07))
    slide = np.where(t_s < 0.5, 0.0, np.where(t_s < 0.57, swing, 5e-4))
    assert len(judged(along(slide), at_speed(2.0), rig=ptfe).slips) == 0
    assert len(judged(along(slide), at_speed(2.0)).slips) == 1


def test_standstill_has_no_event() -> None:
    seen = judged(np.zeros(20000), np.zeros(20000))
    assert [len(events) for events in seen[:4]] == [0, 0, 0, 0]
    assert seen.state.standing_s == pytest.approx(1.0)


def test_a_sticks_begin_at_a_ramp_needs_longer_than_at_full_speed() -> None:
    t_s = times(1.0)
    ramp = along(np.interp(t_s, [0.0, 0.1, 1.0], [0.0, 5e-4, 5e-4]))
    slide = along(np.where(t_s < 0.8, 0.0, 5e-4))
    assert 0.01 < judged(slide, ramp).sticks[0, 3] < 0.03


def test_windows_fit_a_stiff_axis() -> None:
    drive = PAPER.drive.model_copy(update={"stiffness_N_per_m": 5e7})
    rig: RigConfig = PAPER.model_copy(update={"drive": drive})
    params, _ = record.build(rig, 5e-4, 0.0, 5e-3, -1)
    assert params[0].window_s == pytest.approx(4 * SAMPLE_S, rel=0.4)
