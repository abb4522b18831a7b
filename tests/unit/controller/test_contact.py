"""Stick, slip and smooth sliding on made signals, with either channel missing and with a wrong stiffness."""

from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import sensor_block
from controller.config import ControllerConfig
from controller.node import ControllerNode
from tests.unit.controller.signals import SAMPLES, STIFFNESS_N_PER_M, listen, stick_slip, time_s

CHANNELS = {"both": {}, "no slide position": {"use_slide_position": False}, "no force": {"use_force": False}}

WITHOUT_FORCE = {"estimator": {"use_force": False}, "drive_stiffness_N_per_m": STIFFNESS_N_PER_M}


@pytest.fixture(params=CHANNELS)
def estimator(request: pytest.FixtureRequest) -> dict[str, Any]:
    return CHANNELS[request.param]


def _given(estimator: dict[str, Any]) -> dict[str, Any]:
    """The configuration: without a slide position the user gives k_d."""
    needs_it = not estimator.get("use_slide_position", True)
    return {"estimator": estimator} | ({"drive_stiffness_N_per_m": STIFFNESS_N_PER_M} if needs_it else {})


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_sticks_and_slips_are_found(estimator: dict[str, Any], way: float) -> None:
    drive_m, slide_m = stick_slip(6.0, 5e-4, 0.96, 0.04)
    trace = listen(way * drive_m, way * slide_m, offset_N=way * 8.0, **_given(estimator))
    assert int(trace["slips"][-1]) == 6
    for slip in range(1, 6):
        # from the force alone a slip ends 70 ms late: only the longer windows separate its rate from noise
        assert (trace["state"][1000 * slip + 110 : 1000 * slip + 950] == wire.STICK).all()
        assert (trace["state"][1000 * slip - 30 : 1000 * slip - 10] == wire.SLIP).all()
    assert trace["surges"][-1] == 0


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_smooth_sliding_counts_as_neither_stick_nor_slip(estimator: dict[str, Any], way: float) -> None:
    drive_m = way * 5e-4 * time_s(20.0)
    trace = listen(drive_m, drive_m, offset_N=way * 12.0, **_given(estimator))
    assert trace["slips"][-1] == 0
    assert (trace["state"][1000:] == wire.SMOOTH).all()


def test_a_slide_that_swings_by_less_than_half_slips_not() -> None:
    t_s = time_s(5.0)
    drive_m = 5e-4 * t_s
    slide_m = drive_m - 5e-4 * 0.3 / 30.0 * np.sin(30.0 * t_s)  # v_s between 0.7 and 1.3 v_d
    trace = listen(drive_m, slide_m, offset_N=12.0)
    assert trace["slips"][-1] == 0
    assert not (trace["state"][1000:] == wire.STICK).any()


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_without_a_force_sensor_both_positions_give_the_spring_force(way: float) -> None:
    drive_m, slide_m = stick_slip(4.0, 5e-4, 0.96, 0.04)
    trace = listen(way * drive_m, way * slide_m, missing="drive_force_N", **WITHOUT_FORCE)
    force_N = way * STIFFNESS_N_PER_M * (drive_m - slide_m).reshape(-1, 20).mean(axis=1)
    assert trace["drive_force_N"] == pytest.approx(force_N, abs=0.1)
    assert trace["breakaway_force_N"][-1] == pytest.approx(STIFFNESS_N_PER_M * 5e-4 * 0.97, rel=0.03)


def test_the_spring_of_both_ways_is_relaxed_half_way() -> None:
    """A start with the spring wound up by 0.4 mm; friction of 5.85 N either way."""
    t_s = time_s(8.0)
    drive_m = 5e-4 * np.where(t_s < 4.0, t_s, 8.0 - t_s)
    slide_m = drive_m - 5e-4 * np.clip(np.where(t_s < 4.0, 1.0, 5.0 - t_s), -1.0, 1.0)
    trace = listen(drive_m, slide_m, missing="drive_force_N", **WITHOUT_FORCE)
    assert trace["drive_force_N"][-1000:] == pytest.approx(-5.85, abs=0.1)


@pytest.mark.parametrize("factor", [10.0, 0.1])
def test_the_stiffness_is_learnt_whatever_is_configured(factor: float) -> None:
    drive_m, slide_m = stick_slip(3.0, 5e-4, 0.96, 0.04)
    trace = listen(drive_m, slide_m, offset_N=8.0, drive_stiffness_N_per_m=factor * STIFFNESS_N_PER_M)
    assert trace["drive_stiffness_N_per_m"][-1] == pytest.approx(STIFFNESS_N_PER_M, rel=0.05)
    assert trace["drive_stiffness_sigma"][-1] < 0.1
    assert int(trace["slips"][-1]) == 3
    assert (trace["state"][170:950] == wire.STICK).mean() > 0.95


def test_breakaway_and_the_time_to_the_next_slip_are_learnt() -> None:
    drive_m, slide_m = stick_slip(6.0, 5e-4, 0.96, 0.04)
    trace = listen(drive_m, slide_m, offset_N=8.0)
    breakaway_N = 8.0 + STIFFNESS_N_PER_M * 5e-4 * 0.97
    assert trace["breakaway_force_N"][-1] == pytest.approx(breakaway_N, rel=0.03)
    assert trace["time_to_slip_s"][5500] == pytest.approx(0.46, abs=0.05)


def test_a_slide_on_a_resting_drive_is_at_a_standstill_and_does_not_slip() -> None:
    drive_m = 5e-4 * np.clip(time_s(5.0), 0.0, 2.0)
    trace = listen(drive_m, drive_m, offset_N=12.0)
    assert (trace["state"][2030:] == wire.STANDSTILL).all()
    assert trace["slips"][-1] == 0


@pytest.mark.parametrize(
    ("stiffness", "fall_s", "drop_N", "for_s"), [(168.0, 0.042, 0.019, 2.0), (2254.0, 0.0116, 0.022, 0.7)]
)
@pytest.mark.slow
def test_slips_are_counted_where_they_last_longer_than_a_stick_and_nothing_shows_the_slide(
    stiffness: float, fall_s: float, drop_N: float, for_s: float
) -> None:
    """A dead slide position must not make the spring soft: it never changes by a step."""
    speed_mps = 1.1e-3
    stick_s = drop_N / (stiffness * speed_mps)
    period_s = stick_s + fall_s
    t_s = time_s(for_s)  # later the dead slide position is doubted, and no slip is counted
    phase = t_s % period_s
    fall = 0.5 * drop_N * (1 + np.cos(np.pi * (phase - stick_s) / fall_s))
    node = ControllerNode(
        validate(ControllerConfig, {"drive_stiffness_N_per_m": stiffness, "policy": {"enabled_from_s": 1e9}}, "test")
    )
    sensors = sensor_block(SAMPLES).blank()
    force_N = 0.1 + np.where(phase < stick_s, drop_N * phase / stick_s, fall)
    for block in range(len(t_s) // SAMPLES):
        rows = slice(SAMPLES * block, SAMPLES * (block + 1))
        sensors["sequence"], sensors["t_ns"] = block, 1_000_000 * (block + 1)
        sensors["drive_force_N"], sensors["drive_position_m"] = force_N[rows], speed_mps * t_s[rows]
        node.block(sensors.tobytes())
    assert int(node._trace[0]["slips"]) == pytest.approx(for_s / period_s, rel=0.05)
