"""The ratio v_a / v_d: how it follows the swing of friction, and how a slip raises it."""

from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from controller.config import ControllerConfig
from controller.policy.ratio import follow_swing, grows, raise_ratio, swing_held
from controller.records import build


def _start() -> tuple[Any, Any]:
    params, state = build(validate(ControllerConfig, {}, "test"))
    s: Any = state[0]
    s.direction = 1
    s.ratio = 1.2
    return params[0], s


def _follow(p: Any, s: Any, seconds: float, settle_s: float = 0.1) -> None:
    for _ in range(round(seconds / p.block_s)):
        follow_swing(p, s, settle_s)


def test_the_ratio_falls_to_the_least_once_the_spring_is_wound_up() -> None:
    p, s = _start()
    _follow(p, s, 20.0)
    assert s.ratio == 1.2
    s.even_s = 0.2
    _follow(p, s, 20.0)
    assert s.ratio == p.least_ratio == 1.07


def test_a_rise_is_the_swing_that_the_new_ratio_holds() -> None:
    p, s = _start()
    raise_ratio(p, s, 0.1)
    assert s.ratio == pytest.approx(1.3)
    s.even_s = 0.2
    _follow(p, s, 20.0)
    assert s.ratio == pytest.approx(1.3, rel=1e-3)  # until the swing decays
    assert s.memory_s == 10.0
    raise_ratio(p, s, 0.1)
    assert s.memory_s == 20.0


@pytest.mark.parametrize("swing", [0.05, 0.1, 0.2])
@pytest.mark.slow
def test_the_ratio_rises_until_it_holds_a_swing_of_friction_and_stays(swing: float) -> None:
    """Friction that falls by the swing is still held: (1 - swing) is more than the mean friction, over that at v_a = v_s."""
    p, s = _start()
    s.swing, s.even_s, s.memory_s = swing, 2.0, 10.0
    _follow(p, s, 40.0, settle_s=1.0)
    assert swing_held(float(s.ratio)) == pytest.approx(swing, rel=0.02)
    relative = np.abs(1.0 + s.ratio * np.cos(np.linspace(0.0, 2.0 * np.pi, 100_000)))
    assert 1.0 / relative.mean() < 1.0 - swing


@pytest.mark.slow
def test_the_ratio_is_bounded_and_changes_no_faster_than_the_spring_follows() -> None:
    p, s = _start()
    s.swing = 0.9
    follow_swing(p, s, 5.0)
    assert 1.2 < s.ratio < 1.2 * 1.0001
    _follow(p, s, 60.0)
    assert s.ratio == pytest.approx(1.4 * p.v_ratio)  # without a slip or surge
    s.memory_s = 10.0
    _follow(p, s, 60.0)
    assert s.ratio == p.most_ratio
    raise_ratio(p, s, 0.4)
    assert s.ratio == p.most_ratio


@pytest.mark.parametrize("ratio", [1.05, 1.2, 1.5, 2.4])
def test_mean_friction_grows_with_slide_speed_by_the_mean_relative_speed(ratio: float) -> None:
    def friction(v_s: float) -> float:
        return v_s / float(np.abs(v_s + ratio * np.cos(np.linspace(0.0, 2.0 * np.pi, 100_001)[:-1])).mean())

    by = (friction(1.001) - friction(0.999)) / 0.002 / friction(1.0)
    assert grows(ratio) == pytest.approx(by, rel=0.01)
