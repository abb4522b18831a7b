"""PASSED needs evidence; a missing sample, a damaged log or an absent controller is UNTESTED, a broken limit FAILED."""

from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from bridge.log.logfile import RunData
from bridge.wire import stickslip_pb2 as wire
from cockpit.expect.judge import FAILED, PASSED, UNTESTED, Expected, judge
from cockpit.expect.record import Record
from cockpit.expect.tables import ExpectTable

STEADY = {"from_s": 0.5}
AMPLITUDE = {"signal": "amplitude_m", "within": ["15 nm", "30 nm"]} | STEADY
RATIO = {"signal": "velocity_ratio", "within": [1.1, 1.3]} | STEADY


def of(run: RunData, **table: Any) -> Expected:
    return judge(Record(run), [validate(ExpectTable, table, "mine.toml")])[0]


def changed(run: RunData, topic: str, **columns: Any) -> RunData:
    table = getattr(run, topic).copy()
    for name, change in columns.items():
        change(table[name])
    return run._replace(**{topic: table})


@pytest.mark.parametrize(
    ("table", "result"),
    [
        (AMPLITUDE, PASSED),
        (AMPLITUDE | {"within": ["15 nm", "20 nm"]}, FAILED),
        (AMPLITUDE | {"never": True}, FAILED),
        ({"signal": "amplitude_m", "within": ["40 nm", "50 nm"], "never": True}, PASSED),
        ({"signal": "amplitude_m", "at_least": "15 nm", "until_s": 0.5}, PASSED),
        ({"signal": "amplitude_m", "at_least": "15 nm", "until_s": 0.01}, FAILED),
        (RATIO, PASSED),
        (RATIO | {"from_s": 0.0}, FAILED),
        ({"slips": 0}, PASSED),
        ({"slips": [1, 9]}, FAILED),
        ({"surges": 0}, PASSED),
        ({"event": "VIBRATION_BEGAN", "within_s": 0.1}, PASSED),
        ({"event": ["FROZEN", "BLIND"], "within_s": 0.1}, FAILED),
        ({"event": "VIBRATION_BEGAN", "never": True}, FAILED),
        ({"event": "VIBRATION_BEGAN", "never": True, "from_s": 0.1}, PASSED),
        ({"event": "VIBRATION_BEGAN", "within_s": 0.1, "from_s": 1.0}, FAILED),
        ({"state": "guard", "is_in": "ACTIVE"} | STEADY, PASSED),
        ({"state": "guard", "is_in": "ACTIVE"}, FAILED),
        ({"state": "guard", "is_in": "FAULT", "never": True}, PASSED),
        ({"state": "guard", "is_in": "FAULT", "until_s": 1.0}, FAILED),
        ({"signal": "time_to_slip_s", "at_least": 0.1}, UNTESTED),  # no slip is ahead: each sample is unknown
        ({"signal": "amplitude_m", "at_most": "5 mm"}, UNTESTED),  # more than the stroke: it cannot fail
        ({"signal": "drive_force_N", "within": [-500.0, 500.0]}, UNTESTED),
        ({"signal": "drive_force_N", "at_least": 500.0, "never": True}, UNTESTED),  # the sensor ends before
        (AMPLITUDE | {"to_s": 2.5}, UNTESTED),  # after the end of the log
        ({"event": "FROZEN", "within_s": 1.0, "from_s": 1.5}, UNTESTED),
        ({"event": "FROZEN", "never": True, "from_s": 5.0, "to_s": 6.0}, UNTESTED),
    ],
)
def test_a_healthy_run(run: RunData, table: dict[str, Any], result: str) -> None:
    assert of(run, **table).result == result


def test_a_failure_has_value_limit_and_time(run: RunData) -> None:
    low = changed(run, "applied", amplitude_m=lambda column: column.__setitem__(1499, 5e-9))
    result = of(low, **AMPLITUDE)
    assert (result.result, result.value, result.limit) == (FAILED, pytest.approx(5e-9), "15 to 30 nm")
    assert result.at_s == pytest.approx(1.5)
    assert "1 of 1500 samples, the first at 1.5000 s" in result.why


