"""The streaming judge: windows, stalls and gaps do not change the status; missing decisive data does."""

import json
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from typer.testing import CliRunner

from bridge.faults import FAULTS, Fault
from bridge.log.logfile import RunData, read_run
from bridge.results import strict_json
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import STALE
from cockpit.cli import app
from cockpit.judge import window
from cockpit.judge.judged import judge, judge_log
from cockpit.judge.verdict import NOT_JUDGED, NOT_OK, OK
from cockpit.judge.verdict_words import data_in_words, headline, in_words
from cockpit.run.closed_loop import ClosedLoop
from cockpit.run.in_process import run_onboard
from cockpit.run.run import run_scenario
from cockpit.run.scenario import load_scenario
from tests.logs import Tables, tables_of, verdict_of, write


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """6 s with one turn of the drive; the controller is in charge from 3 s on."""
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    profile = "rig.drive.profile=[[0.0, 0.001], [3.9, 0.001], [4.0, -0.001]]"
    settings = ["rig.sensors.force_lowest_N=-50.0", "duration_s=6.0", "controller.policy.enabled_from_s=3.0", profile]
    run_onboard(load_scenario("paper-c45-c45", settings), path, {})
    return path


@pytest.fixture(scope="module")
def run(log: Path) -> RunData:
    return read_run(log)


def figures(verdict: Any) -> dict[str, Any]:
    return {name: value for name, value in strict_json(verdict).items() if name not in {"log", "checksums"}}


