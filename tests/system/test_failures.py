"""Everything that can die, dies here: one clear line, a closed or recoverable log, nobody left behind."""

import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from bridge.faults import FAULTS
from bridge.log.logfile import RunData, read_run, recover
from cockpit.run import processes as orchestra
from tests.logs import short_log
from tests.system.ports import free_endpoint
from tests.system.told import told

pytestmark = pytest.mark.realtime

COMMAND = [sys.executable, "-m", "cockpit"]


def children_of(pid: int) -> list[int]:
    """Processes whose parent is `pid`."""
    found: list[int] = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            found.append(int(stat.parent.name))
    return found


def role(pid: int) -> str:
    """What a child of a run is, from its command line."""
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return ""
    return words[words.index(b"cockpit") + 1].decode() if b"cockpit" in words else ""


def gone(pid: int) -> bool:
    """Whether a process has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


class Run:
    """A run under way, its children by role."""

    def __init__(self, log: Path, *more: str, seconds: float = 30.0) -> None:
        arguments = [
            "run",
            "--set",
            f"duration_s={seconds}",
            "--endpoint",
            free_endpoint(),
            "--log",
            str(log),
            *more,
        ]
        self.process = subprocess.Popen(
            [*COMMAND, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.log = log
        self.children: dict[str, int] = {}

    def wait_until_recording(self) -> None:
        """Until two chunks are in the log."""
        until_s = time.monotonic() + 60
        while time.monotonic() < until_s and self.process.poll() is None:
            if self.log.exists() and self.log.stat().st_size > 200_000:
                self.children = {role(pid): pid for pid in children_of(self.process.pid)}
                assert {"plant", "controller", "recorder"} <= set(self.children)
                return
            time.sleep(0.02)
        pytest.fail(f"the run never began: {self.process.communicate(timeout=5)}")

    def wait_until_started(self) -> None:
        """Until its children are there, which have recorded nothing yet."""
        until_s = time.monotonic() + 30
        roles = {"plant", "controller", "recorder"}
        while set(self.children) != roles and time.monotonic() < until_s:
            self.children = {role(pid): pid for pid in children_of(self.process.pid)}
        assert set(self.children) == roles

    def end(self) -> tuple[int, str, str]:
        """Status, stdout and stderr; nobody may be left."""
        out, err = self.process.communicate(timeout=30)
        assert all(gone(pid) for pid in self.children.values())
        return self.process.returncode, out, err


@pytest.fixture
def runs(tmp_path: Path) -> Iterator[list[Run]]:
    made: list[Run] = []
    yield made
    for run in made:
        pids = [*children_of(run.process.pid), run.process.pid]
        if run.process.poll() is None:
            for pid in pids:
                os.kill(pid, signal.SIGKILL)
            run.process.wait()


@pytest.mark.parametrize("victim", ["plant", "controller", "recorder"])
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
    """Messages of a topic that the recorder says did not come: in real time a busy machine may drop one, never silently."""
    texts = [event.text for event in data.events if event.code == "GAP"]
    return sum(int(text.split()[1]) for text in texts if text.startswith(f"/{topic}: "))


@pytest.mark.parametrize("victim", ["plant", "controller", "recorder"])
def test_in_lockstep_a_pause_costs_nothing(tmp_path: Path, runs: list[Run], victim: str) -> None:
    """A busy machine pauses processes for longer than the lease of real time, which would break the link and lose messages."""
    run = Run(tmp_path / "run.mcap", "--lockstep", seconds=10.0)
    runs.append(run)
    run.wait_until_recording()
    os.kill(run.children[victim], signal.SIGSTOP)
    time.sleep(0.5)
    os.kill(run.children[victim], signal.SIGCONT)
    status, _, err = run.end()
    assert (status, err) == (0, "")
    data = read_run(run.log)
    assert len(data.sensors) == len(data.command) == 10_000
    assert told_lost(data, "sensors") == 0


def test_ctrl_c_fades_out_closes_the_log_and_says_so(tmp_path: Path, runs: list[Run]) -> None:
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


@pytest.mark.parametrize("there", ["nothing", "an empty file", "an older log"])
def test_ctrl_c_before_the_record_judges_no_other_run(tmp_path: Path, runs: list[Run], there: str) -> None:
    log = tmp_path / "run.mcap"
    older = {"nothing": None, "an empty file": b"", "an older log": short_log()}[there]
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


def test_ctrl_c_while_a_child_starts_leaves_nobody_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_in_one_process_without_an_end_goes_on_until_it_is_stopped_and_is_judged(
    tmp_path: Path, number: signal.Signals
) -> None:
    log = tmp_path / "run.mcap"
    run = subprocess.Popen(
        [*COMMAND, "run", "--in-process", "--set", "duration_s=0", "--log", str(log)],
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
    assert run.returncode in {0, 1}
    assert err == f"simulating until Ctrl-C; log {log}\n"
    assert out.splitlines()[-1] == f"log      {log}"
    data = read_run(log)
    assert data.damage.closed
    assert len(data.sensors) > 100


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_without_an_end_is_judged_when_it_is_stopped(
    tmp_path: Path, runs: list[Run], number: signal.Signals
) -> None:
    run = Run(tmp_path / "run.mcap", "--json", seconds=0.0)
    runs.append(run)
    run.wait_until_recording()
    run.process.send_signal(number)
    status, out, err = run.end()
    verdict = json.loads(out)
    assert status == (0 if verdict["good"] else 1)
    assert verdict["log"] == str(run.log)
    assert told(err) == [f"running until Ctrl-C; log {run.log}"]
    assert read_run(run.log).damage.closed


@pytest.mark.parametrize("pause_s", [0.0, 0.1, 0.3])
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
    assert words[0] == "before"
    assert told(err)[-2:] == [
        f"log      {run.log}",
        f"stickslip: INTERRUPTED: stopped by Ctrl-C; {run.log} is closed",
    ]
    assert read_run(run.log).damage.closed


def _without_priority() -> None:
    """In a child: no right to a real-time priority, for root either."""
    import ctypes

    drop_from_bounding_set, sys_nice = 24, 23
    ctypes.CDLL(None).prctl(drop_from_bounding_set, sys_nice)
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))


@pytest.mark.parametrize("clock", ["real time", "lockstep"])
def test_a_priority_that_is_missing_is_told_at_the_start_and_in_the_verdict(tmp_path: Path, clock: str) -> None:
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
    said = call("log", "info", str(log)).stdout
    assert "under normal scheduling: real time is not guaranteed" in said


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
        run = Run(log)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    runs.append(run)
    run.wait_until_recording()
    status, _, err = run.end()
    assert status == FAULTS["LOG_WRITE"].exit_status
    assert "LOG_WRITE" in err
    assert "recover" in err
    assert len(told(err)) == 1
    damage = read_run(log).damage
    assert damage.closed
    assert (damage.cut_bytes, damage.bad_chunks) == (0, 0)
    with log.open("rb") as file:
        assert sum(1 for _ in make_reader(file).iter_messages(topics=["/sensors"])) > 300


def call(*arguments: str, timeout_s: float = 60.0) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=timeout_s, check=False)


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


def test_a_rig_whose_numbers_run_away_is_no_quiet_one(tmp_path: Path) -> None:
    endless = ["--set", "duration_s=0.1", "--set", "rig.contact.stribeck_velocity_mps=1e-320"]
    for more in (["--in-process"], ["--endpoint", free_endpoint()]):
        result = call("run", *endless, *more, "--log", str(tmp_path / "run.mcap"))
        assert result.returncode == FAULTS["CONFIG"].exit_status
        assert told(result.stderr)[0].startswith(
            "stickslip: CONFIG: paper-c45-c45: the slide's velocity is no number at 0.00"
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
