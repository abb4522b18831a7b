"""The drive's velocity, direction and standstill from positions with the noise of the paper's rig."""

import numpy as np
import pytest

from bridge.wire import stickslip_pb2 as wire
from tests.unit.controller.signals import STIFFNESS_N_PER_M, listen, time_s


@pytest.mark.parametrize("velocity_mps", [5e-3, 5e-4, 5e-5, -5e-4, -5e-5])
def test_velocity_and_direction_are_found(velocity_mps: float) -> None:
    drive_m = velocity_mps * np.clip(time_s(2.0) - 0.5, 0.0, None)
    trace = listen(drive_m, drive_m)
    late = trace["drive_velocity_mps"][1000:]
    assert late == pytest.approx(velocity_mps, rel=0.03)
    assert (trace["state"][1000:] == wire.SMOOTH).all()


@pytest.mark.parametrize("seed", range(3))
def test_a_resting_drive_never_counts_as_moving(seed: int) -> None:
    still = np.zeros(len(time_s(10.0)))
    trace = listen(still, still, seed=seed)
    assert not trace["drive_velocity_mps"].any()
    assert set(trace["state"]) <= {wire.UNKNOWN, wire.STANDSTILL}


def test_a_creep_feed_of_a_micrometre_a_second_is_motion() -> None:
    drive_m = 1e-6 * np.clip(time_s(12.0) - 1.0, 0.0, None)
    trace = listen(drive_m, drive_m)
    assert trace["drive_velocity_mps"][-3000:] == pytest.approx(1e-6, rel=0.3)
    assert not (trace["state"][-3000:] == wire.STANDSTILL).any()


@pytest.mark.parametrize(("least_feed_mps", "state"), [(5e-7, wire.UNKNOWN), (1e-5, wire.STANDSTILL)])
def test_a_feed_too_slow_to_be_seen_within_a_second_gives_no_standstill(least_feed_mps: float, state: int) -> None:
    drive_m = 1e-7 * time_s(2.0)
    trace = listen(drive_m, drive_m, position_noise_m=5e-6, estimator={"least_feed_mps": least_feed_mps})
    assert set(trace["state"][200:]) == {state}


def test_a_stop_is_seen_at_once_and_its_tail_does_not_count_as_motion() -> None:
    drive_m = 5e-4 * np.clip(time_s(4.0), 0.0, 2.0)
    trace = listen(drive_m, drive_m)
    assert (trace["drive_velocity_mps"][1000:2000] > 0.0).all()
    assert not trace["drive_velocity_mps"][2030:].any()
    assert (trace["state"][2030:] == wire.STANDSTILL).all()


@pytest.mark.parametrize("after_mps", [1e-3, 2e-4, -5e-4])
def test_a_step_of_the_velocity_is_followed(after_mps: float) -> None:
    t_s = time_s(2.0)
    drive_m = 5e-4 * np.clip(t_s, 0.0, 1.0) + after_mps * np.clip(t_s - 1.0, 0.0, None)
    trace = listen(drive_m, drive_m)
    assert trace["drive_velocity_mps"][900:1000] == pytest.approx(5e-4, rel=0.05)
    assert trace["drive_velocity_mps"][1060:] == pytest.approx(after_mps, rel=0.1)
    assert trace["drive_velocity_mps"][1500:] == pytest.approx(after_mps, rel=0.03)


def _started(acceleration_mps2: float, velocity_mps: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity of a drive that starts after 1 s, [samples] and [blocks]."""
    v_mps = np.clip((time_s(seconds) - 1.0) * acceleration_mps2, 0.0, velocity_mps)
    return np.cumsum(v_mps) * 5e-5, v_mps[19::20]


@pytest.mark.parametrize("seed", range(3))
def test_a_drive_that_starts_is_not_lost_again(seed: int) -> None:
    drive_m, v_mps = _started(5e-3, 5e-4, 1.4)
    trace = listen(drive_m, np.zeros_like(drive_m), seed=seed)
    moving = trace["drive_velocity_mps"] > 0.0
    assert not moving[:1000].any()
    begins = np.flatnonzero(np.diff(moving.astype(int)) == 1)
    assert len(begins) == 1
    assert v_mps[begins[0] + 1] < 1.5e-4


def test_v_a_is_for_a_v_d_that_still_rises() -> None:
    drive_m, v_mps = _started(5e-3, 5e-4, 1.4)
    trace = listen(drive_m, np.zeros_like(drive_m), policy={"mode": "moving"})
    rises = slice(1050, 1090)
    assert (trace["wanted_velocity_mps"][rises] / v_mps[rises]).mean() > 1.0


def test_hum_of_the_force_moves_no_resting_drive_and_slips_no_slide() -> None:
    t_s = time_s(4.0)
    still = np.zeros(len(t_s))
    hum_N = 0.1 * np.sin(2.0 * np.pi * 50.0 * t_s)
    trace = listen(still, still, offset_N=hum_N, drive_stiffness_N_per_m=STIFFNESS_N_PER_M)
    assert not trace["drive_velocity_mps"].any()
    assert trace["slips"][-1] == 0


def test_hum_on_both_positions_does_not_count_as_motion_before_its_noise_is_known() -> None:
    hum_m = 1e-6 * np.sin(2.0 * np.pi * 50.0 * time_s(2.0))
    for seed in range(3):
        assert not listen(hum_m, hum_m, seed=seed)["drive_velocity_mps"].any()
