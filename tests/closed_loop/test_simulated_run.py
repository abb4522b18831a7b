"""A run in simulated time: the loops of the processes as they are, and the same bits as a run in one process."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.faults.truth import TruthRun
from bridge.log.logfile import STREAMING, RunData, read_run
from bridge.rig.faults.table import FaultTable
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.clock import time
from cockpit.run.in_process import TimedAction, run_onboard
from cockpit.run.scenario import Scenario, load_scenario
from cockpit.run.simulated.run import SimulatedRun, run_with_faults
from controller.replay import Change, replay


def scenario(seconds: float, *tables: dict[str, Any]) -> Scenario:
    made = load_scenario("from-the-start", [f"duration_s={seconds}"])
    return made.model_copy(update={"fault": [FaultTable(**table) for table in tables]})


def logged(run: Scenario, path: Path) -> RunData:
    run_with_faults(run, path, {})
    return read_run(path)


def codes(run: RunData) -> list[str]:
    return [event.code for event in run.events]


def test_until_a_fault_begins_it_is_the_run_without_one(tmp_path: Path) -> None:
    late = logged(scenario(0.6, {"kind": "off", "target": "sensors", "from_s": 9.0}), tmp_path / "late.mcap")
    run_onboard(scenario(0.6), tmp_path / "none.mcap", {})
    none = read_run(tmp_path / "none.mcap")
    for name in STREAMING:
        ours, theirs = getattr(late, name), getattr(none, name)
        assert ours[: len(theirs)].tobytes() == theirs.tobytes(), name


def test_a_run_with_faults_reports_them_and_replays_bit_for_bit(tmp_path: Path) -> None:
    tables = (
        {"kind": "scaled", "target": "base_accel_mps2", "value": 0.7, "from_s": 0.3, "for_s": 0.2, "name": "weak"},
        {"kind": "dropped", "target": "blocks", "value": 0.2, "from_s": 0.4, "for_s": 0.1},
        {"kind": "cut", "target": "blocks", "from_s": 0.6, "for_s": 0.1},
    )
    run = logged(scenario(1.0, *tables), tmp_path / "run.mcap")
    again = logged(scenario(1.0, *tables), tmp_path / "again.mcap")
    assert run.checksums.sha256 == again.checksums.sha256
    injected = [event.text for event in run.events if event.code == "INJECTED"]
    assert injected[0] == "weak: base_accel_mps2 scaled 0.7 for 0.2 s"
    assert codes(run).count("INJECTION_ENDED") == 3
    assert {"STALE", "FRESH"} <= set(codes(run))
    assert replay(run, [Change(0, scenario(1.0).controller)]).identical


def test_a_rig_without_its_controller_stops_the_vibration_and_reports_it(tmp_path: Path) -> None:
    run = logged(scenario(1.4, {"kind": "killed", "target": "controller", "from_s": 0.5}), tmp_path / "run.mcap")
    at_rest = run.applied["t_ns"][run.applied["amplitude_m"] > 0.0][-1] * 1e-9
    assert 0.5 < at_rest < 0.7
    assert "FALLBACK" in codes(run)
    assert run.applied["guard_state"][-1] == wire.DISARMED
    assert [event.source for event in run.events if event.code == "END"] == ["plant"]


def test_a_frozen_controller_is_reported_and_nothing_arms_by_itself(tmp_path: Path) -> None:
    run = logged(
        scenario(2.2, {"kind": "frozen", "target": "controller", "from_s": 0.5, "for_s": 1.0}), tmp_path / "run.mcap"
    )
    assert {"FALLBACK", "PAUSED", "FRESH"} <= set(codes(run))
    assert not run.applied["amplitude_m"][run.applied["t_ns"] > 0.8e9].any()


def test_an_operator_arms_the_rig_and_the_log_holds_its_true_state() -> None:
    disarmed = scenario(2.2).model_copy(update={"arm": False})
    run = TruthRun(disarmed)
    run.command([TimedAction(20_000_000, wire.Operator.ARM)])
    run.play()
    truth = run.truth
    assert len(truth.t_s) >= 2200
    np.testing.assert_allclose(truth.drive_mps[10:], 5e-4, rtol=1e-6)
    assert not truth.vibration_mps[truth.t_s < 0.5].any()
    assert truth.vibration_mps[(truth.t_s > 2.0) & (truth.t_s < 2.2)] == pytest.approx(6e-4, rel=0.05)


def test_the_machines_clock_is_back_after_a_run() -> None:
    SimulatedRun(scenario(0.01)).play()
    before = time.monotonic()
    time.sleep(0.01)
    assert 0.009 < time.monotonic() - before < 5.0
