"""The known gain of the exciter, and its correction by a loop check of the rig."""

from typing import Any

import pytest

from controller.config import ControllerConfig
from controller.records import build
from controller.trips.band import CHECK_BLOCKS, begin_known, note_check, note_known

TONES_HZ = (1250.0, 2000.0, 2750.0, 3500.0, 4250.0)


def checked(gains: tuple[float, ...], **amplitude: float) -> tuple[Any, Any]:
    """Parameters and memory after the blocks that follow a check."""
    config = ControllerConfig.model_validate({"amplitude": amplitude})
    params, state = build(config)
    p: Any = params[0]
    s: Any = state[0]
    p.accel_bandwidth_Hz = 1e9  # the accelerometer rolls nothing off
    begin_known(p, s)
    for block in range(CHECK_BLOCKS):
        at = block % len(TONES_HZ)
        note_check(p, s, TONES_HZ[at], gains[at])
    return p, s


def test_a_check_of_a_stiff_mount_gives_the_gain_at_every_frequency() -> None:
    p, s = checked((0.8, 0.8, 0.8, 0.8, 0.8))
    assert s.known_gain[: p.candidates] == pytest.approx(0.8)
    assert (s.known_steps[: p.candidates] == p.known_steps).all()
    assert s.gain_other_s == 0.0


def test_between_tones_that_differ_the_first_even_vibration_decides_within_them() -> None:
    p, s = checked((1.0, 1.0, 4.0, 1.0, 1.0))
    at = next(i for i in range(p.candidates) if TONES_HZ[1] < p.candidate_Hz[i] < TONES_HZ[2])
    assert s.known_steps[at] == 0
    note_known(p, s, at, 2.5)
    assert s.known_gain[at] == pytest.approx(2.5)
    for _ in range(200):
        note_known(p, s, at, 0.3)  # an accelerometer that lost its gain after the check
    assert s.known_gain[at] >= 1.0


def test_a_configured_gain_that_the_check_contradicts_is_reported_and_replaced() -> None:
    p, s = checked((0.5,) * 5, known_gain=1.0)
    assert s.gain_other_s > 0.0
    assert s.known_gain[: p.candidates] == pytest.approx(0.5)


def test_a_rig_without_a_check_leaves_the_configured_gain() -> None:
    p, s = checked((0.0,) * 5, known_gain=1.3)
    assert s.gain_other_s == 0.0
    assert s.known_gain[: p.candidates] == pytest.approx(1.3)
