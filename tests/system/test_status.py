"""`stickslip status`: what it says of a bus, and that it says nothing to the bus."""

import json
import subprocess
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager

import pytest

from bridge.faults import FAULTS, Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.topics import APPLIED, COMMAND, CONTROLLER_EVENT, OPERATOR, STATE
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from cockpit.run.status import look
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint

CLI = [sys.executable, "-m", "cockpit"]
HEADER = wire.Header(role="plant", configuration=json.dumps({"rig": {"name": "lathe"}}))
SENT = {
    STATE: wire.State(
        t_ns=12_300_000_000,
        drive_force_N=13.5,
        drive_velocity_mps=5e-4,
        vibration_velocity_mps=6e-4,
        velocity_ratio=1.2,
        state=wire.SMOOTH,
        slips=5,
    ),
    COMMAND: wire.Command(mode=wire.EXCITE, reason=wire.HELD, limit=wire.SLEW),
    APPLIED: wire.Applied(frequency_Hz=2600.0, amplitude_m=37e-9, guard_state=wire.ACTIVE, cause=wire.VIBRATION_BEGAN),
    CONTROLLER_EVENT: wire.Event(source="controller", code="GAP", text="3 blocks"),
}


@contextmanager
def publishing(plant: Bus, controller: Bus, messages: dict) -> Generator[None]:
    """Say everything again and again, as a loop does; each may say its own topics alone."""
    over = threading.Event()

    def say() -> None:
        while not over.wait(0.02):
            for topic, message in messages.items():
                senders[topic](message.SerializeToString())

    senders = {topic: (plant if topic.sender == "plant" else controller).publisher(topic) for topic in messages}
    thread = threading.Thread(target=say)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.fixture
def config() -> BusConfig:
    return BusConfig(endpoint=free_endpoint())


def test_a_rig_and_its_controller_are_told(config: BusConfig) -> None:
    said = Inbox(10)
    with Bus(config, "plant", lockstep=False) as plant, Bus(config, "controller", lockstep=False) as controller:
        plant.serve_header(HEADER)
        plant.listen(OPERATOR, said.keep)
        plant.announce()
        controller.announce()
        assert not plant.wait_for(["plant", "controller"], PATIENCE_S)
        with publishing(plant, controller, SENT):
            seen = look(config)
        assert said.get_nowait() is None
        assert not plant.alive("status")
    assert (seen.rig, seen.roles, seen.controlled) == ("lathe", ["plant", "controller"], True)
    assert (seen.mode, seen.reason, seen.limit, seen.contact) == ("EXCITE", "HELD", "SLEW", "SMOOTH")
    assert seen.events[0] == "controller GAP: 3 blocks"
    words = "\n".join(seen.in_words())
    assert f"rig      lathe at {config.endpoint}" in words
    assert "on bus   plant, controller; no recorder" in words
    assert "state    ACTIVE: it vibrates" in words
    assert "mode     EXCITE: vibrating, so that v_a stays above v_d" in words
    assert "drive    500 µm/s against 13.50 N" in words
    assert "v_a/v_d  1.20" in words
    assert "applied  37 nm at 2600 Hz" in words
    assert "warning  nothing is recorded" in words


@pytest.mark.parametrize(
    ("messages", "warning"),
    [
        ({}, "the controller sent no command for 0.3 s"),
        (SENT | {COMMAND: wire.Command(mode=wire.EXCITE, limit=wire.STALE_INPUT)}, "STALE_INPUT: no fresh block"),
        (
            SENT | {APPLIED: wire.Applied(fallback=1, guard_state=wire.ACTIVE)},
            "the rig has no fresh command and ramps the vibration to zero",
        ),
    ],
)
def test_what_is_wrong_is_a_warning(config: BusConfig, messages: dict, warning: str) -> None:
    with Bus(config, "plant", lockstep=False) as plant, Bus(config, "controller", lockstep=False) as controller:
        plant.announce()
        controller.announce()
        assert not plant.wait_for(["plant", "controller"], PATIENCE_S)
        with publishing(plant, controller, messages):
            seen = look(config)
    assert seen.rig is None
    assert seen.warnings()[0].startswith(warning)


def test_a_rig_alone_ends_with_status_1(config: BusConfig) -> None:
    with Bus(config, "plant", lockstep=False) as plant:
        plant.announce()
        command = [*CLI, "status", "--endpoint", config.endpoint, "--json"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 1, done.stderr
    table = json.loads(done.stdout)
    assert (table["roles"], table["mode"]) == (["plant"], None)


def test_nobody_is_told_soon(config: BusConfig) -> None:
    with pytest.raises(Fault, match=r"no rig answered within 0\.4 s") as raised:
        look(config)
    assert raised.value.kind is FAULTS["NO_PEER"]


def test_another_prefix_is_told(config: BusConfig) -> None:
    with Bus(config, "plant", lockstep=False) as plant:
        plant.announce()
        with pytest.raises(
            Fault, match="neither rig nor controller is on this bus: --prefix must equal the prefix of the run"
        ):
            look(BusConfig(endpoint=config.endpoint, prefix="other"))
