"""`stickslip fault` beside a rig that runs: it acts, it is told, and it is over."""

import subprocess
import time

import pytest

from bridge.faults import FAULTS
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.topics import PLANT_EVENT
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from tests.system.ports import free_endpoint
from tests.system.run_under_way import COMMAND, call, gone

pytestmark = pytest.mark.realtime


def test_a_fault_acts_and_a_process_is_killed() -> None:
    config = BusConfig(endpoint=free_endpoint())
    where = ["--endpoint", config.endpoint]
    command = [*COMMAND, "plant", "--scenario", "from-the-start", "--set", "duration_s=0", "--wait-for", "", *where]
    plant = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with Bus(config, "viewer", lockstep=False, patience_s=90.0) as viewer:
            events = Inbox(1000)
            viewer.listen(PLANT_EVENT, events.push)
            done = call("fault", "force-off", "--for", "0.2", *where)
            assert done.returncode == 0, done.stderr
            assert "force-off: drive_force_N off 0 for 0.2 s" in done.stdout
            until_s, told = time.monotonic() + 10.0, set[str]()
            while "INJECTION_ENDED" not in told and time.monotonic() < until_s:
                if (received := events.get(0.1)) is not None:
                    told.add(parsed(wire.Event, received.payload, PLANT_EVENT.name).code)
            assert {"INJECTED", "INJECTION_ENDED"} <= told
        nobody = call("fault", "controller-killed", *where)
        assert nobody.returncode == FAULTS["NO_PEER"].exit_status
        assert "no controller answers there" in nobody.stderr
    finally:
        plant.terminate()
        plant.wait(30)
    assert gone(plant.pid)
