"""Trials without vibration: their begin, their results, and none with a force or slide position that is doubted."""

from typing import Any

import pytest

from bridge.config import validate
from bridge.wire.stickslip_pb2 import ACTIVE, EXCITE, PROBE, SMOOTH, STICK, WATCH
from controller.config import ControllerConfig
from controller.policy.decide import decide
from controller.policy.need import is_needed, is_needless
from controller.policy.trial import HELPLESS, begin_trial, follow_trial, is_due, length_s
from controller.records import build
from controller.trips.doubts import CONTACT

SPEED_MPS, FORCE_N = 5e-4, 10.0


def _in_motion(ratio: float) -> tuple[Any, Any]:
    """A controller in even motion, with a trial due; `ratio`: its present v_a / v_d."""
    params, memory = build(validate(ControllerConfig, {}, "test"))
    p: Any = params[0]
    s: Any = memory[0]
    s.direction, s.moving, s.untried_s[0], s.steady_s, s.ratio_now, s.in_force_s = 1, 1, 1000.0, 10.0, ratio, 10.0
    s.differences[0], s.contact, s.since_stick_s, s.slipped_s = 100, SMOOTH, 10.0, 10.0
    return p, s


def _tried(fall_with_N: float, fall_N: float, contact: int = SMOOTH, failed: float = 0.0) -> tuple[Any, int]:
    """The memory and the mode after a trial in which the force fell by `fall_N`."""
    p, s = _in_motion(0.0)
    s.fall_with_N[0], s.contact, s.failed = fall_with_N, contact, failed
    begin_trial(p, s, FORCE_N, SPEED_MPS)
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
    begin_trial(p, s, FORCE_N, SPEED_MPS)
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
    assert s.off_left_s[0] == (60.0 if mode == WATCH else 0.0)
    assert not is_needless(s, SPEED_MPS)
    assert s.failed <= HELPLESS


def test_below_a_speed_that_needs_no_vibration_a_trial_is_due_after_the_length_of_a_trial() -> None:
    p, s = _in_motion(1.2)
    s.untried_s[0] = length_s(s) + 0.1
    assert not is_due(p, s, SPEED_MPS)
    s.needless_from_mps[0] = 2.0 * SPEED_MPS
    assert is_due(p, s, SPEED_MPS)
    s.needed_to_mps[0] = SPEED_MPS
    assert not is_due(p, s, SPEED_MPS)


@pytest.mark.parametrize(("vibrated_s", "mode"), [(6.2, WATCH), (20.0, EXCITE)])
def test_a_vibration_below_the_drives_velocity_ends_unless_it_was_above_it_at_first(
    vibrated_s: float, mode: int
) -> None:
    p, s = _in_motion(1.2)
    s.guard_state, s.mode, s.mode_s, s.untried_s[0] = ACTIVE, EXCITE, vibrated_s, 0.0
    s.drive_velocity_mps, s.vibration_velocity_mps, s.allowed_m = SPEED_MPS, 0.9 * SPEED_MPS, 3e-8
    s.since_stick_s, s.slipped_s, s.steady_s, s.weak_s = 30.0, 30.0, 30.0, 6.0
    decide(p, s, 10**12, FORCE_N, 1e-3)
    assert s.mode == mode


def test_a_trial_begins_by_a_fade_to_the_drives_velocity() -> None:
    p, s = _in_motion(1.2)
    begin_trial(p, s, 0.0, SPEED_MPS)
    fades = []
    for _ in range(600):
        follow_trial(p, s, 0.0, SPEED_MPS)
        fades.append(float(s.fade))
    falling = [fade for fade in fades if fade > 0.0]
    assert len(falling) == pytest.approx(500, abs=2)
    assert min(falling) > 1.0
    assert falling == sorted(falling, reverse=True)
