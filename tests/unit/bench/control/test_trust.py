"""`python -m bench trust`: its figures, and the axes and disturbances behind them."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from typer.testing import CliRunner

from bench.app import app
from bench.control.rules import NONE
from bench.control.run import Subject, judge, wrong_from
from bench.control.trust.disturbed import disturbances
from bench.control.trust.never import never_axes
from bench.control.trust.reports import Reports
from bench.control.trust.trials import long_axes
from bench.schemas import FORMATS
from bridge.faults import FAULTS
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import APPLIED, TRACE
from cockpit.run.closed_loop import Stretch
from cockpit.run.sensor_needs import refuse_out_of_travel


@pytest.mark.slow
def test_trust_groups_runs_by_subject_and_k_d(tmp_path: Path) -> None:
    table = tmp_path / "trust.json"
    words = ["trust", "--seed", "2", "--only", "drawn", "--axes", "3", "--jobs", "1", "--json", str(table)]
    assert CliRunner().invoke(app, words).exit_code == 0
    result = json.loads(table.read_text())
    jsonschema.validate(result, FORMATS["bench-trust-result"].schema(), jsonschema.Draft202012Validator)
    groups = {group["group"]: group for group in result["groups"]}
    assert {name: group["runs"] for name, group in groups.items()} == {
        "controller, with k_d": 2,
        "controller, without k_d": 1,
        "1.2 v_d whenever it moves, with k_d": 2,
        "1.2 v_d whenever it moves, without k_d": 1,
    }
    for group in groups.values():
        assert group["figures"].keys() == {"wrong", "above_2_v_d_share", "energy_ratio"}
    rule = groups["1.2 v_d whenever it moves, with k_d"]["figures"]["energy_ratio"]
    assert rule["median"] == pytest.approx(1.44, rel=0.05)


def test_an_unknown_part_is_refused() -> None:
    result = CliRunner().invoke(app, ["trust", "--only", "drwan"])
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert "--only drwan: no such part; parts: drawn, never" in result.stderr


@pytest.mark.slow
def test_axes_that_never_stick_move_smoothly_without_vibration() -> None:
    axes = never_axes(3, 4, 20.0)
    assert [axis.name for axis in axes] == [
        *("never-01-no-drop", "never-02-fast", "never-03-damped", "never-04-moves"),
        *("ptfe-moves-1.5-s", "oiled-10-mm-per-s"),
    ]
    for axis in axes:
        judged = judge(axis, Subject(NONE))
        assert not wrong_from(judged.events, 10.0).any(), axis.name
        assert np.abs(judged.coarse.rows[:, 2]).max() == pytest.approx(max(axis.rig.drive.speeds_mps()), rel=0.05)


@pytest.mark.slow
def test_trials_are_counted_on_axes_whose_sensors_reach_the_end_of_the_run() -> None:
    for axis in long_axes(2, 4, 600.0):
        refuse_out_of_travel(axis.rig, axis.duration_s)
    result = CliRunner().invoke(app, ["trust", "--only", "trials", "--trials", "1", "--trials-s", "20", "--jobs", "1"])
    assert result.exit_code == 0
    assert "in_trials_per_600_s" in result.stdout
    assert result.stdout.splitlines()[-1].startswith("axis-01")
    assert "slips and surges in 0 trials" in result.stdout


def test_disturbances_hold_lengths_and_patterns() -> None:
    entries = {entry.name: entry for entry in disturbances()}
    assert len(entries) == 29
    gaps = entries["gap-67-ms-each-1-s"].scenario.fault
    assert {(fault.kind, fault.target, fault.for_s) for fault in gaps} == {("cut", "commands", 0.067)}
    np.testing.assert_allclose(np.diff([fault.from_s for fault in gaps]), 1.0)


def test_reports_hold_failures_and_limits_and_no_change_of_state() -> None:
    applied, trace = APPLIED.blank(4), TRACE.blank(4)
    applied["guard_state"] = [wire.ARMED, wire.ARMED, wire.ACTIVE, wire.ACTIVE]
    trace["reason"] = [wire.NOTHING_TO_DO, wire.STICK_SEEN, wire.CANNOT_HELP, wire.HELD]
    empty = np.empty(0)
    made = Stretch(empty, applied, empty, trace, empty, empty, empty, empty, empty)
    reports = Reports()
    reports(made)
    assert reports.codes == {"CANNOT_HELP"}
