"""Replay: the same bits from any start, through gaps, duplicates and reordering, and in words when they differ."""

import json
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from bridge.faults import Fault
from bridge.log.logfile import RunData, read_run
from bridge.log.runlog import RunLog
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.topics import SENSORS
from cockpit.cli import app
from cockpit.judge.verdict_words import headline, in_words
from cockpit.run.in_process import TimedAction, run_onboard
from cockpit.run.replay import changes_of
from cockpit.run.scenario import Scenario, header, load_scenario
from cockpit.run.simulated.run import simulate
from controller.node import ControllerNode
from controller.replay import replay
from plant.rig.node import PlantNode
from tests.logs import empty_log, tables_of, verdict_of, write
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint

COMMAND = [sys.executable, "-m", "cockpit"]


def scenario(*settings: str) -> Scenario:
    return load_scenario("paper-c45-c45", ["controller.policy.enabled_from_s=0.5", *settings])


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replay") / "run.mcap"
    run_onboard(scenario("duration_s=6.0"), path, {})
    return path


@pytest.mark.parametrize("from_s", [0.0, 0.5, 1.0, 1.7, 3.0005, 5.9, 9.0])
def test_replay_equals_record_from_anywhere(log: Path, from_s: float) -> None:
    run = read_run(log)
    result = replay(run, changes_of(run, []), from_s)
    assert result.identical
    assert result.skipped == 0
    assert result.compared == np.count_nonzero(run.trace["t_ns"] >= from_s * 1e9)


def test_a_changed_bit_is_found_and_named(log: Path) -> None:
    run = read_run(log)
    trace = np.frombuffer(bytearray(run.trace.tobytes()), run.trace.dtype)
    trace["force_rate"][4321] = np.nextafter(trace["force_rate"][4321], 1.0)
    result = replay(run._replace(trace=trace), changes_of(run, []))
    assert result.difference is not None
    assert (result.difference.table, result.difference.step, result.difference.field) == ("trace", 4321, "force_rate")


def delivered(path: Path, deliver: "list[int]", blocks: list[bytes], run: Scenario) -> RunData:
    """A log of a controller that was handed `blocks` in the order `deliver`."""
    node = ControllerNode(run.controller)
    written = RunLog(path, lockstep=True)
    written.add_header(header(run, "controller", lockstep=True))
    kept: set[int] = set()
    for index in deliver:
        if index not in kept:
            written.write(SENSORS, blocks[index])
            kept.add(index)
        if index % 97 == 0:
            written.write(*node.stale(20))
            for message in node.rest(0):
                written.write(*message)
        command = node.block(blocks[index])
        if command is not None:
            written.write(*command)
            for message in node.rest(0):
                written.write(*message)
    written.close()
    return read_run(path)


@pytest.mark.parametrize("seed", range(4))
def test_jitter_reordering_and_duplicates_change_nothing_that_the_log_does_not_explain(
    tmp_path: Path, seed: int
) -> None:
    run = scenario("duration_s=3.0")
    plant = PlantNode(run.rig, 1, arm=True)
    blocks = [plant.advance([])[0].payload for _ in range(3000)]
    chance = random.Random(seed)
    deliver: list[int] = []
    for index in range(3000):
        deliver.append(index)
        if chance.random() < 0.05:
            deliver.append(max(0, index - chance.randrange(4)))  # again, or late
        if chance.random() < 0.05 and len(deliver) > 3:
            deliver[-1], deliver[-2] = deliver[-2], deliver[-1]
        if chance.random() < 0.02:
            deliver.pop()  # lost
    data = delivered(tmp_path / "log.mcap", deliver, blocks, run)
    assert (data.trace["gap_blocks"] > 0).any()
    result = replay(data, changes_of(data, []))
    assert result.identical, result.difference
    assert result.compared == len(data.trace)


