"""An expectation that can never fail, or never be judged, is refused with place, value, rule and remedy."""

from typing import Any

import pytest

from bridge.config import validate
from bridge.faults import Fault
from bridge.wire.words import words
from cockpit.expect.tables import STATES, ExpectTable, MutantTable


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"signal": "amplitude_nm", "at_most": 1.0}, "signal = amplitude_nm: no such signal; perhaps amplitude_m"),
        (
            {"signal": "amplitude_m", "at_most": "80 N"},
            "limit '80 N' of amplitude_m: must be a number, or a text in a unit",
        ),
        ({"signal": "velocity_ratio", "at_most": "2 m"}, "must be a number, as it has no unit"),
        ({"signal": "amplitude_m", "within": [2e-8, 1e-8]}, "limits 2e-08 to 1e-08: the lower must come first"),
        ({"signal": "amplitude_m", "at_most": -1e-8}, "limit -1e-08: amplitude_m is never below 0; change its sign"),
        ({"signal": "amplitude_m", "at_least": "-20 nm"}, "is never below 0; change its sign"),
        ({"signal": "amplitude_m", "at_least": 0.0}, "so it cannot fail; raise it"),
        ({"signal": "amplitude_m", "at_most": float("nan")}, "finite number"),
        ({"signal": "amplitude_m"}, "must have within, or at_least or at_most; give a limit"),
        ({"signal": "amplitude_m", "at_most": 1.0, "slips": 0}, "signal and slips given: must be one of"),
        ({"from_s": 1.0}, "nothing to judge given"),
        ({"slips": 0, "from_s": 2.0, "to_s": 1.0}, "to_s = 1: must be after from_s = 2; exchange them"),
        ({"slips": [3, 1]}, "slips = [3, 1]: must be the fewest, then the most"),
        ({"slips": 0, "never": True}, "never: has no meaning for slips"),
        ({"event": "FROZN", "within_s": 1.0}, "event = FROZN: no such event; perhaps FROZEN"),
        ({"event": "FROZEN"}, "must have either within_s or never = true"),
        ({"state": "guard"}, "is_in: missing"),
        (
            {"state": "guard", "is_in": [row.word for row in words() if row.column == STATES["guard"].column]},
            "is_in: names every word of guard, so it cannot fail",
        ),
        ({"state": "guard", "is_in": "ARMD"}, "is_in = ARMD: no such word; perhaps ARMED"),
        ({"signal": "amplitude_m", "at_most": 1.0, "until_s": 1.0, "never": True}, "has no meaning with never"),
        ({"sginal": "amplitude_m", "at_most": 1.0}, "unknown key; perhaps signal"),
    ],
)
def test_a_table_that_cannot_be_judged_is_refused(table: dict[str, Any], line: str) -> None:
    with pytest.raises(Fault) as refused:
        validate(ExpectTable, table, "mine.toml")
    assert line in refused.value.line
    assert refused.value.line.startswith("mine.toml: ")


def test_limits_have_the_unit_of_the_signal() -> None:
    table = validate(ExpectTable, {"signal": "amplitude_m", "within": ["20 nm", 8e-8]}, "mine.toml")
    assert table.limits == pytest.approx((2e-8, 8e-8))
    round_trip = validate(ExpectTable, {"signal": "round_trip_ns", "at_most": "1 ms"}, "mine.toml")
    assert round_trip.limits.high == pytest.approx(1e6)
    force = validate(ExpectTable, {"signal": "mass_accel_mps2", "at_most": "20 m/s²"}, "mine.toml")
    assert force.limits.high == pytest.approx(20.0)


def test_a_mutant_changes_something() -> None:
    with pytest.raises(Fault, match="changes nothing"):
        validate(MutantTable, {"about": "nothing"}, "mine.toml")
