"""The speeds at which vibration is needed or not."""

from typing import Any

import pytest

from bridge.config import validate
from controller.config import ControllerConfig
from controller.policy.trial import is_needed, is_needless, note_needed, note_needless
from controller.records import build


def _start() -> Any:
    return build(validate(ControllerConfig, {}, "test"))[1][0]


def test_a_ratio_needed_at_a_speed_is_needed_below_it() -> None:
    s = _start()
    assert not is_needed(s, 1e-4)
    note_needed(s, 1e-3)
    assert is_needed(s, 1e-4)
    assert is_needed(s, 1.2e-3)
    assert not is_needed(s, 1.3e-3)


def test_a_ratio_needless_at_a_speed_is_needless_above_it() -> None:
    s = _start()
    assert not is_needless(s, 1.0)
    note_needless(s, 1e-3)
    assert is_needless(s, 1.0)
    assert is_needless(s, 0.81e-3)
    assert not is_needless(s, 0.79e-3)


@pytest.mark.parametrize("speed_mps", [2e-4, 1e-3, 5e-3])
def test_no_speed_is_both_needed_and_needless(speed_mps: float) -> None:
    s = _start()
    note_needless(s, 1e-3)
    note_needed(s, speed_mps)
    for at in (1e-4, 1e-3, 1e-2):
        assert not (is_needed(s, at) and is_needless(s, at))
    assert is_needed(s, speed_mps)
    note_needless(s, speed_mps)
    assert is_needless(s, speed_mps)
    for at in (1e-4, 1e-3, 1e-2):
        assert not (is_needed(s, at) and is_needless(s, at))
