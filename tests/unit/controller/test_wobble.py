"""The question whether friction falls with speed, asked of a slide that follows v_a by a known share."""

import math
from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from controller.config import ControllerConfig
from controller.estimate.windows import DRIVE, FORCE, SLIDE
from controller.needs.wobble import (
    DEPTH,
    EVEN,
    FALLS,
    PERIODS,
    UNSURE,
    answer,
    begin_wobble,
    can_ask,
    wobble,
    wobble_factor,
)
from controller.records import build

SPEED_MPS, RATIO = 5e-4, 1.2
SMOOTHED = 0.973  # by windows of a sixth of a period


def _start() -> tuple[Any, Any]:
    params, state = build(validate(ControllerConfig, {}, "test"))
    p, s = params[0], state[0]
    s.direction, s.stiffness_N_per_m, s.allowed_Hz = 1, 11700.0, 4500.0
    s.pushed[:], s.noise[SLIDE, :] = 100, 1e-3 * 0.35 ** np.arange(len(p.window_s))
    s.noise[FORCE, :], s.noise[DRIVE, :] = 1e3, 1e-9
    return p, s


def _ask(follows: float, trend: float = 0.0, aside: float = 0.0, rounds: int = 1) -> Any:
    """A slide that follows v_a by a share that is `follows` in step and `aside` a quarter of a period later."""
    p, s = _start()
    assert begin_wobble(p, s, SPEED_MPS, 1.0)
    blocks, answered = 0, 0
    while answered < rounds:
        turn_rad = 2.0 * math.pi * s.wobble_s / s.wobble_period_s
        s.fast_mps = RATIO * SPEED_MPS * wobble_factor(s)
        late_rad = math.pi * (p.window_s[s.wobble_level] - p.block_s) / s.wobble_period_s
        expected = DEPTH * SMOOTHED * (follows * math.cos(turn_rad - late_rad) + aside * math.sin(turn_rad - late_rad))
        s.slope[SLIDE, :] = SPEED_MPS * (1.0 + expected) * (1.0 + trend * s.wobble_s / s.wobble_period_s)
        answered += wobble(p, s, SPEED_MPS)
        blocks += 1
    assert blocks * p.block_s == pytest.approx(rounds * PERIODS * s.wobble_period_s, abs=2.0 * p.block_s)
    return s


@pytest.mark.parametrize(("follows", "expected"), [(0.7, EVEN), (0.98, EVEN), (1.06, FALLS), (1.2, FALLS)])
@pytest.mark.parametrize("trend", [0.0, 0.01, -0.01])
def test_a_slide_that_follows_by_more_than_its_share_shows_a_fall_of_friction(
    follows: float, expected: int, trend: float
) -> None:
    assert answer(_ask(follows, trend)) == expected


@pytest.mark.parametrize(("follows", "at_last"), [(1.013, EVEN), (1.03, FALLS)])
@pytest.mark.slow
def test_an_answer_between_both_limits_is_probed_further_and_then_judged(follows: float, at_last: int) -> None:
    assert answer(_ask(follows)) == UNSURE
    assert answer(_ask(follows, rounds=4)) == at_last


@pytest.mark.parametrize(("share", "expected"), [(0.98, EVEN), (1.06, FALLS)])
@pytest.mark.parametrize("late", [0.1, 0.2])
def test_a_slide_that_its_mass_makes_late_follows_no_less(share: float, expected: int, late: float) -> None:
    in_step = 1.0 / (1.0 + late * late)
    assert answer(_ask(share * in_step, aside=share * late * in_step)) == expected


def test_a_response_out_of_step_does_not_count() -> None:
    assert answer(_ask(1.0, aside=0.5)) == FALLS


def test_nothing_is_asked_where_the_spring_is_quicker_or_the_noise_larger() -> None:
    p, s = _start()
    assert not can_ask(p, 5e-3)
    assert can_ask(p, 0.1)
    assert not begin_wobble(p, s, SPEED_MPS, 5e-3)
    s.noise[SLIDE, :] = 1.0
    assert not begin_wobble(p, s, SPEED_MPS, 1.0)
    assert s.wobbles == 0
