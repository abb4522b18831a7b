"""Sensors that fail while it vibrates: the vibration stays within bounds, and an event names the fault."""

from typing import Any

import numpy as np
import pytest

from bridge.wire import stickslip_pb2 as wire
from tests.closed_loop.sensor_faults import (
    CHANNELS,
    Fault,
    Memory,
    clipped,
    dead,
    drifting,
    frozen,
    jumped,
    noisy,
    scaled,
    suffer,
    swapped,
)

FORCE, OF_SLIDE, BASE, SLIDE, DRIVE = CHANNELS
AT_MOST_S = 0.2  # above 1.5 times the set point
BAND = 1.4
SECONDS = 3.2


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (scaled(BASE, 0.5), "OPEN_LOOP"),
        (scaled(BASE, 0.1), "OPEN_LOOP"),
        (dead(BASE), "FROZEN"),
        (frozen(BASE), "FROZEN"),
        (clipped(BASE, 3.0), "OPEN_LOOP"),
        (swapped(BASE, OF_SLIDE), "OPEN_LOOP"),
    ],
    ids=["half", "a tenth", "dead", "frozen", "clipped", "swapped"],
)
def test_a_doubted_accelerometer_leaves_the_vibration_at_the_known_gain(fault: Fault, reason: str) -> None:
    came = suffer(fault, SECONDS)
    assert came.over_s <= AT_MOST_S
    assert came.peak < 1.05 * BAND
    assert came.at_end == pytest.approx(1.0, abs=0.03)
    assert came.slips == 0
    assert came.reasons[reason] < AT_MOST_S
    assert "HELD_OPEN_LOOP" in came.limits


def test_an_accelerometer_whose_gain_is_lost_slowly_is_given_no_more_stroke_than_the_band() -> None:
    came = suffer(drifting(BASE, 0.1), 7.0)
    assert came.over_s <= AT_MOST_S
    assert came.peak < 1.1 * BAND
    assert came.slips == 0
    assert "GAIN_LIMIT" in came.limits
    assert came.reasons["EXCITER_END"] > 1.0


def test_more_vibration_than_commanded_is_followed_down_and_reported() -> None:
    came = suffer(scaled(BASE, 3.0), SECONDS)
    assert came.peak < 1.05
    assert came.reasons["RESONANCE"] < AT_MOST_S


@pytest.mark.parametrize("factor", [10.0, 0.1, 1000.0])
def test_a_drive_position_in_another_unit_fades_the_vibration_out(factor: float) -> None:
    came = suffer(scaled(DRIVE, factor), 4.0, speed_mps=1e-3)
    assert came.over_s <= AT_MOST_S
    assert came.reasons["DRIVE_DOUBTED"] < AT_MOST_S
    assert came.at_end == 0.0
    assert "NO_DRIVE" in came.limits


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (dead(FORCE), "FROZEN"),
        (frozen(FORCE), "FROZEN"),
        (scaled(FORCE, 1000.0), "FORCE_DOUBTED"),
        (scaled(SLIDE, 10.0), "SLIDE_DOUBTED"),
    ],
    ids=["dead", "frozen", "in another unit", "slide in another unit"],
)
def test_a_doubted_force_or_slide_leaves_it_vibrating_while_it_moves(fault: Fault, reason: str) -> None:
    came = suffer(fault, 4.0)
    assert came.over_s <= AT_MOST_S
    assert came.reasons[reason] < AT_MOST_S
    assert came.at_end == pytest.approx(1.0, abs=0.03)
    assert came.slips == 0
    assert "PROBE" not in {wire.Mode.Name(int(mode)) for mode in set(came.trace["mode"][2500:].tolist())}


def test_a_place_that_jumps_once_changes_nothing() -> None:
    came = suffer(jumped(DRIVE, 1e-3), SECONDS)
    assert came.peak < 1.2
    assert came.at_end > 0.85
    assert came.reasons["JUMPED"] < 0.01
    assert not set(came.reasons) & {"DRIVE_DOUBTED", "FORCE_DOUBTED"}


def test_a_place_that_drifts_raises_no_vibration() -> None:
    def drifts(block: Any, at: int, _memory: Memory) -> None:
        block[DRIVE] += 5e-7 * at  # 0.5 mm/s: twice the velocity

    came = suffer(drifts, SECONDS)
    assert came.over_s <= AT_MOST_S
    assert came.reasons["DRIVE_DOUBTED"] < 0.4


def test_a_drive_gain_that_was_wrong_from_the_start_is_not_confirmed() -> None:
    came = suffer(scaled(DRIVE, 2.0), 5.0, from_s=0.0)
    assert came.reasons["POSITIONS_APART"] < 4.5
    assert came.at_end < 1.4  # v_a is for the slide, and not for twice its velocity


def test_dropouts_of_the_accelerometer_leave_it_at_the_known_gain() -> None:
    def drops(block: Any, at: int, _memory: Memory) -> None:
        block[BASE] *= at % 100 >= 5

    came = suffer(drops, SECONDS)
    assert came.reasons["FROZEN"] < 0.5
    assert came.at_end == pytest.approx(1.0, abs=0.05)


def test_a_repaired_drive_vibrates_as_before_after_a_reset_by_the_operator() -> None:
    came = suffer(scaled(DRIVE, 10.0), 5.5, mend_s=2.5, operator={2700: wire.Operator.RESET})
    assert came.over_s <= AT_MOST_S
    assert came.at_end == pytest.approx(1.0, abs=0.15)


def test_noise_that_rises_a_hundredfold_is_learnt_again() -> None:
    came = suffer(noisy(DRIVE, 5e-5), SECONDS)
    assert came.over_s <= AT_MOST_S
    assert came.reasons["NOISE"] < AT_MOST_S
    assert came.slips == 0


def test_all_channels_frozen_fade_out() -> None:
    came = suffer(frozen(*CHANNELS), SECONDS)
    assert came.over_s == 0.0
    assert came.at_end == 0.0
    assert came.reasons["FROZEN"] < AT_MOST_S


def test_an_operator_ends_a_trip_and_the_vibration_goes_on_without_a_step() -> None:
    mended_s, reset_block = 2.5, 2700
    came = suffer(scaled(BASE, 0.3), 3.6, mend_s=mended_s, operator={reset_block: wire.Operator.RESET})
    held = came.trace["reason"][2200:reset_block]
    assert set(held.tolist()) == {wire.OPEN_LOOP}  # mended by itself, it is held
    assert wire.OPEN_LOOP not in set(came.trace["reason"][reset_block:].tolist())
    step_m = np.abs(np.diff(came.trace["wanted_amplitude_m"][reset_block - 5 :]))
    assert step_m.max() < 2e-9
    assert came.at_end == pytest.approx(1.0, abs=0.15)


def test_a_configured_gain_bounds_a_fault_from_the_first_block() -> None:
    known = {"amplitude": {"known_gain": 1.0}}
    came = suffer(scaled(BASE, 0.1), SECONDS, from_s=0.0, controller=known)
    assert came.peak < 1.25 * 1.1 * BAND  # a slide that sticks at the start of a move gets 1.25 set points
    assert came.over_s <= AT_MOST_S
    assert "OPEN_LOOP" in came.reasons


def test_an_exciter_as_it_should_be_trips_nothing() -> None:
    came = suffer(lambda _block, _at, _memory: None, SECONDS)
    assert came.limits <= {"NO_LIMIT", "SLEW"}
    assert set(came.reasons) <= {"STICK_SEEN", "HELD", "STILL_NEEDED", "NEEDED_BEFORE"}
