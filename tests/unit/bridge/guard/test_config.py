"""A table [guard] that makes no sense is refused, with the place, the value and the rule."""

from typing import Any

import pytest

from bridge.config import validate
from bridge.faults import Fault
from bridge.guard.config import GuardConfig, wider


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"stroke_m": {"alarm": 2e-7, "abort": 1e-7}}, "abort = 1e-07: must not be below alarm = 2e-07"),
        ({"forbidden_Hz": [[3000.0, 2000.0]]}, "forbidden_Hz: [3000, 2000]: the second must be above the first"),
        ({"check_Hz": [2000.0, 1000.0]}, "check_Hz = [2000.0, 1000.0]: must rise"),
        ({"check_Hz": [1000.0, 1000.0]}, "must rise"),
        ({"loud": 3.0}, "loud = 3.0: unknown key; known here"),
        ({"duty_window_s": -1.0}, "duty_window_s = -1.0"),
    ],
)
def test_nonsense_is_refused(table: dict[str, Any], message: str) -> None:
    with pytest.raises(Fault) as error:
        validate(GuardConfig, table, "rig.toml")
    assert message in error.value.line


def test_equal_alarm_and_abort_levels_are_accepted() -> None:
    assert validate(GuardConfig, {"loud_ratio": {"alarm": 3.0, "abort": 3.0}}, "rig.toml").loud_ratio.abort == 3.0


def test_limits_that_protect_less_than_the_defaults_are_named() -> None:
    assert wider(GuardConfig()) == ""
    assert wider(validate(GuardConfig, {"loud_ratio": {"alarm": 2.0, "abort": 3.0, "hold_s": 0.05}}, "rig.toml")) == ""
    loose = validate(
        GuardConfig, {"loud_ratio": {"alarm": 3.0, "abort": 1e6, "hold_s": 0.1}, "command_lost_s": 9.0}, "rig.toml"
    )
    assert wider(loose) == "loud_ratio.abort = 1e+06 (default 4), command_lost_s = 9 (default 0.75)"
