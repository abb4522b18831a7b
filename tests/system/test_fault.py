"""`stickslip fault` on a running rig: the fault acts, is reported, and ends."""

import os
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from bridge.faults import FAULTS, Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.topics import APPLIED, CONTROLLER_EVENT, PLANT_EVENT
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from tests.system.ports import free_endpoint
from tests.system.run_under_way import COMMAND, call, gone

pytestmark = pytest.mark.realtime


def test_a_fault_acts_and_a_process_is_killed() -> None:
    config = BusConfig(endpoint=free_endpoint())
    where = ["--endpoint", config.endpoint]
    command = [*COMMAND, "plant", "--scenario", "from-the-start", "--set", "duration_s=99", "--wait-for", "", *where]
    plant = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with Bus(config, "viewer", lockstep=False, patience_s=90.0) as viewer:
            events = Inbox(1000)
            viewer.listen(PLANT_EVENT, events.push)
            done = call("fault", "force-off", "--for", "0.2", *where)
            assert done.returncode == 0, done.stderr
            assert "force-off drive_force_N off 0 for 0.2 s" in done.stdout
            until_s, told = time.monotonic() + 10.0, set[str]()
            while "INJECTION_ENDED" not in told and time.monotonic() < until_s:
                if (received := events.get(0.1)) is not None:
                    told.add(parsed(wire.Event, received.payload, PLANT_EVENT.name).code)
            assert {"INJECTED", "INJECTION_ENDED"} <= told
        nobody = call("fault", "controller-killed", *where)
        assert nobody.returncode == FAULTS["NO_PEER"].exit_status
        assert "no controller answers: must belong to the same run" in nobody.stderr
    finally:
        plant.terminate()
        plant.wait(30)
    assert gone(plant.pid)


# one of each kind of fault that a loop in real time can have: of sensors, exciter, clock, bus and process; and the word that it
# brings, from the rig or the controller, where it must bring one
LIVE = {
    "force-off": "INJECTION_ENDED",
    "base-accel-half": "INJECTION_ENDED",
    "exciter-dead": "INJECTION_ENDED",
    "clock-hour-ahead": "INJECTION_ENDED",
    "blocks-late-30-ms": "STALE",
    "commands-dropped-all": "FALLBACK",
    "controller-frozen-2-s": "PAUSED",
}


@pytest.mark.nightly
@pytest.mark.slow
def test_a_fault_of_each_kind_acts_on_a_loop_that_runs_and_the_loop_goes_on(tmp_path: Path) -> None:
    config = BusConfig(endpoint=free_endpoint())
    where = ["--endpoint", config.endpoint]
    scenario = ["--scenario", "from-the-start", "--set", "duration_s=99", *where]
    quiet = {
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
        "env": os.environ | {"XDG_STATE_HOME": str(tmp_path)},
    }
    loop = [subprocess.Popen([*COMMAND, "plant", *scenario, "--wait-for", ""], **quiet)]
    loop.append(subprocess.Popen([*COMMAND, "controller", *scenario], **quiet))
    try:
        with Bus(config, "viewer", lockstep=False, patience_s=90.0) as viewer:
            inbox = Inbox(20_000)
            viewer.listen(APPLIED, inbox.push)
            for topic in (PLANT_EVENT, CONTROLLER_EVENT):
                viewer.listen(topic, inbox.keep)
            assert not viewer.wait_for(["controller"], 90.0)
            for name, word in LIVE.items():
                _hear(inbox, lambda _applied, _told: False, 0.2)
                armed = call("reset", *where).returncode + call("arm", *where).returncode
                assert armed == 0, name
                _hear(inbox, lambda applied, _told: bool(applied.amplitude_m), 20.0)
                done = call("fault", name, *([] if "frozen" in name else ["--for", "0.5"]), *where)
                assert done.returncode == 0, f"{name}: {done.stderr}"
                told = _hear(inbox, lambda _applied, told, word=word: word in told, 10.0)
                assert word in told, f"{name}: {told}"
            call("fault", "--clear", *where)
        assert all(process.poll() is None for process in loop)
    finally:
        for process in reversed(loop):
            process.terminate()
            process.wait(30)


def _hear(inbox: Inbox, enough: Callable[[wire.Applied, set[str]], bool], most_s: float) -> set[str]:
    """Codes of the events until the applied vibration and the events suffice, or the time is over."""
    until_s, told, applied = time.monotonic() + most_s, set[str](), wire.Applied()
    while not enough(applied, told) and time.monotonic() < until_s:
        received = inbox.get(0.1)
        with suppress(Fault):
            if received is not None and received.topic is APPLIED:
                applied = parsed(wire.Applied, received.payload, APPLIED.name)
            elif received is not None:
                told.add(parsed(wire.Event, received.payload, received.topic.name).code)
    return told
