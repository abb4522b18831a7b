"""A rig that dies and restarts is used again; stopped processes are reported correctly."""

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from bridge.log.logfile import read_run
from bridge.wire.session import LEASE_S
from bridge.wire.topics import COMMAND as COMMAND_TOPIC
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from tests.system.ports import free_endpoint
from tests.system.run_under_way import COMMAND

pytestmark = pytest.mark.realtime


@contextmanager
def processes(endpoint: str, log: Path) -> Iterator[dict[str, subprocess.Popen[str]]]:
    """A rig, a controller and a recorder without a supervisor."""
    settings = ["--endpoint", endpoint, "--set", "duration_s=99", "--set", "controller.policy.enabled_from_s=0.0"]
    started = {
        role: subprocess.Popen(
            [*COMMAND, role, *settings, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for role, more in (
            ("plant", ["--wait-for", "controller,recorder"]),
            ("controller", []),
            ("recorder", ["--log", str(log)]),
        )
    }
    try:
        yield started
    finally:
        for process in started.values():
            if process.poll() is None:
                process.kill()
            process.communicate()


def life_of(process: subprocess.Popen[str]) -> list[str]:
    """Lifecycle lines of an ended process."""
    assert process.stderr is not None
    words = [line.split()[0] for line in process.stderr.read().splitlines()]
    return [word for word in words if word in {"waiting", "joined", "running", "ended"}]


def await_commands(endpoint: str) -> None:
    inbox = Inbox(1000)
    with Bus(BusConfig(endpoint=endpoint), "viewer", lockstep=False, patience_s=60.0) as viewer:
        viewer.listen(COMMAND_TOPIC, inbox.push)
        for _ in range(300):
            assert inbox.get(60.0) is not None


def test_a_rig_that_is_killed_and_started_again_is_taken_up_again(tmp_path: Path) -> None:
    log, endpoint = tmp_path / "run.mcap", free_endpoint()
    with processes(endpoint, log) as started:
        await_commands(endpoint)
        started["plant"].kill()
        time.sleep(1.2)
        settings = ["--endpoint", endpoint, "--set", "duration_s=2", "--wait-for", "controller"]
        assert (
            subprocess.run([*COMMAND, "plant", *settings], timeout=60, check=False, capture_output=True).returncode == 0
        )
        ends = {role: started[role].wait(20) for role in ("controller", "recorder")}
        reported = {role: life_of(started[role]) for role in ends}
    assert ends == {"controller": 0, "recorder": 0}
    assert reported["controller"] == ["waiting", "joined", "running", "waiting", "joined", "ended"]
    assert reported["recorder"] == ["waiting", "waiting", "joined", "running", "ended"]
    data = read_run(log)
    codes = [event.code for event in data.events if event.source == "controller"]
    assert [code for code in codes if code in {"RIG_RESTARTED", "RIG_BACK"}] == ["RIG_RESTARTED", "RIG_BACK"]
    back = next(event for event in data.events if event.code == "RIG_BACK")
    again = int(np.argmax(np.diff(data.sensors["sequence"].astype(np.int64)) < 0)) + 1
    last_s = data.sensors["t_ns"][again - 1] * 1e-9
    assert f"the link to the rig is down; last block at {last_s:.3f} s then" in back.text
    assert len(data.sensors) - again > 1900
    answered = data.applied["command_block"][again + 300 :].astype(np.int64)
    assert (data.applied["sequence"][again + 300 :].astype(np.int64) - answered < 50).mean() > 0.9
    # from nothing, and no faster than the slew limit of 1 nm a block
    # it begins at rest; the log may lack the first of its blocks, so as many steps of the ramp may be there
    missing = int(data.applied["sequence"][again])
    assert missing < 5
    assert data.applied["amplitude_m"][again] < 1.1e-9 * (missing + 1)
    assert np.abs(np.diff(data.applied["amplitude_m"][again:])).max() < 1.1e-9


@pytest.mark.parametrize(("role", "for_s"), [("plant", 1.0), ("controller", 1.0), ("plant", 2.5)])
def test_a_stalled_process_reports_it_and_the_run_goes_on(tmp_path: Path, role: str, for_s: float) -> None:
    log, endpoint = tmp_path / "run.mcap", free_endpoint()
    with processes(endpoint, log) as started:
        await_commands(endpoint)
        os.kill(started[role].pid, signal.SIGSTOP)
        time.sleep(for_s)
        os.kill(started[role].pid, signal.SIGCONT)
        time.sleep(1.0)
        await_commands(endpoint)
        time.sleep(1.0)
        assert all(process.poll() is None for process in started.values())
        started["plant"].send_signal(signal.SIGTERM)
        assert started["controller"].wait(20) == started["recorder"].wait(20) == 0
    data = read_run(log)
    if for_s < LEASE_S:  # the link is kept, and nothing is lost
        paused = [event for event in data.events if event.code == "PAUSED" and event.source == role]
        assert float(paused[0].text.split(" for ")[1].split()[0]) > 0.8 * for_s
        assert not {event.code for event in data.events} & {"GAP", "RIG_LOST"}
        assert data.trace["gap_blocks"].sum() == 0
    else:
        assert {"RIG_BACK", "GAP"} <= {event.code for event in data.events}
    reported = [event for event in data.events if event.source == "controller"]
    made_up_for = {"LATE", "FLOOD", "FOREIGN", "EXCITER_END"}  # possible events when late blocks arrive at once
    codes = [event.code for event in reported if event.code not in made_up_for]
    assert codes[-2:] == ["FRESH", "END"], [event.text for event in reported]


def test_a_frozen_controller_is_replaced(tmp_path: Path) -> None:
    """Its link ends after the lease; 1.5 s on a quiet computer (docs/method/rig.md)."""
    endpoint = free_endpoint()
    with processes(endpoint, tmp_path / "run.mcap") as started:
        await_commands(endpoint)
        os.kill(started["controller"].pid, signal.SIGSTOP)
        second = subprocess.Popen([*COMMAND, "controller", "--endpoint", endpoint], stderr=subprocess.PIPE, text=True)
        try:
            await_commands(endpoint)
            started["plant"].send_signal(signal.SIGTERM)
            assert second.wait(20) == 0
            assert life_of(second)[-3:] == ["joined", "running", "ended"]
        finally:
            second.kill()
            second.communicate()
