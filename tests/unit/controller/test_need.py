"""What is remembered of a speed and a direction, and how the ratio rises and falls."""

from typing import Any

import pytest

from bridge.config import validate
from controller.config import ControllerConfig
from controller.need import is_needed, is_needless, lower_ratio, note_needed, note_needless, raise_ratio
from controller.records import build


def _start(way: int = 1) -> tuple[Any, Any]:
    params, state = build(validate(ControllerConfig, {}, "test"))
    s = state[0]
    s.direction = way
    s.ratio[:] = 1.2
    return params[0], s


def test_what_is_needed_at_a_speed_is_needed_below_it() -> None:
    _, s = _start()
    assert not is_needed(s, 1e-4)
    note_needed(s, 1e-3)
    assert is_needed(s, 1e-4)
    assert is_needed(s, 1.2e-3)
    assert not is_needed(s, 1.3e-3)


def test_what_is_needless_at_a_speed_is_needless_above_it() -> None:
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
    assert not is_needed(s, 5e-4)
    note_needless(s, 1e-3)
    s.direction = -1
    assert not is_needless(s, 1e-3)


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


def _calm(p: Any, s: Any, seconds: float, wait_s: float = 0.5) -> None:
    for _ in range(round(seconds / 0.01)):
        lower_ratio(p, s, 0.01, wait_s)


def test_the_ratio_falls_to_the_least_in_calm() -> None:
    p, s = _start()
    _calm(p, s, 0.4)
    assert s.ratio[0] == 1.2
    _calm(p, s, 20.0)
    assert s.ratio[0] == p.least_ratio == 1.05


def test_the_ratio_never_falls_onto_the_edge_until_that_is_forgotten() -> None:
    p, s = _start()
    s.ratio[0] = 1.1
    raise_ratio(p, s, 0.1)
    assert s.ratio[0] == pytest.approx(1.2)
    _calm(p, s, 20.0)
    assert s.ratio[0] == pytest.approx(1.12)  # a step above
    _calm(p, s, 60.0)
    assert s.ratio[0] < 1.12
    assert s.ratio[1] == 1.2


def test_the_ratio_is_bounded_and_does_not_fall_while_the_slide_swings() -> None:
    p, s = _start()
    for _ in range(10):
        raise_ratio(p, s, 0.4)
    assert s.ratio[0] == p.most_ratio
    s.swing = 0.5
    _calm(p, s, 20.0)
    assert s.ratio[0] == p.most_ratio
