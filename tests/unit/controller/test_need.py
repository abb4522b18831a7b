"""The ratio remembered for a speed and a direction, and how it rises and falls."""

from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from controller.config import ControllerConfig
from controller.policy.need import (
    follow_swing,
    grows,
    is_needed,
    is_needless,
    note_needed,
    note_needless,
    raise_ratio,
    swing_held,
)
from controller.records import build


def _start(way: int = 1) -> tuple[Any, Any]:
    params, state = build(validate(ControllerConfig, {}, "test"))
    s = state[0]
    s.direction = way
    s.ratio[:] = 1.2
    return params[0], s


def test_a_ratio_needed_at_a_speed_is_needed_below_it() -> None:
    _, s = _start()
    assert not is_needed(s, 1e-4)
    note_needed(s, 1e-3)
    assert is_needed(s, 1e-4)
    assert is_needed(s, 1.2e-3)
    assert not is_needed(s, 1.3e-3)


def test_a_ratio_needless_at_a_speed_is_needless_above_it() -> None:
    _, s = _start()
    assert not is_needless(s, 1.0)
    note_needless(s, 1e-3)
    assert is_needless(s, 1.0)
    assert is_needless(s, 0.81e-3)
    assert not is_needless(s, 0.79e-3)


def test_each_direction_has_its_own_memory() -> None:
    _, s = _start(way=-1)
    note_needed(s, 1e-3)
    assert is_needed(s, 5e-4)
    s.direction = 1
    assert is_needed(s, 5e-4)  # nothing else is known there
    note_needless(s, 2e-4)
    assert not is_needed(s, 5e-4)
    note_needless(s, 2e-3)
    s.direction = -1
    assert is_needed(s, 5e-4)
    assert not is_needless(s, 2e-3)


@pytest.mark.parametrize("speed_mps", [2e-4, 1e-3, 5e-3])
def test_no_speed_is_both_needed_and_needless(speed_mps: float) -> None:
    _, s = _start()
    note_needless(s, 1e-3)
    note_needed(s, speed_mps)
    for at in (1e-4, 1e-3, 1e-2):
        assert not (is_needed(s, at) and is_needless(s, at))
    assert is_needed(s, speed_mps)
    note_needless(s, speed_mps)
    assert is_needless(s, speed_mps)
    for at in (1e-4, 1e-3, 1e-2):
        assert not (is_needed(s, at) and is_needless(s, at))


def _follow(p: Any, s: Any, seconds: float, settle_s: float = 0.1) -> None:
    for _ in range(round(seconds / 0.01)):
        follow_swing(p, s, 0.01, settle_s)


def test_the_ratio_falls_to_the_least_once_the_spring_is_wound_up() -> None:
    p, s = _start()
    _follow(p, s, 20.0)
    assert s.ratio[0] == 1.2
    s.even_s = 0.2
    _follow(p, s, 20.0)
    assert s.ratio[0] == p.least_ratio == 1.07


@pytest.mark.slow
def test_the_ratio_never_falls_onto_the_edge_until_that_is_forgotten() -> None:
    p, s = _start()
    s.ratio[0], s.even_s = 1.1, 0.2
    raise_ratio(p, s, 0.1)
    assert s.ratio[0] == pytest.approx(1.2)
    s.swing = 0.0
    _follow(p, s, 20.0)
    assert s.ratio[0] == pytest.approx(1.12)  # a step above, and twice as far after each more failure
    _follow(p, s, 60.0)
    assert s.ratio[0] < 1.12
    assert s.ratio[1] == 1.2


@pytest.mark.parametrize("swing", [0.05, 0.1, 0.2])
@pytest.mark.slow
def test_the_ratio_rises_until_it_holds_a_swing_of_friction_and_stays(swing: float) -> None:
    """Friction that falls by the swing is still held: (1 - swing) is more than the mean friction, over that at v_a = v_s."""
    p, s = _start()
    s.swing, s.even_s, s.proven[:] = swing, 0.2, 1
    _follow(p, s, 40.0, settle_s=1.0)
    assert swing_held(float(s.ratio[0])) == pytest.approx(swing, rel=0.02)
    relative = np.abs(1.0 + s.ratio[0] * np.cos(np.linspace(0.0, 2.0 * np.pi, 100_000)))
    assert 1.0 / relative.mean() < 1.0 - swing


@pytest.mark.slow
def test_the_ratio_is_bounded_and_changes_no_faster_than_the_spring_follows() -> None:
    p, s = _start()
    s.swing = 0.9
    follow_swing(p, s, 0.01, 10.0)
    assert 1.2 < s.ratio[0] < 1.2 * 1.001
    assert s.lead == pytest.approx(s.ratio[0] / 1.2 - 1.0)
    _follow(p, s, 60.0)
    assert s.ratio[0] == pytest.approx(1.4 * p.v_ratio)  # without a slip or surge
    s.proven[:] = 1
    _follow(p, s, 60.0)
    assert s.ratio[0] == p.most_ratio
    raise_ratio(p, s, 0.4)
    assert s.ratio[0] == p.most_ratio


@pytest.mark.parametrize("ratio", [1.05, 1.2, 1.5, 2.4])
def test_mean_friction_grows_with_slide_speed_by_the_mean_relative_speed(ratio: float) -> None:
    def friction(v_s: float) -> float:
        return v_s / float(np.abs(v_s + ratio * np.cos(np.linspace(0.0, 2.0 * np.pi, 100_001)[:-1])).mean())

    by = (friction(1.001) - friction(0.999)) / 0.002 / friction(1.0)
    assert grows(ratio) == pytest.approx(by, rel=0.01)


def test_an_unknown_direction_starts_from_the_ratio_of_the_known_direction() -> None:
    _, s = _start()
    note_needless(s, 1e-3)
    s.direction = -1
    assert is_needless(s, 1e-3)
    note_needed(s, 1e-3)
    assert not is_needless(s, 1e-3)
    s.direction = 1
    assert is_needless(s, 1e-3)


@pytest.mark.slow
def test_the_distance_from_the_edge_doubles_with_every_failure() -> None:
    p, s = _start()
    distances: list[float] = []
    for _ in range(4):
        s.ratio[0], s.even_s, s.swing, s.edge_ratio[0] = 1.3, 0.2, 0.0, 0.0
        raise_ratio(p, s, 0.4)
        s.swing = 0.0
        _follow(p, s, 20.0)
        distances.append(float(s.ratio[0]) - 1.3)
    assert distances == pytest.approx([0.02, 0.04, 0.08, 0.16])