def test_a_recorder_that_lost_blocks_costs_only_until_the_next_snapshot(log: Path) -> None:
    run = read_run(log)
    keep = (run.sensors["sequence"] < 1500) | (run.sensors["sequence"] > 1510)
    result = replay(run._replace(sensors=run.sensors[keep]), changes_of(run, []))
    assert result.identical
    assert result.skipped == 500  # 1500 to 1999: the memory is known again after step 1999


@pytest.mark.parametrize("from_s", [0.0, 2.5])
def test_a_recorder_that_lost_the_steps_after_a_snapshot_costs_only_until_the_next_one(
    log: Path, from_s: float
) -> None:
    run = read_run(log)
    lost = (run.trace["sequence"] >= 2000) & (run.trace["sequence"] < 2010)  # the memory is from step 1999
    if from_s == 0.0:  # a resume at step 2000 as well
        lost |= run.trace["sequence"] == 1500
    result = replay(run._replace(trace=run.trace[~lost]), changes_of(run, []), from_s)
    assert result.identical, result.difference
    assert result.compared == np.count_nonzero(run.trace["sequence"] >= 3000) + (1500 if from_s == 0.0 else 0)


def test_a_controller_that_was_started_again_is_refused(log: Path) -> None:
    run = read_run(log)
    again = run.trace[:100].copy()
    again["t_ns"] += 600_000_000
    restarted = run._replace(trace=np.concatenate([run.trace[:500], again]))
    with pytest.raises(
        Fault, match=r"/trace: step 0 is recorded at 0.001 s and again at 0.601 s: the controller was started"
    ):
        replay(restarted, changes_of(run, []))


def test_two_controllers_that_answered_at_once_are_refused(log: Path) -> None:
    run = read_run(log)
    both = run._replace(trace=np.repeat(run.trace, 2))
    with pytest.raises(
        Fault, match=r"/trace: step 0 is recorded at 0.001 s and again at 0.001 s: .*or two controllers answered"
    ):
        replay(both, changes_of(both, []))


def test_a_what_if_names_the_change_and_its_limits(log: Path) -> None:
    result = CliRunner().invoke(app, ["replay", str(log), "--set", "limits.v_ratio=1.1"])
    assert result.exit_code == 1
    assert "wanted_velocity_mps" in result.stdout
    assert "limits.v_ratio=1.1" in result.stdout
    assert "--closed-loop" in result.stdout


def test_a_change_from_a_time_on_changes_nothing_before(log: Path) -> None:
    run = read_run(log)
    result = replay(run, changes_of(run, ["amplitude.filter_s=0.02@3s"]))
    assert result.difference is not None
    assert 3.0 <= result.difference.t_s < 3.1


@pytest.mark.parametrize(
    "setting", ["limits.v_ratio=9", "limits.v_ratio=1.1@later", "limits.v_ratio=1.1@20s", "nothing.here=1"]
)
def test_an_invalid_what_if_is_refused(log: Path, setting: str) -> None:
    result = CliRunner().invoke(app, ["replay", str(log), "--set", setting])
    assert result.exit_code == 2
    assert setting.split("=", maxsplit=1)[0].split(".", maxsplit=1)[0] in result.stderr


@pytest.mark.parametrize("more", [[], ["--closed-loop"]], ids=["replay", "closed loop"])
@pytest.mark.parametrize("setting", ["samples_per_block=40", "samples_per_block=40@3s", "controller.block_s=0.002@3s"])
def test_a_what_if_cannot_change_recorded_blocks(log: Path, tmp_path: Path, setting: str, more: list[str]) -> None:
    keep = ["--log", str(tmp_path / "again.mcap")] if more else []
    result = CliRunner().invoke(app, ["replay", str(log), "--set", setting, *more, *keep])
    assert result.exit_code == 2, result.output
    key, value = setting.removeprefix("controller.").removesuffix("@3s").split("=")
    recorded = {"samples_per_block": "20", "block_s": "0.001"}[key]
    assert f"run.mcap with --set: {key} = {value}: must be {recorded}, as recorded; leave it out" in result.stderr


