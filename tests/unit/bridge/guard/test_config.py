"""A table [guard] that makes no sense is refused, with the place, the value and the rule."""

from typing import Any

import pytest

from bridge.config import validate
from bridge.faults import Fault
from bridge.guard.config import ExciterConfig, GuardConfig, Level
from bridge.guard.records import ExciterLimits, build
from bridge.guard.wide import wider
from tests.unit.bridge.guard.rigs import EXCITER, real


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"stroke_m": {"alarm": 2e-7, "abort": 1e-7}}, "abort = 1e-07: must not be below alarm = 2e-07"),
        ({"forbidden_Hz": [[3000.0, 2000.0]]}, "forbidden_Hz.0: [3000, 2000]: the second must be above the first"),
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


def test_limits_that_protect_less_than_usual_are_named() -> None:
    assert wider(GuardConfig(), EXCITER, 5e-4) == ""
    tighter = {"loud_ratio": {"alarm": 2.0, "abort": 3.0, "hold_s": 0.05}, "heat": {"rise_max_K": 20.0}}
    assert wider(validate(GuardConfig, tighter, "rig.toml"), EXCITER, 5e-4) == ""
    loose = validate(
        GuardConfig, {"loud_ratio": {"alarm": 3.0, "abort": 1e6, "hold_s": 0.1}, "command_lost_s": 9.0}, "rig.toml"
    )
    assert wider(loose, EXCITER, 5e-4) == "loud_ratio.abort = 1e+06 (at most 4), command_lost_s = 9 (at most 0.75)"


@pytest.mark.parametrize(
    ("table", "exciter", "fastest_mps", "key"),
    [
        ({"stroke_m": {"alarm": 1.0, "abort": 1.0}}, {}, 5e-4, "stroke_m.alarm = 1 (at most 1e-07)"),
        ({"velocity_mps": {"alarm": 100.0, "abort": 100.0}}, {}, 5e-4, "velocity_mps.alarm = 100 (at most 0.0015)"),
        ({"heat": {"resistance_K_per_W": 1e-9}}, {}, 5e-4, "heat.resistance_K_per_W = 1e-09 (at least 1)"),
        ({"heat": {"rise_max_K": 1e4}}, {}, 5e-4, "heat.rise_max_K = 10000 (at most 600)"),
        ({"check_share": 1.0}, {}, 5e-4, "check_share = 1 (at most 0.1)"),
        ({"exciter_gain": 0.01}, {}, 5e-4, "exciter_gain = 0.01 (at least 0.05)"),
        ({}, {}, 20.0, "fastest_drive_mps = 20 (at most 1)"),
        ({}, {"stroke_m": 1e-3}, 5e-4, "piezo.amplitude_max_m = 0.001 (at most 2e-06)"),
        ({}, {"slew_m_per_s": 0.0}, 5e-4, "piezo.amplitude_slew_m_per_s = inf (at most 2e-05)"),
        ({}, {"command_timeout_s": 5.0}, 5e-4, "piezo.command_timeout_s = 5 (at most 1)"),
    ],
)
def test_an_absurd_limit_is_named(table: dict[str, Any], exciter: dict[str, Any], fastest_mps: float, key: str) -> None:
    assert key in wider(validate(GuardConfig, table, "rig.toml"), EXCITER._replace(**exciter), fastest_mps)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {"forbidden_Hz": [[2900.0, 3100.0]], "check_Hz": [3000.0]},
            "check_Hz = 3000: must be outside of guard.forbidden_Hz",
        ),
        ({"check_Hz": [9000.0]}, "check_Hz = 9000: must be within the exciter's range, 500 to 5000 Hz"),
        ({"forbidden_Hz": [[500.0, 5000.0]]}, "no tone is left for the loop check"),
    ],
)
def test_a_check_without_an_allowed_tone_is_refused(table: dict[str, Any], message: str) -> None:
    with pytest.raises(Fault, match=message):
        build(real(validate(GuardConfig, table, "rig.toml")), EXCITER, 1)


@pytest.mark.parametrize("missing", ["fastest_drive_mps", "velocity_mps"])
def test_a_real_rig_must_give_its_absolute_limits(missing: str) -> None:
    with pytest.raises(Fault, match="must be given for a real rig"):
        build(real(GuardConfig()).model_copy(update={missing: None}), EXCITER, 1)


def test_the_exciter_of_a_rig_file_gives_the_limits_of_guard_and_header() -> None:
    exciter = ExciterConfig(amplitude_max_m=2e-7, frequency_max_Hz=4000.0, amplitude_slew_m_per_s=0.0)
    assert ExciterLimits.of(exciter, 1e-3, 20) == ExciterLimits(2e-7, 500.0, 4000.0, 0.0, 1e-3, 20, 0.05)
    bare = GuardConfig(forbidden_Hz=[(900.0, 950.0)]).vibration_limits(exciter)
    assert bare == (2e-7, None, None, 500.0, 4000.0, [(900.0, 950.0)])
    level = Level(alarm=1e-8, abort=2e-8)
    tight = GuardConfig(stroke_m=level, velocity_mps=level).vibration_limits(exciter)
    assert (tight.amplitude_max_m, tight.velocity_max_mps) == (1e-8, 1e-8)
