"""The rig's process takes a stop by file, and a flood of orders costs one event a second."""

import threading
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.guard.keeper import Keeper
from bridge.guard.kept import StopLatch
from bridge.guard.states import HOLD
from bridge.guard.stop_file import RigFile, confirmed, order
from bridge.rig.process import GuardedRig, serve
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.bus_config import BusConfig
from bridge.wire.inbox import Received
from bridge.wire.messages import APPLIED
from bridge.wire.topics import OPERATOR, Outgoing
from cockpit.run.scenario import load_rig
from plant.rig.node import PlantNode, served
from tests.unit.plant.test_fade import Commanded, Wire

HERE = "tcp/127.0.0.1:7447"


class Stopped(Commanded):
    """A rig that vibrates; before its block 40 an operator stops it by file."""

    keeper: Keeper
    orders: Any = None

    def advance(self, commands: list[bytes], *times: int) -> tuple[Outgoing, Outgoing]:
        if self.block == 40:
            self.orders = order(HERE, "Ada")
        self.keeper._look()
        return super().advance(commands, *times)


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Keeper:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    rig = RigFile("lathe", HERE)
    rig.make(1)
    return Keeper(StopLatch("lathe"), rig)


def events(bus: Any) -> list[str]:
    made = [wire.Event.FromString(payload) for payload in bus.sent["event/plant"]]
    return [f"{event.code} {event.text}" for event in made]


def test_a_stop_by_file_ramps_the_vibration_down_and_is_confirmed(kept: Keeper) -> None:
    node = Stopped(load_rig("paper-c45-c45", []), 1, arm=True)
    node.keeper = kept
    bus: Any = Wire()
    GuardedRig(node, bus, kept).realtime(90, threading.Event())
    applied = np.frombuffer(b"".join(bus.sent["applied"]), APPLIED.dtype)
    assert applied["amplitude_m"][40] == pytest.approx(3e-8)
    assert (applied["guard_state"][42], applied["cause"][42]) == (wire.FAULT, wire.STOP_BY_PERSON)
    assert applied["amplitude_m"][75] == 0.0
    assert confirmed(node.orders, 0.0)
    assert "OPERATOR STOP by Ada, by file" in events(bus)


def test_a_stop_file_that_exists_holds_a_rig_that_is_not_stopped(kept: Keeper) -> None:
    """The file came while the rig compiled, after the rig had looked for one: the rig vibrated with the file on the disk."""
    order(HERE, "Ada")
    node = PlantNode(load_rig("paper-c45-c45", []), 1, arm=True)
    bus: Any = Wire()
    process = GuardedRig(node, bus, kept)
    kept._look()
    for _ in range(2):
        process._apply_orders()
        kept._look()
    assert (node.is_stopped, events(bus)) == (True, ["OPERATOR STOP by Ada, by file"])
    reset = wire.Operator(action="RESET", who="Ada").SerializeToString()
    process._operator_orders.push(Received(OPERATOR, reset, 0))
    for _ in range(2):
        process._apply_orders()
        kept._look()
    assert (node.is_stopped, kept.latch.is_set) == (False, False)


def test_a_stop_of_an_earlier_run_keeps_its_cause(kept: Keeper) -> None:
    order(HERE, "Ada")
    node, bus = PlantNode(load_rig("paper-c45-c45", []), 1, arm=True), Wire()
    process = GuardedRig(node, cast(Any, bus), kept)
    node.apply_order(HOLD)
    kept._look()
    process._apply_orders()
    assert (node._guard_state["cause"][0], kept.holder, bus.sent["event/plant"]) == (wire.STOP_KEPT, "Ada", [])


def test_a_flood_of_orders_is_one_event_for_each_action_and_no_thread(kept: Keeper) -> None:
    bus: Any = Wire()
    node = Stopped(load_rig("paper-c45-c45", []), 1, arm=True)
    process = GuardedRig(node, bus, kept)
    threads = threading.active_count()
    for _ in range(200):
        for action in ("STOP", "RESET"):
            order = wire.Operator(action=action, who="Eve").SerializeToString()
            process._operator_orders.push(Received(OPERATOR, order, 0))
        process._apply_orders()
    assert events(bus) == ["OPERATOR STOP by Eve", "OPERATOR RESET by Eve"]
    assert threading.active_count() == threads
    process.end()
    assert events(bus)[2:4] == [f"OPERATOR {action} by Eve (199 times, 200 in all)" for action in ("STOP", "RESET")]


def test_a_second_rig_of_a_name_is_refused(kept: Keeper) -> None:
    config, unused = load_rig("paper-c45-c45", ["name=lathe"]), threading.Event()
    other = BusConfig(endpoint="tcp/127.0.0.1:7448")
    with pytest.raises(
        Fault, match=rf"'lathe': a rig of this name runs at {HERE}: .*another name \(--set rig.name=WORD\)"
    ):
        serve(served(config, 1, arm=True), 1.0, other, wire.Header(), [], False, unused, kept.latch)
