"""Each process is killed: one clear line, a closed or recoverable log, no process left."""

import json
import os
import resource
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from bridge.faults import FAULTS
from bridge.log.logfile import RunData, read_run
from bridge.log.recover import recover
from tests.logs import verdict_of
from tests.system.ports import free_endpoint
from tests.system.run_under_way import Run, call, gone
from tests.system.told import told

pytestmark = pytest.mark.realtime


@pytest.mark.parametrize("victim", ["plant", "controller", "recorder"])
@pytest.mark.smoke
def test_a_killed_process_ends_the_run_and_costs_at_most_a_quarter_second(
    tmp_path: Path, runs: list[Run], victim: str
) -> None:
    run = Run(tmp_path / "run.mcap")
    runs.append(run)
    run.wait_until_recording()
    time.sleep(0.5)
    killed_at_ns = time.time_ns()
    os.kill(run.children[victim], signal.SIGKILL)
    status, _, err = run.end()
    assert status == FAULTS["PEER_DIED"].exit_status
    assert f"the {victim} was killed by signal 9" in err
    assert len(told(err)) == 1
    if victim == "recorder":
        saved = recover(run.log, run.log)
        assert saved.messages > 0
        assert not saved.damage.closed
    with run.log.open("rb") as file:
        newest_ns = max(message.log_time for _, _, message in make_reader(file).iter_messages(topics=["/sensors"]))
    assert killed_at_ns - newest_ns < 250_000_000
    data = read_run(run.log)
    assert data.damage.closed
    lost = told_lost(data, "sensors")
    assert lost < 250  # of 1 ms each
    assert len(data.sensors) + lost == data.sensors["sequence"][-1] + 1


def told_lost(data: RunData, topic: str) -> int:
    """Messages of a topic that the recorder reports as missing: in real time a busy computer may lose one, never silently."""
    texts = [event.text for event in data.events if event.code == "GAP"]
    return sum(int(text.split()[1]) for text in texts if text.startswith(f"/{topic}: "))


def test_a_stalled_controller_goes_on(tmp_path: Path, runs: list[Run]) -> None:
    run = Run(tmp_path / "run.mcap", seconds=3.5)
    runs.append(run)
    run.wait_until_recording()
    os.kill(run.children["controller"], signal.SIGSTOP)
    time.sleep(1.5)
    os.kill(run.children["controller"], signal.SIGCONT)
    _, _, err = run.end()
    assert err == ""
    data = read_run(run.log)
    assert [event.code for event in data.events if event.source == "controller"][-2:] == ["FRESH", "END"]
    assert int(data.command["block"].max()) > 3400
    verdict = verdict_of(data)
    if verdict.pauses is None:
        assert verdict.not_watched
        return
    # the computer did not stall: blocks of these 1.5 s without a command in time are counted for the loop
    assert verdict.pauses.longest_ms < 500.0
    assert verdict.pauses.late_outside + verdict.charge.unanswered > 1000


def test_a_dead_parent_leaves_no_orphan(tmp_path: Path, runs: list[Run]) -> None:
    run = Run(tmp_path / "run.mcap")
    runs.append(run)
    run.wait_until_recording()
    os.kill(run.process.pid, signal.SIGKILL)
    run.process.communicate(timeout=5)
    until_s = time.monotonic() + 10
    while time.monotonic() < until_s and not all(gone(pid) for pid in run.children.values()):
        time.sleep(0.05)
    assert all(gone(pid) for pid in run.children.values())
    assert read_run(run.log).damage.closed


def test_a_parent_that_dies_at_once_leaves_no_orphan(tmp_path: Path, runs: list[Run]) -> None:
    run = Run(tmp_path / "run.mcap")
    runs.append(run)
    run.wait_until_started()
    os.kill(run.process.pid, signal.SIGKILL)  # while they still import
    run.process.communicate(timeout=5)
    try:
        until_s = time.monotonic() + 20
        while time.monotonic() < until_s and not all(gone(pid) for pid in run.children.values()):
            time.sleep(0.05)
        assert all(gone(pid) for pid in run.children.values())
    finally:
        for pid in run.children.values():
            if not gone(pid):
                os.kill(pid, signal.SIGKILL)


