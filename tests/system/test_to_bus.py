"""A log played back on the bus arrives without a loss, and ends with Ctrl-C."""

import signal
import subprocess
import sys
import time

import pytest

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.topics import PLANT_EVENT, SENSORS
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox, Received
from tests.golden.bless import FOLDER
from tests.system.ports import free_endpoint

pytestmark = pytest.mark.realtime


def test_every_block_after_the_first_arrives_in_order() -> None:
    log, endpoint = FOLDER / "from-the-start.mcap", free_endpoint()
    player = subprocess.Popen(
        [sys.executable, "-m", "cockpit", "replay", str(log), "--to-bus", "--speed", "0.5", "--endpoint", endpoint]
    )
    try:
        with Bus(BusConfig(endpoint=endpoint), "viewer", lockstep=False) as bus:
            inbox = Inbox(10_000)
            bus.listen(SENSORS, inbox.push)
            bus.listen(PLANT_EVENT, inbox.push)
            first = inbox.get(30.0)
            assert first is not None
            received: list[Received] = [first, *iter(lambda: inbox.get(1.0), None)]
        events = [wire.Event.FromString(row.payload).code for row in received if row.topic is PLANT_EVENT]
        assert events[-1] == "END"
        numbers = [wire.SensorBlock.FromString(row.payload).sequence for row in received if row.topic is SENSORS]
        assert numbers == list(range(numbers[0], 1500))
        assert player.wait(10) == 0
    finally:
        if player.poll() is None:
            player.kill()
            player.wait()


@pytest.mark.parametrize("wait", [[], ["--wait"]], ids=["while it plays", "while it waits"])
def test_ctrl_c_ends_it_and_begins_no_other_log(wait: list[str]) -> None:
    log, endpoint = str(FOLDER / "from-the-start.mcap"), free_endpoint()
    player = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "cockpit",
            "replay",
            log,
            log,
            "--to-bus",
            "--speed",
            "0.05",
            *wait,
            "--endpoint",
            endpoint,
        ]
    )
    try:
        with Bus(BusConfig(endpoint=endpoint), "viewer", lockstep=False) as bus:
            assert not bus.wait_for({"plant"}, 30.0)
            player.send_signal(signal.SIGINT)
            began_s = time.monotonic()
            assert player.wait(60) == 0
        assert time.monotonic() - began_s < 15.0  # of the 30 s of a log at this speed, and of waiting
    finally:
        if player.poll() is None:
            player.kill()
            player.wait()
