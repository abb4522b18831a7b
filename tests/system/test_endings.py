"""Runs that an operator ends, and their messages: Ctrl-C at any moment, runs without an end, a missing priority."""

import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from bridge.log.check.log_check import check_log
from bridge.log.logfile import read_run
from cockpit.judge.verdict import NOT_JUDGED, NOT_OK, OK
from cockpit.run import processes as orchestra
from tests.logs import short_log
from tests.system.ports import free_endpoint
from tests.system.run_under_way import COMMAND, Run, call
from tests.system.told import told

pytestmark = pytest.mark.realtime

# one handler serves them all, so that by day two are enough: Ctrl-C, and the signal of a closing terminal
ENDINGS = [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.nightly), signal.SIGHUP]


def test_ctrl_c_fades_out_closes_the_log_and_reports_it(tmp_path: Path, runs: list[Run]) -> None:
    run = Run(tmp_path / "run.mcap", "--set", "controller.policy.enabled_from_s=0.0")
    runs.append(run)
    run.wait_until_recording()
    time.sleep(0.5)
    run.process.send_signal(signal.SIGINT)
    status, _, err = run.end()
    assert status == 130
    assert "INTERRUPTED" in err.strip().splitlines()[-1]
    data = read_run(run.log)
    assert data.damage.closed
    assert data.applied["amplitude_m"].max() > 0
    assert data.applied["amplitude_m"][-1] == 0.0


@pytest.mark.parametrize("existing", ["nothing", "an empty file", "an older log"])
def test_ctrl_c_before_the_record_judges_no_other_run(tmp_path: Path, runs: list[Run], existing: str) -> None:
    log = tmp_path / "run.mcap"
    older = {"nothing": None, "an empty file": b"", "an older log": short_log()}[existing]
    if older is not None:
        log.write_bytes(older)
    run = Run(log)
    runs.append(run)
    run.wait_until_started()
    run.process.send_signal(signal.SIGINT)
    status, _, err = run.end()
    assert status == 130
    assert told(err) == ["stickslip: INTERRUPTED: stopped by Ctrl-C before anything was recorded"]
    if older is not None:
        assert log.read_bytes() == older


def test_ctrl_c_while_a_child_starts_leaves_no_process_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[str]] = []

    class Interrupted(orchestra.Child):
        def __init__(self, role: str, arguments: list[str]) -> None:
            super().__init__(role, arguments)
            started.append(self.process)
            if role == "recorder":
                os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(orchestra, "Child", Interrupted)
    endpoint = free_endpoint()
    arguments = ["--scenario", "paper-c45-c45", "--set", f'bus.endpoint="{endpoint}"']
    try:
        with pytest.raises(KeyboardInterrupt):
            orchestra.run_processes(arguments, endpoint, tmp_path / "run.mcap", False, threading.Event.wait)
        assert len(started) == 3
        assert all(process.poll() is not None for process in started)
    finally:
        for process in started:
            process.kill()