def test_closed_loop_compares_both(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "again.mcap"
    same = CliRunner().invoke(app, ["replay", str(log), "--closed-loop", "--json", "--log", str(out)])
    figures = json.loads(same.stdout)
    assert figures["was"] == figures["now"]
    arguments = ["--closed-loop", "--set", "limits.v_ratio=1.5", "--json", "--log", str(out)]
    changed = json.loads(CliRunner().invoke(app, ["replay", str(log), *arguments]).stdout)
    assert changed["now"]["vibration_dose_mm2_per_s"] > changed["was"]["vibration_dose_mm2_per_s"]
    assert changed["now"]["velocity_ratio_min"] > 1.25 > changed["was"]["velocity_ratio_min"]


def test_the_log_of_a_closed_loop_with_a_change_replays(log: Path, tmp_path: Path) -> None:
    out, third = tmp_path / "again.mcap", tmp_path / "third.mcap"
    change = ["--closed-loop", "--set", "limits.v_ratio=1.1@3s", "--log", str(out)]
    assert CliRunner().invoke(app, ["replay", str(log), *change]).exit_code == 0
    result = CliRunner().invoke(app, ["replay", str(out)])
    assert result.exit_code == 0, result.stdout
    assert {"scenario", "rig", "seed", "clock"} <= read_run(out).headers["run"].keys()
    assert CliRunner().invoke(app, ["replay", str(out), "--closed-loop", "--log", str(third)]).exit_code == 0
    assert read_run(third).trace.tobytes() == read_run(out).trace.tobytes()


@pytest.mark.slow
def test_an_operators_stop_is_repeated_in_the_closed_loop_and_no_stick_slip_of_the_controllers(tmp_path: Path) -> None:
    stopped, again = tmp_path / "stopped.mcap", tmp_path / "again.mcap"
    run = load_scenario("from-the-start", ["duration_s=14.0"])
    words = [
        TimedAction(
            3_960_000_000, wire.Operator.STOP, to_controller=False
        ),  # by file: the trace shows only the one of 4.0 s
        TimedAction(4_000_000_000, wire.Operator.STOP, to_rig=False),
        TimedAction(5_200_000_000, wire.Operator.RESET),
        TimedAction(5_300_000_000, wire.Operator.ARM),
    ]
    run_onboard(run, stopped, {}, words=words)
    slips = verdict_of(read_run(stopped))
    assert (slips.before, slips.good) == (None, True)
    assert slips.after is not None
    assert slips.after.seconds == pytest.approx(10.0, abs=0.1)
    assert slips.stopped_s == pytest.approx(3.0, abs=0.1)
    assert slips.stopped_slips > 0
    then = f"{slips.stopped_slips} slips"
    stopped_line = (
        f"stopped  by an operator, or not armed, for 3.0 s (counted neither before nor after); {then} in this time"
    )
    assert stopped_line in in_words(slips, verbose=True)
    assert headline(slips) == f"no stick-slip with the controller in charge; {then} while it was stopped or not armed"
    assert int(read_run(stopped).trace["slips"][-1]) >= 3
    figures = CliRunner().invoke(app, ["replay", str(stopped), "--closed-loop", "--json", "--log", str(again)])
    compared = json.loads(figures.stdout)
    assert compared["was"] == compared["now"]


def test_closed_loop_repeats_steps_of_speed_and_load_and_refuses_faults(tmp_path: Path) -> None:
    steps = "step=[{at_s=2.0, load=1.5}, {at_s=3.0, speed_mps=0.0004}, {at_s=4.0, load=0.8}]"
    made, again, faulty = tmp_path / "made.mcap", tmp_path / "again.mcap", tmp_path / "faulty.mcap"
    simulate(scenario(steps, "duration_s=6"), made, {})
    result = CliRunner().invoke(app, ["replay", str(made), "--closed-loop", "--json", "--log", str(again)])
    assert result.exit_code == 0, result.stderr
    assert read_run(made).trace.tobytes() == read_run(again).trace.tobytes()
    fault = 'fault=[{kind="frozen", target="sensors", from_s=0.5}]'
    simulate(scenario(fault, "duration_s=1"), faulty, {})
    result = CliRunner().invoke(app, ["replay", str(faulty), "--closed-loop", "--log", str(tmp_path / "other.mcap")])
    assert result.exit_code == 7
    assert "with faults, which are not repeated" in result.stderr
    assert not (tmp_path / "other.mcap").exists()


def test_closed_loop_of_a_run_that_was_cut_short_takes_as_long_as_was_recorded(log: Path, tmp_path: Path) -> None:
    run, cut, out = read_run(log), tmp_path / "cut.mcap", tmp_path / "again.mcap"
    write(cut, {name: table[:2500] for name, table in tables_of(run).items()}, run)
    figures = json.loads(
        CliRunner().invoke(app, ["replay", str(cut), "--closed-loop", "--json", "--log", str(out)]).stdout
    )
    assert figures["was"] == figures["now"]
    assert len(read_run(out).trace) == 2500


def test_closed_loop_of_a_log_without_a_block_is_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(
        app, ["replay", str(empty_log(tmp_path)), "--closed-loop", "--log", str(tmp_path / "a.mcap")]
    )
    assert result.exit_code == 7
    assert "empty.mcap: holds no block" in result.stderr


def to_a_live_controller(log: Path, again: Path) -> list[int]:
    """Play a log to a controller and a recorder; how the three ended."""
    endpoint = free_endpoint()
    # on a busy computer the player may pause for 20 ms, which the controller would rightly call stale
    patient = ["--set", "controller.limits.stale_after_s=5.0"]
    arguments = ["--endpoint", endpoint, "--set", "controller.policy.enabled_from_s=0.5", *patient]
    started = [
        subprocess.Popen([*COMMAND, *command])
        for command in (
            ["replay", str(log), "--to-bus", "--from", "0s", "--endpoint", endpoint, "--wait"],
            ["controller", *arguments],
            ["record", *arguments, "--log", str(again)],
        )
    ]
    try:
        return [process.wait(PATIENCE_S) for process in started]
    finally:
        for process in started:
            if process.poll() is None:
                process.kill()
                process.wait()


def got_the_same_input(now: RunData, was: RunData) -> bool:
    """Whether no message was lost, and no block was late: from late blocks the controller learns nothing."""
    lost = {"GAP", "RESTART", "DROPPED", "STALE", "PLANT_LOST"} & {event.code for event in now.events}
    return not lost and np.array_equal(now.trace["events"], was.trace["events"])


@pytest.mark.realtime
def test_a_log_on_the_bus_gets_the_same_answers_from_a_live_controller(log: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.mcap"
    was = read_run(log)
    # On a busy computer blocks are lost, or come more than 15 ms late. The answers are still checked bit for bit against
    # the input of this run, and another run is compared with the log
    for _ in range(3):
        statuses = to_a_live_controller(log, again)
        if statuses == [0, 0, 0]:
            now = read_run(again)
            assert replay(now, changes_of(now, [])).identical
            if got_the_same_input(now, was):
                break
    assert statuses == [0, 0, 0]
    now = read_run(again)
    assert now.sensors.tobytes() == was.sensors.tobytes()
    for field in ("mode", "force_rate", "wanted_amplitude_m", "vibration_velocity_mps"):
        assert np.array_equal(now.trace[field], was.trace[field]), field


def test_a_replay_without_steps_to_compare_fails(log: Path) -> None:
    result = CliRunner().invoke(app, ["replay", str(log), "--from", "99s"])
    assert result.exit_code == 7
    assert "99 s" in result.stderr
