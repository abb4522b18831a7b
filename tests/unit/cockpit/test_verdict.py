"""The verdict on a run: counted, left out and untested parts."""

import json
from pathlib import Path

import numpy as np
import pytest

from bridge.log.logfile import read_run
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge.verdict import NOT_OK
from cockpit.judge.verdict_words import headline, in_words
from cockpit.run.in_process import run_onboard
from cockpit.run.replay import outcome
from cockpit.run.scenario import load_scenario
from tests.logs import doctored, short_log, verdict_of

STIFF = "rig.drive.stiffness_N_per_m=1e5"  # the slide breaks away within 0.4 s, on the paper's spring after 3 s


def test_a_log_that_begins_late_counts_from_its_first_block(tmp_path: Path) -> None:
    def begin_late(tables):
        for name, table in tables.items():
            tables[name] = table[table["t_ns"] > 150_000_000]

    run = read_run(doctored(tmp_path, begin_late))
    verdict = verdict_of(run)
    assert verdict.before is not None
    assert verdict.before.seconds == pytest.approx(0.25)
    assert any("per minute of this phase)" in line for line in in_words(verdict, verbose=False))
    assert (verdict.lost_blocks, verdict.lost_messages) == (0, 0)


def test_a_run_that_begins_stopped_names_the_reset(tmp_path: Path) -> None:
    def stopped(tables):
        tables["applied"]["guard_state"], tables["applied"]["cause"] = wire.FAULT, wire.STOP_KEPT
        tables["trace"]["mode"], tables["trace"]["reason"] = wire.DISABLED, wire.NOT_ARMED

    reason = verdict_of(read_run(doctored(tmp_path, stopped))).reason
    assert (
        reason
        == "the rig was never armed, in FAULT by STOP_KEPT: `stickslip reset` when it is safe, then `stickslip arm`"
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_force_of_nan_is_counted_and_left_out(tmp_path: Path, value: float) -> None:
    def spoil(tables):
        tables["sensors"]["drive_force_N"][[100, 250], 3] = value
        tables["trace"]["drive_force_N"][[100, 250]] = value

    (tmp_path / "sound.mcap").write_bytes(short_log())
    sound, spoilt = read_run(tmp_path / "sound.mcap"), read_run(doctored(tmp_path, spoil))
    before, was = verdict_of(spoilt).before, verdict_of(sound).before
    assert before is not None
    assert was is not None
    assert before.slips == was.slips
    assert before.swing_N == pytest.approx(was.swing_N, rel=0.02)
    assert before.mean_force_N == pytest.approx(was.mean_force_N, rel=0.02)
    assert verdict_of(spoilt).faults == [
        "NOT_FINITE: /sensors drive_force_N: 2 samples are no finite number, first after 0.100 s of samples; left out"
    ]
    assert outcome(spoilt).drive_work_J == pytest.approx(outcome(sound).drive_work_J, rel=0.02)


def test_unmeasured_blocks_give_no_velocity_ratio(tmp_path: Path) -> None:
    def spoil(tables):
        trace = tables["trace"]
        trace["mode"], trace["drive_velocity_mps"], trace["vibration_velocity_mps"] = wire.EXCITE, 5e-4, 6e-4
        trace["limit"] = wire.NO_LIMIT
        tables["sensors"]["base_accel_mps2"][250:300, 3] = np.nan
        trace["limit"][250:300] = wire.NOT_FINITE
        trace["vibration_velocity_mps"][300:] = 4e-4

    run = read_run(doctored(tmp_path, spoil))
    from_the_start = json.dumps({"block_s": 0.001, "policy": {"enabled_from_s": 0.0}})
    verdict = verdict_of(run._replace(headers=run.headers | {"controller": {"configuration": from_the_start}}))
    assert verdict.faults == [
        "NOT_FINITE: /sensors base_accel_mps2: 50 samples are no finite number, first after 0.250 s of samples; left out"
    ]
    assert (verdict.velocity_ratio_min, verdict.velocity_ratio_max) == (pytest.approx(1.2), pytest.approx(1.2))


@pytest.mark.slow
def test_a_slip_of_a_heavy_slide_is_slow_and_counts(tmp_path: Path) -> None:
    log = tmp_path / "heavy.mcap"
    settings = ["duration_s=12.0", "rig.slide.mass_kg=60.0", "controller.policy.enabled_from_s=100.0"]
    run_onboard(load_scenario("paper-c45-c45", settings), log, {})
    before = verdict_of(read_run(log)).before
    assert before is not None
    assert before.slips >= 4
    assert before.swing_N > 3.0


@pytest.mark.parametrize("code", ["STALE", "DROPPED", "GAP"])
def test_a_stall_or_a_gap_in_the_log_is_a_warning_and_changes_no_status(tmp_path: Path, code: str) -> None:
    log = tmp_path / "run.mcap"
    run_onboard(load_scenario("from-the-start", ["duration_s=1.0", STIFF]), log, {})
    run = read_run(log)
    event = wire.Event(sequence=1, t_ns=5, source="controller", code=code, text="for 24 ms")
    verdict = verdict_of(run._replace(events=[*run.events, event]))
    assert (verdict.good, verdict.exit_status(strict=False)) == (True, 0)
    assert f"warning  {code}: for 24 ms" in in_words(verdict, verbose=True)


@pytest.mark.slow
def test_a_drive_beyond_the_end_of_its_transducer_is_not_ok(tmp_path: Path) -> None:
    """Here by a transducer that ends after 2 mm; 16 s at 0.5 mm/s are 8 mm."""
    log = tmp_path / "short-range.mcap"
    scenario = load_scenario("from-the-start", [])
    rig = scenario.rig.model_copy(
        update={"sensors": scenario.rig.sensors.model_copy(update={"position_range_m": 2e-3})}
    )
    run_onboard(scenario.model_copy(update={"rig": rig}), log, {})
    verdict = verdict_of(read_run(log))
    assert verdict.control == NOT_OK
    assert verdict.reason.startswith("DRIVE_DOUBTED: ")
    assert any(line.startswith("SENSOR_CLIPPED: drive_position_m") for line in verdict.blind)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (["rig.drive.profile=[[0.0, 0.0]]"], "the drive never moved: nothing was tested"),
        (
            [],
            "not judged: the slide followed its drive for 0 of 0.49 s with the controller in charge: make the run longer, or "
            "correct the stiffness of the drive",
        ),
        (["controller.policy.enabled_from_s=100.0"], "ended before the controller was enabled (at 100.0 s)"),
        (
            ["controller.policy.enabled_from_s=0.1"],
            "the controller was in charge for 0.4 s, too short to judge: it has 1 s to settle",
        ),
    ],
)
def test_the_headline_reports_that_nothing_was_tested(tmp_path: Path, settings: list[str], expected: str) -> None:
    log = tmp_path / "still.mcap"
    run_onboard(load_scenario("from-the-start", ["duration_s=0.5", *settings]), log, {})
    verdict = verdict_of(read_run(log))
    assert (headline(verdict), verdict.good) == (expected, False)


@pytest.mark.parametrize(
    ("topic", "rows", "expected"),
    [
        ("sensors", 0, "no block was recorded"),
        ("trace", 0, "no step of a controller was recorded: nothing was tested"),
        ("trace", 1, "the drive never moved: nothing was tested"),
    ],
)
def test_a_log_with_nothing_to_judge_is_not_good(tmp_path: Path, topic: str, rows: int, expected: str) -> None:
    log = tmp_path / "run.mcap"
    run_onboard(load_scenario("from-the-start", ["duration_s=0.5", STIFF]), log, {})
    run = read_run(log)
    assert verdict_of(run).good
    verdict = verdict_of(run._replace(**{topic: getattr(run, topic)[:rows]}))
    assert (headline(verdict), verdict.good) == (expected, False)