def test_full_disk(tmp_path: Path, runs: list[Run]) -> None:
    log = tmp_path / "run.mcap"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, before[1]))  # children inherit it: a write beyond fails
    try:
        run = Run(log, seconds=4.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    runs.append(run)
    run.wait_until_recording()
    status, _, err = run.end()
    assert status == FAULTS["LOG_WRITE"].exit_status
    assert "stickslip: warning: LOG_WRITE: run.mcap: File too large: nothing is recorded from " in err
    assert "recover" in err
    assert "it continues in run-00" in err
    data = read_run(log)
    assert data.damage.whole
    # the log went on in the next files; losses between two of them, possibly the END, are reported
    assert data.sensors["t_ns"][-1] > 3_000_000_000
    assert {"LOG_WRITE"} <= {event.code for event in data.events}
    with log.open("rb") as file:
        assert sum(1 for _ in make_reader(file).iter_messages(topics=["/sensors"])) > 300


def test_busy_endpoint(tmp_path: Path) -> None:
    import socket

    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        endpoint = f"tcp/127.0.0.1:{holder.getsockname()[1]}"
        result = call("run", "--endpoint", endpoint, "--log", str(tmp_path / "run.mcap"))
    assert result.returncode == FAULTS["ENDPOINT_BUSY"].exit_status
    assert endpoint in result.stderr
    assert len(told(result.stderr)) == 1


def test_a_second_run_leaves_the_first_alone(tmp_path: Path, runs: list[Run]) -> None:
    endpoint = free_endpoint()
    first = Run(tmp_path / "run.mcap", "--endpoint", endpoint)
    runs.append(first)
    first.wait_until_recording()
    result = call("run", "--set", "duration_s=1.0", "--endpoint", endpoint, "--log", str(first.log))
    assert result.returncode == FAULTS["ENDPOINT_BUSY"].exit_status
    assert f"{endpoint}: cannot listen there" in result.stderr
    assert len(told(result.stderr)) == 1
    assert not gone(first.process.pid)
    first.process.send_signal(signal.SIGINT)
    status, _, _ = first.end()
    assert status == 130
    data = read_run(first.log)
    assert data.damage.closed
    assert data.sensors["sequence"][0] == 0
    assert len(data.sensors) + told_lost(data, "sensors") == data.sensors["sequence"][-1] + 1
    # one controller answered: a second one would have counted from 0 again
    assert np.all(np.diff(data.command["sequence"].astype(np.int64)) > 0)


def test_bad_configuration_starts_nothing(tmp_path: Path) -> None:
    result = call("run", "--set", "rig.slide.mass_kg=0", "--log", str(tmp_path / "run.mcap"), "--json")
    assert result.returncode == FAULTS["CONFIG"].exit_status
    assert json.loads(result.stdout)["fault"] == "CONFIG"
    assert not (tmp_path / "run.mcap").exists()


def test_a_rig_with_diverging_numbers_is_reported(tmp_path: Path) -> None:
    endless = ["--set", "duration_s=0.1", "--set", "rig.contact.stribeck_velocity_mps=1e-320"]
    for more in (["--in-process"], ["--endpoint", free_endpoint()]):
        result = call("run", *endless, *more, "--log", str(tmp_path / "run.mcap"))
        assert result.returncode == FAULTS["CONFIG"].exit_status
        assert told(result.stderr)[0].startswith(
            "stickslip: CONFIG: paper-c45-c45: the slide's velocity is not finite at 0.00"
        )
        assert "solver.step_s = 1e-05" in result.stderr
        assert len(told(result.stderr)) == 1


def test_unwritable_log(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = call("run", "--in-process", "--set", "duration_s=0.1", "--log", str(tmp_path / "file" / "run.mcap"))
    assert result.returncode == FAULTS["LOG_WRITE"].exit_status
    assert len(told(result.stderr)) == 1


@pytest.mark.parametrize("code", FAULTS)
def test_every_fault_is_explained(code: str) -> None:
    from typer.testing import CliRunner

    from cockpit.cli import app

    result = CliRunner().invoke(app, ["explain", code])
    assert result.exit_code == 0
    assert str(FAULTS[code].exit_status) in result.stdout
    assert len(result.stdout) > 100


@pytest.mark.parametrize("status", ["0", "1", "141"])
def test_every_exit_status_is_explained(status: str) -> None:
    from typer.testing import CliRunner

    from cockpit.cli import app

    assert f"exit status {status}: " in CliRunner().invoke(app, ["explain", status]).stdout
    assert f"{status:>3}  " in CliRunner().invoke(app, ["explain"]).stdout