def test_a_missing_event_names_those_that_the_window_holds(run: RunData) -> None:
    result = of(run, event="FROZEN", within_s=0.5)
    assert result.why.startswith("no FROZEN, only ")
    assert "VIBRATION_BEGAN" in result.why


@pytest.mark.parametrize("table", [AMPLITUDE, RATIO, {"slips": 0}, {"surges": 0}, {"event": "FROZEN", "never": True}])
def test_a_log_cut_short_passes_nothing(run: RunData, table: dict[str, Any]) -> None:
    parts = {name: getattr(run, name) for name in ("sensors", "applied", "command", "trace", "state")}
    short = run._replace(**{name: part[: len(part) * 3 // 4] for name, part in parts.items()})
    assert of(short, **table).result == UNTESTED
    cut = run._replace(damage=run.damage._replace(closed=False))
    assert of(cut, **table).result == UNTESTED
    gap = run._replace(
        **{name: np.delete(part, slice(len(part) // 2, len(part) // 2 + 60)) for name, part in parts.items()}
    )
    assert of(gap, **table).result == UNTESTED


@pytest.mark.parametrize("table", [AMPLITUDE, RATIO, {"slips": 0}, {"surges": 0}, {"event": "FROZEN", "never": True}])
def test_without_a_controller_in_charge_nothing_passes(run: RunData, table: dict[str, Any]) -> None:
    def never(column: Any) -> None:
        column[:] = wire.DISARMED

    alone = changed(run, "applied", guard_state=never)
    assert of(alone, **table).result == UNTESTED
    assert of(alone, **table, in_charge=False).result == PASSED


def test_a_window_before_control_passes_nothing(run: RunData) -> None:
    late = changed(run, "applied", guard_state=lambda column: column.__setitem__(slice(0, 1000), wire.DISARMED))
    early = {"signal": "amplitude_m", "at_most": "28 nm", "to_s": 0.9}
    assert "no controller was in charge until 0.9 s; controller.policy.enabled_from_s" in of(late, **early).why
    assert of(late, **early | {"to_s": 1.2}).result == PASSED
    never = changed(run, "applied", guard_state=lambda column: column.__setitem__(slice(None), wire.DISARMED))
    assert "arm the rig: arm = true in the scenario" in of(never, **early).why


def test_half_a_window_without_a_controller_is_no_proof_of_its_effect(run: RunData) -> None:
    half = changed(run, "applied", fallback=lambda column: column.__setitem__(slice(1000, None), 1))
    assert of(half, slips=0).result == UNTESTED
    assert of(half, slips=0, to_s=0.9).result == PASSED
    assert of(half, **AMPLITUDE).result == PASSED  # a limit of the rig needs no controller


def test_nan_never_passes(run: RunData) -> None:
    lost = changed(run, "trace", drive_velocity_mps=lambda column: column.__setitem__(1000, np.nan))
    speed = {"signal": "drive_velocity_mps", "within": ["0.3 mm/s", "0.7 mm/s"]} | STEADY
    assert of(run, **speed).result == PASSED
    assert of(lost, **speed).result == UNTESTED
    assert of(lost, **speed | {"within": ["0.6 mm/s", "0.7 mm/s"]}).result == FAILED


@pytest.mark.parametrize(
    ("topic", "table"),
    [
        ("applied", AMPLITUDE),
        ("state", RATIO),
        ("trace", {"surges": 0}),
        ("applied", {"event": "FROZEN", "never": True, "in_charge": False}),
    ],
)
def test_an_absent_signal_is_untested(run: RunData, topic: str, table: dict[str, Any]) -> None:
    absent = run._replace(**{topic: getattr(run, topic)[:0]})
    assert of(absent, **table).result == UNTESTED


def test_each_rise_of_the_count_is_a_surge(run: RunData) -> None:
    def rises(column: Any) -> None:
        column[500:] = 2
        column[1500:] = 3

    surging = changed(run, "trace", surges=rises)
    assert of(surging, surges=0).result == FAILED
    assert of(surging, surges=3).result == PASSED
    assert of(surging, surges=1, from_s=1.0).result == PASSED
