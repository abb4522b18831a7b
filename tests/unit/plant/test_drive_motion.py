"""Moves within their limits, cycles that end where they began, and drives that stay within the range of their sensors."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config import validate
from bridge.faults import Fault
from cockpit.run.scenario import load_rig, load_scenario
from plant.drive_config import DriveConfig
from plant.drive_motion import (
    Move,
    again_and_again,
    lowest_mps,
    of_moves,
    of_profile,
    peak_mps,
    position_m,
    reach_m,
    velocity_mps,
)
from plant.inputs import RigInputs
from plant.simulate import held_velocity, simulate

BLOCK_S = 1e-3
TWO_SIDED = ["rig.sensors.force_lowest_N=-50.0", "rig.sensors.position_lowest_m=-0.05"]
THERE = "{distance_m = 0.004, velocity_mps = 0.002, acceleration_mps2 = 0.05, jerk_mps3 = 2.0, dwell_s = 0.3}"
BACK = "{to_m = 0.0, velocity_mps = 0.001, acceleration_mps2 = 0.05, jerk_mps3 = 2.0}"


@pytest.mark.parametrize(
    ("distance_m", "peak", "seconds"),
    [
        (0.1, 0.02, 0.1 / 0.02 + 0.02 / 0.5 + 0.5 / 50.0),  # all seven pieces
        (0.0009, 0.0188600094, 2 * (0.0188600094 / 0.5 + 0.01)),  # the velocity is not reached
        (1e-5, (0.25 * 1e-10 * 50.0) ** (1 / 3), 4 * (0.5 * 1e-5 / 50.0) ** (1 / 3)),  # nor the acceleration
    ],
)
def test_moves_against_their_closed_forms(distance_m: float, peak: float, seconds: float) -> None:
    move = Move(distance_m, 0.02, 0.5, 50.0, 0.0)
    motion = of_moves([move])
    assert peak_mps(move) == pytest.approx(peak, rel=1e-6)
    assert motion.start_s[-1] == pytest.approx(seconds, rel=1e-6)
    assert motion.position_m[-1] == distance_m


sizes = st.floats(1e-7, 1.0)
moves = st.builds(
    Move,
    st.one_of(sizes, sizes.map(lambda size: -size)),
    st.floats(1e-6, 1.0),
    st.floats(1e-4, 100.0),
    st.floats(1e-3, 1e5),
    st.sampled_from([0.0, 0.25]),
)


@settings(max_examples=200, deadline=None)
@given(move=moves)
@pytest.mark.slow
def test_a_move_keeps_its_limits_and_ends_at_rest_where_it_should(move: Move) -> None:
    motion = of_moves([move])
    end_s = float(motion.start_s[-1])
    t_s = np.linspace(0.0, end_s, 2001)
    speed = velocity_mps(motion, t_s)
    assert np.abs(speed).max() <= move.velocity_mps * (1 + 1e-9)
    assert np.abs(motion.acceleration_mps2).max() <= move.acceleration_mps2 * (1 + 1e-6)
    assert set(np.abs(motion.jerk_mps3)) <= {0.0, move.jerk_mps3}
    assert (speed * move.distance_m >= -1e-9 * move.velocity_mps).all()  # it never turns back
    before_s = math.nextafter(end_s - move.dwell_s, 0.0)
    assert position_m(motion, np.array([before_s]))[0] == pytest.approx(move.distance_m, rel=1e-7)
    assert velocity_mps(motion, np.array([before_s]))[0] == pytest.approx(0.0, abs=1e-6 * move.velocity_mps)
    # no jump where one piece meets the next
    joints = motion.start_s[1:]
    gaps = position_m(motion, joints) - position_m(motion, np.nextafter(joints, 0.0))
    assert np.abs(gaps).max() <= 1e-7 * abs(move.distance_m)


profiles = st.lists(st.tuples(st.floats(0.01, 2.0), st.floats(-0.1, 0.1)), min_size=1, max_size=5).map(
    lambda steps: [(float(t), v) for t, v in zip(np.cumsum([t for t, _ in steps]), (v for _, v in steps), strict=True)]
)


@settings(max_examples=100, deadline=None)
@given(points=profiles, until_s=st.floats(0.0, 40.0), cycle=st.booleans())
@pytest.mark.slow
def test_the_reach_covers_every_moment(points: list[tuple[float, float]], until_s: float, cycle: bool) -> None:
    motion = of_profile(points)
    if cycle:
        motion = again_and_again(motion, points[-1][0] + 0.5)
    t_s = np.linspace(0.0, until_s, 20_001)
    places, step_m = position_m(motion, t_s), 0.1 * until_s / 20_000
    low, high = reach_m(motion, until_s)
    assert places.min() - step_m <= low <= places.min() + 1e-9
    assert places.max() - 1e-9 <= high <= places.max() + step_m
    turns_back = bool((velocity_mps(motion, t_s) < -1e-9).any())
    assert not turns_back or lowest_mps(motion, until_s) < 0.0


def test_a_profile_that_comes_once_is_held_as_it_always_was() -> None:
    config = load_rig("paper-c45-c45", ["drive.profile=[[0.5, 0.0], [1.0, 0.002], [2.0, -0.001]]"])
    t_s = np.arange(3000) * BLOCK_S
    assert np.array_equal(held_velocity(config)(t_s), np.interp(t_s, [0.5, 1.0, 2.0], [0.0, 0.002, -0.001]))


def test_moves_are_held_so_that_the_places_at_the_ends_of_blocks_are_exact() -> None:
    config = load_rig("paper-c45-c45", [f"drive.moves=[{THERE}, {BACK}]", "drive.repeat_every_s=7.0"])
    motion = config.drive.motion()
    held = held_velocity(config)(np.arange(7000) * BLOCK_S)
    ends_s = (np.arange(7000) + 1) * BLOCK_S
    assert np.cumsum(held) * BLOCK_S == pytest.approx(position_m(motion, ends_s), abs=1e-14)
    assert motion.drift_m == 0.0
    result = simulate(config, 7.0)
    assert result.drive_position_m.max() == pytest.approx(0.004, abs=1e-12)
    assert result.drive_position_m[-1] == pytest.approx(0.0, abs=1e-12)


def test_a_day_of_cycles_ends_where_it_began_and_costs_no_memory() -> None:
    config = load_rig("paper-c45-c45", [f"drive.moves=[{THERE}, {BACK}]", "drive.repeat_every_s=6.7001"])
    cycles = round(86_400 / 6.7001)
    at_s = cycles * 6.7001 + np.arange(6700) * BLOCK_S
    first = held_velocity(config)(np.arange(6700) * BLOCK_S)
    assert held_velocity(config)(at_s) == pytest.approx(first, abs=1e-9)
    assert position_m(config.drive.motion(), np.array([cycles * 6.7001]))[0] == pytest.approx(0.0, abs=1e-12)
    inputs = RigInputs(config, 1)
    inputs._block = 86_400_000
    assert len(inputs.draw(64).velocity_mps) == 64


def test_a_repeated_profile_restarts() -> None:
    stroke = "drive.profile=[[0.0, 0.0], [0.1, 0.002], [0.9, 0.002], [1.1, -0.002], [1.9, -0.002], [2.0, 0.0]]"
    config = load_rig("paper-c45-c45", [stroke, "drive.repeat_every_s=2.5"])
    held = held_velocity(config)(np.arange(7500) * BLOCK_S).reshape(3, 2500)
    assert held[1] == pytest.approx(held[0], abs=1e-12)
    assert held[2] == pytest.approx(held[0], abs=1e-12)
    assert (np.abs(held[:, 2000:]) < 1e-12).all()
    assert held.sum() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        (["rig.drive.profile=[[0.0, -0.0005]]"], ["goes to -8 mm", "ends at 0 mm", "set it to -0.01"]),
        (
            ["rig.drive.profile=[[0.0, 0.0005], [8.0, -0.0004]]", "duration_s=8.5"],
            ["rig.sensors.force_lowest_N = 0", "as it goes back or after a slip", "set it to -50"],
        ),
        ([*TWO_SIDED, "rig.drive.profile=[[0.0, -0.01]]"], ["goes to -160 mm", "ends at -50 mm", "set it to -0.2"]),
        (
            [*TWO_SIDED, "rig.drive.profile=[[0.0, 0.01], [1.0, 0.01]]", "rig.drive.repeat_every_s=1.0"],
            ["goes to 160 mm", "ends at 50 mm", "set it to 0.2"],
        ),
        (
            [*TWO_SIDED, "rig.drive.profile=[[0.0, 1e-6]]", "rig.drive.repeat_every_s=1.0", "duration_s=0.0"],
            ["rig.drive.repeat_every_s = 1: each cycle ends 0.001 mm from its start", "change the way back"],
        ),
        (
            [f"rig.drive.moves=[{THERE}, {BACK}]", "rig.drive.repeat_every_s=3.0", *TWO_SIDED],
            ["repeat_every_s = 3: must hold the whole of moves, 6.4", "raise it"],
        ),
        (
            [f"rig.drive.moves=[{BACK.replace('0.0,', '0.001,')}]", "rig.drive.repeat_every_s=3.0", *TWO_SIDED],
            ["repeat_every_s = 3: the moves end at 0.001 m", "add a move with to_m = 0.0"],
        ),
        (
            ["rig.drive.profile=[[0.0, 0.001], [5.0, 0.0]]", "rig.drive.repeat_every_s=3.0"],
            ["must hold the whole of profile, 5 s"],
        ),
        (
            [f"rig.drive.moves=[{THERE.replace('}', ', to_m = 0.1}')}]"],
            ["rig.drive.moves.0", "distance_m, to_m: both given: must be one of them"],
        ),
        (["rig.drive.moves=[{velocity_mps = 1.0, acceleration_mps2 = 1.0, jerk_mps3 = 1.0}]"], ["neither given"]),
    ],
)
def test_an_impossible_drive_or_sensor_setting_is_reported(given: list[str], parts: list[str]) -> None:
    with pytest.raises(Fault) as caught:
        load_scenario("from-the-start", given)
    assert all(part in caught.value.line for part in parts), caught.value.line


def test_cycles_of_hours_are_taken() -> None:
    cycle = [f"rig.drive.moves=[{THERE}, {BACK}]", "rig.drive.repeat_every_s=7.0", *TWO_SIDED]
    for duration_s in (0.0, 36_000.0):
        scenario = load_scenario("from-the-start", [*cycle, f"duration_s={duration_s}"])
        assert scenario.rig.drive.speeds_mps() == [0.001, 0.002]


def test_a_drive_that_drifts_within_its_range_is_taken() -> None:
    cycle = [
        "rig.drive.profile=[[0.0, 0.001], [1.0, -0.0009], [2.0, 0.001]]",
        "rig.drive.repeat_every_s=2.0",
        *TWO_SIDED,
    ]
    assert load_scenario("from-the-start", [*cycle, "duration_s=300.0"])
    with pytest.raises(Fault, match="ends at 50 mm"):
        load_scenario("from-the-start", [*cycle, "duration_s=3000.0"])


def test_the_same_drive_from_a_table() -> None:
    table = {"moves": [{"to_m": 0.01, "velocity_mps": 0.1, "acceleration_mps2": 1.0, "jerk_mps3": 10.0}]}
    motion = validate(DriveConfig, table, "test").motion()
    assert motion.position_m[-1] == 0.01
