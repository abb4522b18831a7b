"""A short run in real time over the bus, and an operator's word during it."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from bridge.faults import FAULTS
from bridge.log.logfile import read_run
from bridge.log.storage.verdict_file import verdict_path
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import BLOCK
from bridge.wire.topics import APPLIED, OPERATOR, STATE
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from tests.system.lost import lost_of
from tests.system.ports import free_endpoint

pytestmark = pytest.mark.realtime

COMMAND = [sys.executable, "-m", "cockpit"]


def await_size(log: Path, size: int) -> None:
    """Until a log has grown to so many bytes; a minute at most."""
    until_s = time.monotonic() + 60
    while (not log.exists() or log.stat().st_size < size) and time.monotonic() < until_s:
        time.sleep(0.05)


@pytest.mark.smoke
def test_every_block_arrives_and_is_answered(tmp_path: Path) -> None:
    log = tmp_path / "run.mcap"
    arguments = ["--set", "duration_s=6.0", "--set", "controller.policy.enabled_from_s=0.0"]
    result = subprocess.run(
        [*COMMAND, "run", *arguments, "--endpoint", free_endpoint(), "--log", str(log), "--json"],
        capture_output=True, text=True, timeout=90, check=False,
    )  # fmt: skip
    data = read_run(log)
    lost = lost_of(data.events)
    # after the last of 6 s the vibration fades
    assert 6000 <= len(data.sensors) + lost["/sensors"] < 6100, result.stderr
    # the bench measures how soon answers come; this test checks that they come, or are reported as lost
    traced = data.trace["block"][data.trace["events"] & BLOCK != 0]
    assert (np.diff(traced.astype(np.int64)) > 0).all()
    for answered in (traced, data.command["block"]):
        assert len(np.setxor1d(answered, data.sensors["sequence"])) <= lost.total(), lost
    assert int(data.applied["commands"].sum()) + lost.total() > 5700  # a pause at the end leaves some under way
    assert set(data.headers) == {"run", "plant", "controller"}
    assert verdict_path(log).is_file()
    verdict = json.loads(result.stdout)
    watch = [event.text for event in data.events if event.code == "WATCH"]
    assert len(watch) == 1
    assert (verdict["pauses"] is None) == ("not watched: " in watch[0]) == bool(verdict["not_watched"])


@pytest.mark.smoke
def test_a_recorder_that_comes_last_misses_nothing(tmp_path: Path) -> None:
    log, endpoint = tmp_path / "run.mcap", free_endpoint()
    roles = {"plant": ["--wait-for", "controller,recorder"], "controller": [], "recorder": ["--log", str(log)]}
    common = ["--set", "duration_s=2.0", "--endpoint", endpoint]
    started: list[subprocess.Popen[bytes]] = []
    try:
        for role, more in roles.items():
            started.append(subprocess.Popen([*COMMAND, role, *common, *more], stderr=subprocess.DEVNULL))
            if role == "controller":
                with Bus(BusConfig(endpoint=endpoint), "stranger", lockstep=False) as bus:
                    assert not bus.wait_for({"controller"}, 60.0)
        for process in started:
            assert process.wait(60) == 0
    finally:
        for process in started:
            if process.poll() is None:
                process.kill()
                process.wait()
    data = read_run(log)
    assert [event.source for event in data.events if event.code == "START"] == ["plant", "controller"]
    # the first of each is there; a computer that stalls may lose later ones, and reports it
    assert data.sensors["sequence"][0] == data.command["block"][0] == data.trace["block"][0] == 0
    assert not [event.text for event in data.events if event.code == "GAP" and event.t_ns < 100_000_000]
    assert len(data.sensors) + lost_of(data.events)["/sensors"] >= 2000


def test_of_two_controllers_that_wait_for_one_rig_one_stays() -> None:
    config = BusConfig(endpoint=free_endpoint())
    controllers = [
        subprocess.Popen([*COMMAND, "controller", "--endpoint", config.endpoint], stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    try:
        time.sleep(2.0)  # both dial by now, or the second comes late and is refused like any other
        with Bus(config, "plant", lockstep=False) as plant:
            plant.announce()
            assert not plant.wait_for({"controller"}, 60.0)
            until_s = time.monotonic() + 30.0
            while all(controller.poll() is None for controller in controllers) and time.monotonic() < until_s:
                time.sleep(0.05)
            time.sleep(1.0)
            ended = [controller for controller in controllers if controller.poll() is not None]
            assert [controller.returncode for controller in ended] == [FAULTS["ENDPOINT_BUSY"].exit_status]
            assert ended[0].stderr is not None
            assert "another controller is on this bus: must be one" in ended[0].stderr.read()
    finally:
        for controller in controllers:
            controller.kill()
            controller.communicate()


@pytest.mark.smoke
def test_operator_stop_and_reset(tmp_path: Path) -> None:
    log, endpoint = tmp_path / "run.mcap", free_endpoint()
    # without an end: three processes start during the run, and take 12 s on a busy computer
    arguments = ["--set", "duration_s=99", "--set", "controller.policy.enabled_from_s=0.0"]
    run = subprocess.Popen(
        [*COMMAND, "run", *arguments, "--endpoint", endpoint, "--log", str(log)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        await_size(log, 200_000)
        assert subprocess.run([*COMMAND, "stop", "--endpoint", endpoint], timeout=30, check=False).returncode == 0
        second = [*COMMAND, "controller", "--endpoint", endpoint]
        refused = subprocess.run(second, timeout=60, check=False, capture_output=True, text=True)
        assert refused.returncode == FAULTS["ENDPOINT_BUSY"].exit_status
        assert f"{endpoint}: another controller is on this bus: must be one" in refused.stderr
        shown = subprocess.run(
            [*COMMAND, "status", "--json", "--endpoint", endpoint], timeout=30, check=True, capture_output=True
        )
        status = json.loads(shown.stdout)
        assert (status["rig"], status["mode"]) == ("paper-c45-c45", "STOPPED")
        assert status["roles"] == ["plant", "controller", "recorder"]
        for word in ("reset", "arm"):
            assert subprocess.run([*COMMAND, word, "--endpoint", endpoint], timeout=30, check=False).returncode == 0
        await_size(log, log.stat().st_size + 150_000)
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=60)
    finally:
        run.kill()
        run.communicate()
    data = read_run(log)
    stopped = data.trace["mode"] == wire.STOPPED
    assert stopped.any()
    assert data.applied["amplitude_m"][: np.argmax(stopped)].max() > 0
    assert data.trace["vibration_velocity_mps"][stopped][300:].max() < 1e-5
    assert data.trace["mode"][-1] != wire.STOPPED
    output = [event.text.split()[0] for event in data.events if event.code == "OPERATOR"]
    assert list(dict.fromkeys(output)) == ["STOP", "RESET", "ARM"]  # on a busy computer one may be published twice


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        (wire.ACTIVE, "the rig did not confirm STOP within 5 s and is ACTIVE with a vibration of 37 nm"),
        (None, "no rig publishes"),
    ],
)
def test_a_rig_that_does_not_confirm_is_reported(state: int | None, expected: str) -> None:
    config = BusConfig(endpoint=free_endpoint())
    with Bus(config, "plant", lockstep=False) as plant:
        inbox, send = Inbox(10), plant.publisher(APPLIED)
        plant.listen(OPERATOR, inbox.push)
        stop = subprocess.Popen([*COMMAND, "stop", "--endpoint", config.endpoint], stderr=subprocess.PIPE, text=True)
        assert inbox.get(60.0) is not None
        while stop.poll() is None:
            if state is not None:
                send(wire.Applied(guard_state=state, amplitude_m=37e-9).SerializeToString())
            time.sleep(0.01)
        _, output = stop.communicate()
    assert stop.returncode == FAULTS["NO_PEER"].exit_status
    assert f"{config.endpoint}: {expected}" in output


def test_rubbish_on_the_bus_stops_no_process(tmp_path: Path) -> None:
    log, endpoint = tmp_path / "run.mcap", free_endpoint()
    run = subprocess.Popen(
        [*COMMAND, "run", "--set", "duration_s=5.0", "--endpoint", endpoint, "--log", str(log)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        await_size(log, 300_000)
        config = BusConfig(endpoint=endpoint)
        with Bus(config, "operator", lockstep=False) as operator, Bus(config, "controller", lockstep=False) as other:
            for bus, topic, payload in (
                (operator, OPERATOR, b"\x08\x07"),
                (operator, OPERATOR, b"\xff\xff"),
                (other, STATE, b"\xff\xff\xff"),
            ):
                bus.publisher(topic)(payload)
            time.sleep(0.5)
        run.communicate(timeout=60)
    finally:
        run.kill()
        run.communicate()
    data = read_run(log)
    # on a busy computer a step without a block may come between, where one is late
    assert int((data.trace["events"] & BLOCK).sum()) == 5000
    texts = [f"{event.code} {event.text}" for event in data.events]
    assert "BAD_MESSAGE operator: action = 7: not known: dropped" in texts
    assert any(text.startswith("BAD_MESSAGE operator: 2 bytes cannot be decoded as Operator") for text in texts)
    assert any(text.startswith("BAD_MESSAGE state: 3 bytes cannot be decoded as State") for text in texts)