@pytest.mark.parametrize("number", ENDINGS)
def test_a_run_in_one_process_without_an_end_goes_on_until_it_is_stopped_and_is_judged(
    tmp_path: Path, number: signal.Signals
) -> None:
    log = tmp_path / "run.mcap"
    run = subprocess.Popen(
        [*COMMAND, "run", "--in-process", "--scenario", "belt-axis", "--set", "duration_s=0", "--log", str(log), "-v"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        until_s = time.monotonic() + 60
        while (not log.exists() or log.stat().st_size < 200_000) and run.poll() is None and time.monotonic() < until_s:
            time.sleep(0.02)
        run.send_signal(number)
        out, err = run.communicate(timeout=30)
    finally:
        run.kill()
    assert run.returncode in {0, 1, 14}  # the drive may not have moved for long enough
    assert told(err) == [f"simulating until Ctrl-C; log {log}"]
    assert f"log      {log}" in out.splitlines()
    data = read_run(log)
    assert data.damage.closed
    assert len(data.sensors) > 100
    assert check_log(log).findings == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.smoke
def test_a_run_without_an_end_is_judged_when_it_is_stopped(
    tmp_path: Path, runs: list[Run], number: signal.Signals
) -> None:
    run = Run(tmp_path / "run.mcap", "--json", "--scenario", "belt-axis", seconds=0.0)
    runs.append(run)
    run.wait_until_recording()
    run.process.send_signal(number)
    status, out, err = run.end()
    verdict = json.loads(out)
    assert status == {OK: 0, NOT_OK: 1, NOT_JUDGED: 14}[verdict["control"]]
    assert verdict["log"] == str(run.log)
    assert told(err) == [f"running until Ctrl-C; log {run.log}"]
    assert read_run(run.log).damage.closed


@pytest.mark.parametrize("pause_s", [0.0, pytest.param(0.1, marks=pytest.mark.nightly), 0.3])
def test_a_second_ctrl_c_takes_nothing_away(tmp_path: Path, runs: list[Run], pause_s: float) -> None:
    run = Run(tmp_path / "run.mcap")
    runs.append(run)
    run.wait_until_recording()
    for _ in range(3):
        run.process.send_signal(signal.SIGINT)
        time.sleep(pause_s)
    status, _, err = run.end()
    assert status == 130
    words = [line.split()[0] for line in told(err)]
    assert words[1:5] == ["control", "data", "computer", "before"]
    assert told(err)[-1] == f"stickslip: INTERRUPTED: stopped by Ctrl-C; {run.log} is closed"
    assert read_run(run.log).damage.closed


@pytest.mark.parametrize("number", ENDINGS[:2])
def test_long_judging_is_reported_and_can_be_interrupted(tmp_path: Path, number: signal.Signals) -> None:
    log = tmp_path / "run.mcap"
    slow = (
        "import time; from cockpit.judge.run_judge import RunJudge; from cockpit.entry import main\n"
        "RunJudge.result = lambda *_: time.sleep(60)\n"
        "main()"
    )
    words = ["run", "--in-process", "--scenario", "belt-axis", "--set", "duration_s=0", "--log", str(log)]
    run = subprocess.Popen([sys.executable, "-P", "-c", slow, *words], stderr=subprocess.PIPE, text=True)
    try:
        assert run.stderr is not None
        assert run.stderr.readline() == f"simulating until Ctrl-C; log {log}\n"
        until_s = time.monotonic() + 60
        while (not log.exists() or log.stat().st_size < 200_000) and run.poll() is None and time.monotonic() < until_s:
            time.sleep(0.02)
        run.send_signal(number)
        time.sleep(0.3)
        run.send_signal(number)  # pressed twice
        assert run.stderr.readline() == "judging the log; Ctrl-C again to leave it unjudged\n"
        run.send_signal(number)
        err = run.communicate(timeout=30)[1]
    finally:
        run.kill()
    assert run.returncode == 130
    left = f"stopped by Ctrl-C; {log} is closed and not judged; `stickslip log info {log}` judges it"
    assert err == f"stickslip: INTERRUPTED: {left}\n"
    assert read_run(log).damage.closed


def _without_priority() -> None:
    """In a child: no right to a real-time priority, for root either."""
    import ctypes

    drop_from_bounding_set, sys_nice = 24, 23
    ctypes.CDLL(None).prctl(drop_from_bounding_set, sys_nice)
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))


@pytest.mark.parametrize("clock", ["real time", "lockstep"])
def test_a_missing_priority_is_reported_at_the_start_and_in_the_verdict(tmp_path: Path, clock: str) -> None:
    more, log = ["--lockstep"] if clock == "lockstep" else [], tmp_path / "run.mcap"
    result = subprocess.run(
        [*COMMAND, "run", "--set", "duration_s=0.5", "--endpoint", free_endpoint(), "--json", *more, "--log", str(log)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        preexec_fn=_without_priority,
    )
    warning = (
        "stickslip: warning: normal scheduling: real time is not guaranteed; grant CAP_SYS_NICE or an rtprio limit\n"
    )
    verdict = json.loads(result.stdout)
    if clock == "lockstep":
        assert (result.stderr, verdict["normal_scheduling"]) == ("", [])
        return
    assert result.stderr == warning
    assert sorted(verdict["normal_scheduling"]) == ["controller", "plant"]
    assert (verdict["pauses"], verdict["not_watched"]) == (None, "no real-time priority")
    output = call("log", "info", "--verbose", str(log)).stdout
    assert "under normal scheduling: real time is not guaranteed" in output
    assert "were not watched: no real-time priority" in output