def test_windows_change_no_figure(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = judge(log)
    assert whole.before is not None
    assert whole.before.slips >= 1
    monkeypatch.setattr(window, "WINDOW_BLOCKS", 1200)
    monkeypatch.setattr(window, "AHEAD_S", 1.5)
    monkeypatch.setattr(window, "BEHIND_S", 1.0)
    cut = judge(log)
    assert cut.before is not None
    assert cut.after is not None
    assert whole.after is not None
    for one, other in ((cut.before, whole.before), (cut.after, whole.after)):
        assert (one.slips, one.seconds) == (other.slips, other.seconds)
        assert one.vibration_dose_mm2_per_s == pytest.approx(other.vibration_dose_mm2_per_s)
        assert one.swing_N == pytest.approx(other.swing_N, rel=0.02)
        assert one.following is not None
        assert other.following is not None
        assert tuple(one.following) == pytest.approx(tuple(other.following), rel=0.02)
    assert (cut.velocity_ratio_min, cut.velocity_ratio_max) == (whole.velocity_ratio_min, whole.velocity_ratio_max)


def test_a_run_is_judged_while_it_is_written_as_its_log_is(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    came = run_scenario("belt-axis", ["duration_s=3.0", "controller.policy.enabled_from_s=1.0"], False, True, path)
    again = judge_log(path)
    assert figures(came.verdict) == figures(again.verdict)


def changed(run: RunData, path: Path, change: Any) -> Path:
    tables = tables_of(run)
    change(tables)
    write(path, tables, run, 200)
    return path


def test_dropouts_that_overlap_are_left_out_once(run: RunData, tmp_path: Path) -> None:
    """Seven fallbacks of 0.1 s, one every 0.2 s, each with its second to settle: they gave negative seconds."""

    def dropouts(tables: Tables) -> None:
        for k in range(7):
            tables["applied"]["fallback"][4100 + 200 * k : 4200 + 200 * k] = 1

    after = judge(changed(run, tmp_path / "dropouts.mcap", dropouts)).after
    assert after is not None
    # from 4 s to 4.1 s: the last fallback ends at 5.4 s, and its second after the end of the run
    assert after.seconds == pytest.approx(0.1, abs=2e-3)


def test_stretches_without_a_controller_are_one(run: RunData) -> None:
    applied = tables_of(run)["applied"]
    for first in (3200, 4700):
        applied["fallback"][first : first + 1200] = 1
    alone = verdict_of(run._replace(applied=applied)).alone
    assert alone is not None
    assert alone.seconds == pytest.approx(2.4, abs=2e-3)


def gap(first: int, count: int, seen: bool) -> Any:
    def change(tables: Tables) -> None:
        tables["sensors"] = np.delete(tables["sensors"], slice(first, first + count))
        if not seen:
            tables["trace"]["gap_blocks"][first + count] = count
            tables["trace"] = np.delete(tables["trace"], slice(first, first + count))
            tables["trace"]["sequence"] = np.arange(len(tables["trace"]))

    return change


@pytest.mark.parametrize(
    ("change", "control", "data"),
    [
        (gap(5000, 5, seen=True), OK, "5 of 6000 blocks missing in the log (the controller had them all)"),
        (gap(5000, 5, seen=False), OK, "5 of 6000 blocks missing in the log (the controller missed 5)"),
        (gap(5000, 40, seen=True), NOT_JUDGED, "40 of 6000 blocks missing in the log (the controller had them all)"),
        (gap(500, 40, seen=True), OK, "40 of 6000 blocks missing in the log (the controller had them all)"),
    ],
    ids=["log", "controller", "too-many", "before"],
)
@pytest.mark.slow
def test_missing_blocks_change_the_status_only_where_they_decide(
    run: RunData, tmp_path: Path, change: Any, control: str, data: str
) -> None:
    verdict = judge(changed(run, tmp_path / "gap.mcap", change))
    assert verdict.control == control
    assert data_in_words(verdict).startswith(data)
    assert verdict.exit_status(strict=False) == (0 if control == OK else FAULTS["NOT_JUDGED"].exit_status)
    assert control == NOT_JUDGED or verdict.exit_status(strict=True) == 1


def until(run: RunData, rows: int, text: str | None) -> RunData:
    """The first rows of a run of 6 s, and the rig's END with a text, or no event."""
    events = [] if text is None else [wire.Event(source="plant", code="END", text=text)]
    return run._replace(**{name: table[:rows] for name, table in tables_of(run).items()}, events=events)


def test_a_log_that_ends_early_without_a_reason_is_not_judged(run: RunData) -> None:
    """It read "data whole" and "control ok"."""
    verdict = verdict_of(until(run, 5000, None))
    assert data_in_words(verdict) == "5.00 of 6.00 s; the rest is not in the log"
    assert headline(verdict) == "not judged: the log ends at 5.00 s, the run was to end at 6.00 s"
    assert (verdict.exit_status(strict=False), verdict.exit_status(strict=True)) == (14, 1)
    assert verdict.losses() == ["the number of lost messages is unknown"]
    short = headline(verdict_of(until(run, 2000, None)))
    ends = "the log ends at 2.00 s, the run was to end at 6.00 s"
    assert short == f"{ends}; ended before the controller was enabled (at 3.0 s)"


def test_who_had_the_blocks_after_the_end_of_a_log_is_not_known(run: RunData) -> None:
    """It read "the controller had them all"."""
    verdict = verdict_of(until(run, 5000, "blocks=6000"))
    assert (
        data_in_words(verdict) == "1000 of 6000 blocks missing in the log (not known whether the controller had them)"
    )


def test_the_headline_of_a_run_that_is_not_ok_begins_with_the_status(run: RunData) -> None:
    """It read "stick-slip is gone: ...; PIEZO_WEAK"."""
    sound = verdict_of(run)
    weak = sound._replace(charge=sound.charge._replace(reasons_s={"PIEZO_WEAK": 2.0}))
    assert (headline(sound).partition(":")[0], headline(weak)) == ("stick-slip is gone", "not ok: PIEZO_WEAK")


@pytest.mark.parametrize("severity", ["S", "out of specification"])
def test_a_trip_is_in_words_without_the_severity_of_its_cause(run: RunData, severity: str) -> None:
    text = f"ACTIVE -> FAULT: OVERTRAVEL: {severity}: stroke beyond guard.stroke_m"
    verdict = verdict_of(run._replace(events=[wire.Event(source="plant", code="FAULT", text=text), *run.events]))
    assert headline(verdict).endswith(
        "stopped the vibration: ACTIVE -> FAULT: OVERTRAVEL: stroke beyond guard.stroke_m"
    )
    assert f": {severity}:" not in "".join(in_words(verdict, verbose=True))


def test_the_first_bytes_of_a_log_are_a_cut_log(log: Path, tmp_path: Path) -> None:
    """It read "holds no configuration of the controller; it was not there when it was recorded"."""
    path = tmp_path / "cut.mcap"
    path.write_bytes(log.read_bytes()[:200])
    with pytest.raises(Fault, match="is cut after 200 bytes, before the configuration of the controller"):
        judge(path)


def test_a_channel_that_is_in_no_block_is_named(log: Path, tmp_path: Path) -> None:
    """It read "no block was recorded"."""
    path = tmp_path / "without.mcap"
    with log.open("rb") as old, path.open("wb") as new:
        reader, writer = make_reader(old), Writer(new)
        writer.start(library="another program")
        for table in reader.iter_metadata():
            writer.add_metadata(table.name, table.metadata)
        for schema, channel, message in islice(reader.iter_messages("/sensors"), 3):
            assert schema is not None
            block = wire.SensorBlock.FromString(message.data)
            block.ClearField("mass_position_m")
            number = writer.register_channel(
                channel.topic, "protobuf", writer.register_schema(schema.name, schema.encoding, schema.data)
            )
            writer.add_message(number, message.log_time, block.SerializeToString(), message.publish_time)
        writer.finish()
    rule = "no block can be read: /sensors: mass_position_m has 0 samples: must have 20; every block must have all channels"
    assert headline(judge(path)) == rule


def test_a_run_that_an_operator_ended_is_whole(run: RunData) -> None:
    verdict = verdict_of(until(run, 5000, "blocks=5000"))
    assert (verdict.control, data_in_words(verdict)) == (OK, "whole: 5000 blocks")
    assert verdict_of(run._replace(events=[])).control == OK  # to its planned end


@pytest.mark.parametrize("name", ["applied", "command", "trace"])
def test_a_topic_without_a_message_is_a_loss(run: RunData, name: str) -> None:
    verdict = verdict_of(run._replace(**{name: getattr(run, name)[:0]}))
    assert verdict.losses() == [f"no message of /{name} in the log"]
    assert (verdict.exit_status(strict=False), verdict.exit_status(strict=True)) == (14, 1)


def slip(run: RunData, tables: Tables, block: int) -> None:
    """The slide jumps ahead of its drive, which goes back, and the force along it falls by 3 N."""
    stiffness_N_per_m = run.configuration("plant")["rig"]["drive"]["stiffness_N_per_m"]
    tables["sensors"]["drive_force_N"][block:] += np.float32(3.0)
    tables["trace"]["drive_force_N"][block:] += np.float32(3.0)
    tables["sensors"]["mass_position_m"][block:] -= np.float32(3.0 / stiffness_N_per_m)


@pytest.mark.slow
def test_a_slip_with_missing_blocks_in_it_may_be_none(run: RunData, tmp_path: Path) -> None:
    def fall(tables: Tables) -> None:
        slip(run, tables, 5000)

    sure = judge(changed(run, tmp_path / "sure.mcap", fall))
    assert sure.control == NOT_OK, sure.reason
    assert sure.after is not None
    assert sure.after.slips == 1

    def both(tables: Tables) -> None:
        fall(tables)
        gap(4999, 3, seen=True)(tables)

    unsure = judge(changed(run, tmp_path / "unsure.mcap", both))
    assert (unsure.control, unsure.unsure_slips) == (NOT_JUDGED, 1)
    assert "blocks are missing within 1 slip" in headline(unsure)


@pytest.mark.parametrize(
    ("table", "field", "value"), [("applied", "fallback", 1), ("trace", "events", STALE)], ids=["rig", "controller"]
)
@pytest.mark.slow
def test_a_slip_in_a_stall_is_counted_apart(run: RunData, tmp_path: Path, table: str, field: str, value: int) -> None:
    """Of the rig, which ramped to zero without a fresh command, and of the controller, which did without a fresh block."""

    def stalled(tables: Tables) -> None:
        slip(run, tables, 4500)
        tables[table][field][4300:4700] |= value

    verdict = judge(changed(run, tmp_path / "stalled.mcap", stalled))
    assert verdict.after is not None
    assert (verdict.after.slips, verdict.stalled_slips, verdict.control) == (0, 1, NOT_JUDGED)
    assert "between two slips before" in verdict.reason  # the stall and its second leave 0.6 s


def test_a_rig_that_disarmed_itself_is_not_judged_and_named(run: RunData) -> None:
    """The line read "stopped by an operator, or not armed", and control was ok."""
    tables = tables_of(run)
    assert verdict_of(run).control == OK
    tables["applied"]["guard_state"][5500:] = wire.DISARMED
    tables["applied"]["cause"][5500:] = wire.COMMAND_LOST
    tables["trace"]["reason"][5500:] = wire.NOT_ARMED
    verdict = verdict_of(run._replace(applied=tables["applied"], trace=tables["trace"]))
    assert (verdict.control, verdict.exit_status(strict=False)) == (NOT_JUDGED, 14)
    assert "the rig disarmed itself at 5.50 s, as no fresh command reached it" in headline(verdict)


@pytest.mark.parametrize(("stopped_s", "control"), [(0.3, OK), (1.0, NOT_JUDGED)])
def test_a_run_that_was_stopped_for_a_tenth_of_the_time_asked_is_not_judged(
    run: RunData, stopped_s: float, control: str
) -> None:
    """A run that was disarmed for most of its time, with six slips, was good."""
    blocks = round(1e3 * stopped_s)
    trace = tables_of(run)["trace"]
    trace["reason"][-blocks:] = wire.NOT_ARMED
    verdict = verdict_of(run._replace(trace=trace))
    assert verdict.control == control, verdict.reason
    assert ("the rig not armed, for 1.00 of" in verdict.reason) == (control == NOT_JUDGED)
    applied = tables_of(run)["applied"]
    applied["guard_state"][-blocks:] = wire.CHECKING
    assert verdict_of(run._replace(trace=trace, applied=applied)).control == OK


@pytest.mark.parametrize(
    ("reason", "limit", "slips"),
    [
        (wire.FORCE_DOUBTED, wire.NO_LIMIT, 0),
        (wire.FROZEN, wire.NO_LIMIT, 0),
        (wire.FROZEN, wire.HELD_OPEN_LOOP, 1),  # of the accelerometer: the force still shows slips
        (wire.DRIVE_DOUBTED, wire.NO_DRIVE, 1),
    ],
)
def test_a_doubted_force_counts_no_slips(run: RunData, tmp_path: Path, reason: int, limit: int, slips: int) -> None:
    """A dead force counted 362 slips after FROZEN."""

    def doubted(tables: Tables) -> None:
        slip(run, tables, 4500)
        tables["trace"]["reason"][4300:], tables["trace"]["limit"][4300:] = reason, limit

    verdict = judge(changed(run, tmp_path / "doubted.mcap", doubted))
    assert verdict.after is not None
    assert verdict.after.slips == slips


def test_the_measured_rate_and_the_answer_of_the_exciter_are_listed(run: RunData) -> None:
    assert verdict_of(run).sample_rate is None
    applied = run.applied.copy()
    applied["sample_rate_Hz"][-100:] = 20_100.0
    applied["commands"], applied["round_trip_ns"], applied["answer_ns"] = 1, 31_000_000, 30_000_000
    verdict = verdict_of(run._replace(applied=applied))
    assert verdict.sample_rate == (20_100.0, pytest.approx(20_000.0))
    assert verdict.latency is not None
    assert verdict.latency.answer_p50_us == pytest.approx(30_000.0, rel=3e-3)
    lines = in_words(verdict, verbose=True)
    assert "rate     20100.0 samples a second, measured: 1.00500 times the stated 20000" in lines
    (latency,) = (line for line in lines if line.startswith("latency "))
    assert "of it the exciter's answer p50 29934 us" in latency


def test_the_highest_set_point_is_named_with_the_ratio(run: RunData) -> None:
    """A ratio of "1.11 to 3.18 ... (ok)" alone hides that the controller raised its set point."""
    trace = tables_of(run)["trace"]
    trace["velocity_ratio"][(trace["mode"] == wire.EXCITE) & (trace["t_ns"] > 4.5e9)] = 2.25
    lines = in_words(verdict_of(run._replace(trace=trace)), verbose=True)
    (ratio,) = [line for line in lines if line.startswith("v_a/v_d")]
    assert ratio.endswith("; set point at most 2.25")


@pytest.mark.parametrize(("at_s", "blamed"), [(4.4, True), (5.6, False)])
def test_a_trip_after_lost_commands_names_the_link(run: RunData, at_s: float, blamed: bool) -> None:
    """The headline asks about a loose base accelerometer only where no lost commands precede the trip."""
    applied = tables_of(run)["applied"]
    applied["fallback"][4200:4300] = 1
    trip = wire.Event(source="controller", code="OPEN_LOOP", text="far less v_a than commanded", t_ns=round(at_s * 1e9))
    verdict = verdict_of(run._replace(applied=applied, events=[*run.events, trip]))
    assert verdict.control == NOT_OK
    assert ("no fresh command reached the rig from 4.20 s on: look at the link" in headline(verdict)) == blamed


def test_equal_warnings_are_one_line_with_a_count(run: RunData) -> None:
    storm = [wire.Event(source="controller", code="STALE", text=f"for {k} ms") for k in range(100)]
    injected = [
        wire.Event(source="plant", code=code, text=text, t_ns=3_000_000_000)
        for code, text in [*(("INJECTED", f"fault {k} for 1 s") for k in range(4)), ("INJECTION_ENDED", "fault 0")]
    ]
    trip = wire.Event(source="controller", code="FROZEN", text="a channel repeats one number")
    verdict = verdict_of(run._replace(events=[*run.events, *storm, *injected, trip]))
    assert verdict.warnings == ["STALE: for 0 ms (the first of 100)"]
    assert verdict.injected[0] == "INJECTED: fault 0 for 1 s, at 3.00 s"
    assert verdict.injected[3:] == ["INJECTED: fault 3 for 1 s, at 3.00 s", "INJECTION_ENDED: fault 0, at 3.00 s"]
    assert verdict.trips == ["FROZEN: a channel repeats one number"]
    assert (verdict.control, verdict.reason) == (NOT_OK, "FROZEN: a channel repeats one number")
    words = in_words(verdict, verbose=False)
    assert [line.partition(" ")[0] for line in words[1:6]] == ["control", "data", "computer", "before", "after"]
    assert words[6].startswith("injected fault 0 for 1 s, at 3.00 s; fault 1 for 1 s, at 3.00 s; fault 2 for")
    assert words[6].endswith("; and 1 more: --verbose")
    assert len(words) <= 9


def test_a_controller_of_another_rig_is_a_warning(run: RunData) -> None:
    """It was in no line, although its contact resonance and stiffness belong to the other rig."""
    assert run.headers["controller"]["rig"] == run.headers["plant"]["rig"] == "paper-c45-c45"
    assert (verdict_of(run).warnings, verdict_of(run).planned_s) == ([], 6.0)
    for rig, named in (("drill-string", True), ("unnamed", False), ("", False)):
        headers = {**run.headers, "controller": {**run.headers["controller"], "rig": rig}}
        warnings = verdict_of(run._replace(headers=headers)).warnings
        line = "controller: its scenario describes the rig drill-string, but the rig is paper-c45-c45"
        assert [warning.partition(";")[0] for warning in warnings] == [line] * named


@pytest.mark.slow
def test_log_info_has_the_findings_of_log_check(run: RunData, tmp_path: Path) -> None:
    def dead(tables: Tables) -> None:
        tables["sensors"]["base_accel_mps2"][:] = 0.25

    path = changed(run, tmp_path / "dead.mcap", dead)
    result = CliRunner().invoke(app, ["log", "info", str(path), "--json"])
    assert "dead" in {finding["kind"] for finding in json.loads(result.stdout)["findings"]}
    assert "finding  dead" in CliRunner().invoke(app, ["log", "info", str(path)]).stdout


def test_a_run_that_a_fault_ends_is_judged_on_its_recorded_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here the numbers of the rig run away after 1.5 s. The slide follows on a stiffer spring; on the paper's it is at rest."""
    advance = ClosedLoop.advance

    def runs_away(loop: ClosedLoop, blocks: int, *more: Any) -> Any:
        return advance(loop, blocks if loop.block < 1000 else blocks // 2, *more)

    monkeypatch.setattr(ClosedLoop, "advance", runs_away)
    words = ["run", "--in-process", "--scenario", "from-the-start", "--log", str(tmp_path / "run.mcap")]
    words += ["--set", "rig.drive.stiffness_N_per_m=1e5"]
    result = CliRunner().invoke(app, words)
    assert (result.exit_code, "control  ok" in result.stderr, "data     whole: " in result.stderr) == (2, True, True)
