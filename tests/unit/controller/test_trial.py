"""Trials without vibration: their begin, their results, and none with a force or slide position that is doubted."""

from typing import Any

import pytest

from bridge.config import validate
from bridge.wire.stickslip_pb2 import EXCITE, PROBE, SMOOTH, STICK, WATCH
from controller.config import ControllerConfig
from controller.policy.trial import HELPLESS, begin_trial, follow_trial, is_due, is_needed, is_needless, length_s
from controller.records import build
from controller.trips.doubts import CONTACT

SPEED_MPS, FORCE_N = 5e-4, 10.0


def _in_motion(ratio: float) -> tuple[Any, Any]:
    """A controller in even motion, with a trial due; `ratio`: its present v_a / v_d."""
    params, memory = build(validate(ControllerConfig, {}, "test"))
    p: Any = params[0]
    s: Any = memory[0]
    s.direction, s.moving, s.untried_s, s.steady_s, s.ratio_now, s.in_force_s = 1, 1, 1000.0, 10.0, ratio, 10.0
    s.differences[0], s.contact, s.since_stick_s, s.slipped_s, s.moved_s = 100, SMOOTH, 10.0, 10.0, 10.0
    s.ratio, s.crest_N = 1.2, FORCE_N
    return p, s


def _tried(fall_with_N: float, fall_N: float, contact: int = SMOOTH, failed: float = 0.0) -> tuple[Any, int]:
    """The memory and the mode after a trial in which the force fell by `fall_N`."""
    p, s = _in_motion(0.0)
    s.fall_with_N, s.contact, s.failed = fall_with_N, contact, failed
    begin_trial(s)
    s.fall_N = fall_N
    mode = PROBE
    for _ in range(6000):
        mode = follow_trial(p, s, FORCE_N, SPEED_MPS)
        if mode != PROBE:
            break
    return s, mode


def test_a_doubted_force_begins_no_trial_and_ends_a_running_one() -> None:
    p, s = _in_motion(1.2)
    assert is_due(p, s, SPEED_MPS)
    begin_trial(s)
    assert s.mode == PROBE
    assert follow_trial(p, s, FORCE_N, SPEED_MPS) == PROBE
    s.doubted = CONTACT
    assert follow_trial(p, s, FORCE_N, SPEED_MPS) == EXCITE
    assert not is_due(p, s, SPEED_MPS)


def test_a_fall_shows_a_need_unless_the_force_falls_as_far_with_vibration() -> None:
    s, mode = _tried(fall_with_N=0.5, fall_N=2.0)
    assert (mode, is_needed(s, SPEED_MPS)) == (EXCITE, True)
    s, mode = _tried(fall_with_N=1.5, fall_N=2.0)
    assert (mode, is_needless(s, SPEED_MPS)) == (WATCH, True)
    s, mode = _tried(fall_with_N=0.5, fall_N=1.0)
    assert (mode, is_needless(s, SPEED_MPS)) == (WATCH, True)


@pytest.mark.parametrize(("fall_N", "mode"), [(2.0, WATCH), (4.0, EXCITE)])
def test_a_vibration_with_as_large_falls_as_without_pauses_and_shows_no_lack_of_need(fall_N: float, mode: int) -> None:
    s, after = _tried(fall_with_N=2.0, fall_N=fall_N, contact=STICK, failed=HELPLESS + 1.0)
    assert after == mode
    assert s.off_left_s == (60.0 if mode == WATCH else 0.0)
    assert not is_needless(s, SPEED_MPS)
    assert s.failed <= HELPLESS


def test_below_a_speed_that_needs_no_vibration_a_trial_is_due_after_the_length_of_a_trial() -> None:
    p, s = _in_motion(1.2)
    s.untried_s = length_s(s) + 0.1
    assert not is_due(p, s, SPEED_MPS)
    s.needless_from_mps = 2.0 * SPEED_MPS
    assert is_due(p, s, SPEED_MPS)
    s.needed_to_mps = SPEED_MPS
    assert not is_due(p, s, SPEED_MPS)


@pytest.mark.parametrize(
    ("moved_s", "failed", "mode"), [(10.0, 0.0, EXCITE), (0.3, 0.0, PROBE), (10.0, HELPLESS + 1.0, PROBE)]
)
@pytest.mark.parametrize("ratio", [0.0, 1.2])
def test_a_slip_ends_a_trial_but_at_a_start_or_where_slips_repeat_under_vibration(
    ratio: float, moved_s: float, failed: float, mode: int
) -> None:
    p, s = _in_motion(ratio)
    begin_trial(s)
    s.slip_began, s.moved_s, s.failed = 1, moved_s, failed
    assert follow_trial(p, s, FORCE_N, SPEED_MPS) == mode
    assert is_needed(s, SPEED_MPS) == (mode == EXCITE)


def test_a_slip_as_the_drive_brakes_shows_a_need_at_the_speed_before() -> None:
    p, s = _in_motion(0.0)
    begin_trial(s)
    assert follow_trial(p, s, FORCE_N, SPEED_MPS) == PROBE
    s.slip_began, s.steady_s = 1, 0.0
    assert follow_trial(p, s, FORCE_N, 0.3 * SPEED_MPS) == EXCITE
    assert is_needed(s, SPEED_MPS)


def test_a_trial_over_several_speeds_shows_no_lack_of_need_below_the_fastest() -> None:
    p, s = _in_motion(0.0)
    begin_trial(s)
    for _ in range(2000):
        follow_trial(p, s, FORCE_N, 3.0 * SPEED_MPS)
    modes = [follow_trial(p, s, FORCE_N, SPEED_MPS) for _ in range(3500)]
    assert WATCH in modes
    assert is_needless(s, 3.0 * SPEED_MPS)
    assert not is_needless(s, SPEED_MPS)


def test_a_trial_ends_at_a_speed_that_is_known_to_need_the_vibration() -> None:
    p, s = _in_motion(0.0)
    s.untried_s, s.needed_to_mps = 100.0, 0.5 * SPEED_MPS
    begin_trial(s)
    assert follow_trial(p, s, FORCE_N, SPEED_MPS) == PROBE
    assert follow_trial(p, s, FORCE_N, 0.4 * SPEED_MPS) == EXCITE


def test_a_trial_begins_by_a_fade_to_the_drives_velocity() -> None:
    p, s = _in_motion(1.2)
    begin_trial(s)
    fades = []
    for _ in range(600):
        follow_trial(p, s, 0.0, SPEED_MPS)
        fades.append(float(s.fade))
    falling = [fade for fade in fades if fade > 0.0]
    assert len(falling) == pytest.approx(500, abs=2)
    assert min(falling) > 1.0
    assert falling == sorted(falling, reverse=True)
