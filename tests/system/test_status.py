"""`stickslip status`: the state of a bus, to which it publishes nothing."""

import itertools
import json
import subprocess
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import pytest

from bridge.faults import FAULTS, Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.messages import TRACE as TRACE_LAYOUT
from bridge.wire.messages import sensor_block
from bridge.wire.topics import APPLIED, CONTROLLER_EVENT, OPERATOR, SENSORS, TRACE, Topic
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from cockpit.live.status import look
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint

CLI = [sys.executable, "-m", "cockpit"]
HEADER = wire.Header(role="plant", configuration=json.dumps({"rig": {"name": "lathe"}}))
GAP = wire.Event(source="controller", code="GAP", text="3 blocks")
BLOCK_NS = 20_000_000


def messages(number: int, trace: dict[str, Any], applied: dict[str, Any]) -> dict[Topic, bytes]:
    """Messages of rig and controller for one block."""
    times = {"sequence": number, "t_ns": (number + 1) * BLOCK_NS}
    defaults = {
        SENSORS: (sensor_block(20), {"drive_force_N": 13.5}),
        TRACE: (TRACE_LAYOUT, _TRACE | trace | {"block": number}),
        APPLIED: (APPLIED_LAYOUT, _APPLIED | applied),
    }
    payloads: dict[Topic, bytes] = {CONTROLLER_EVENT: GAP.SerializeToString()}
    for topic, (layout, values) in defaults.items():
        record = layout.blank()
        for name, value in (times | values).items():
            record[name] = value
        payloads[topic] = record.tobytes()
    return payloads


_TRACE = {
    "drive_velocity_mps": 5e-4,
    "vibration_velocity_mps": 6e-4,
    "time_to_slip_s": -1.0,
    "state": wire.SMOOTH,
    "slips": 5,
    "mode": wire.EXCITE,
    "reason": wire.HELD,
    "limit": wire.SLEW,
}
_APPLIED = {"frequency_Hz": 2600.0, "amplitude_m": 37e-9, "guard_state": wire.ACTIVE, "cause": wire.VIBRATION_BEGAN}


@contextmanager
def publishing(plant: Bus, controller: Bus, trace: dict[str, Any], applied: dict[str, Any]) -> Generator[None]:
    """Publish a block after the other, as a loop does; each publishes its topics alone."""
    over = threading.Event()
    senders = {
        topic: (plant if topic.sender == "plant" else controller).publisher(topic) for topic in messages(0, {}, {})
    }

    def publish() -> None:
        for number in itertools.count():
            if over.wait(BLOCK_NS * 1e-9):
                return
            for topic, payload in messages(number, trace, applied).items():
                senders[topic](payload)

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.fixture
def config() -> BusConfig:
    return BusConfig(endpoint=free_endpoint())


def test_a_rig_and_its_controller_are_shown(config: BusConfig) -> None:
    inbox = Inbox(10)
    with Bus(config, "plant", lockstep=False) as plant, Bus(config, "controller", lockstep=False) as controller:
        plant.serve_header(HEADER)
        plant.listen(OPERATOR, inbox.keep)
        plant.announce()
        controller.announce()
        assert not plant.wait_for(["plant", "controller"], PATIENCE_S)
        with publishing(plant, controller, {}, {}):
            seen, lines = look(config)
        assert inbox.get() is None
        assert not plant.alive("status")
    assert (seen.rig, seen.roles, seen.controlled) == ("lathe", ["plant", "controller"], True)
    assert (seen.mode, seen.reason, seen.limit, seen.contact) == ("EXCITE", "HELD", "SLEW", "SMOOTH")
    assert seen.events[0] == "controller GAP: 3 blocks"
    assert (seen.drive_force_N, seen.slips, seen.state, seen.fallback) == (13.5, 5, "ACTIVE", False)
    assert seen.velocity_ratio == pytest.approx(1.2)
    for line in (
        "answer   EXCITE: vibrating, so that v_a stays above v_d",
        f"rig      lathe at {config.endpoint}",
        "on bus   plant, controller; no recorder",
        "guard    ACTIVE: it vibrates",
        "contact  SMOOTH: the slide follows the drive",
        "mode     EXCITE: vibrating, so that v_a stays above v_d",
        "force    13.50 N",
        "v_a/v_d  1.20: v_a 600 µm/s, v_d 500 µm/s, set point 0 m/s",
        "applied  37 nm at 2600 Hz",
    ):
        assert line in lines, lines


@pytest.mark.parametrize(
    ("trace", "applied", "line"),
    [
        ({"limit": wire.STALE_INPUT}, {}, "limit    STALE_INPUT: no fresh block: ramping to zero"),
        ({}, {"fallback": 1}, "answer   the rig has no fresh command and ramps the vibration to zero by itself"),
    ],
)
def test_a_stale_input_and_a_fallback_are_in_the_lines(
    config: BusConfig, trace: dict, applied: dict, line: str
) -> None:
    with Bus(config, "plant", lockstep=False) as plant, Bus(config, "controller", lockstep=False) as controller:
        plant.announce()
        controller.announce()
        assert not plant.wait_for(["plant", "controller"], PATIENCE_S)
        with publishing(plant, controller, trace, applied):
            seen, lines = look(config)
    assert seen.rig is None
    assert seen.controlled == (not applied)
    assert line in lines, lines


def test_a_rig_alone_ends_with_status_1(config: BusConfig) -> None:
    with Bus(config, "plant", lockstep=False) as plant:
        plant.announce()
        command = [*CLI, "status", "--endpoint", config.endpoint, "--json"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 1, done.stderr
    table = json.loads(done.stdout)
    assert (table["roles"], table["mode"]) == (["plant"], None)


def test_a_missing_rig_is_reported_within_a_short_time(config: BusConfig) -> None:
    with pytest.raises(Fault, match=r"no rig answered at \S+ within 0\.4 s") as raised:
        look(config)
    assert raised.value.kind is FAULTS["NO_PEER"]


def test_another_prefix_is_reported(config: BusConfig) -> None:
    with Bus(config, "plant", lockstep=False) as plant:
        plant.announce()
        with pytest.raises(
            Fault, match="neither rig nor controller is on this bus: --prefix must equal the prefix of the run"
        ):
            look(BusConfig(endpoint=config.endpoint, prefix="other"))
