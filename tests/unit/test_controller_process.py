"""The controller's process on a bus of its own making: rigs that begin anew, silence, and words that must not be missed."""

import threading
from collections.abc import Callable
from typing import Any

import pytest

from bridge import stickslip_pb2 as wire
from bridge.config import validate
from bridge.faults import Fault
from bridge.messages import COMMAND as COMMAND_LAYOUT
from bridge.messages import sensor_block
from bridge.topics import COMMAND, CONTROLLER_EVENT, OPERATOR, PLANT_EVENT, SENSORS, Topic
from bridge.zenoh_link import Received
from controller.app import _Process
from controller.config import ControllerConfig
from controller.node import ControllerNode

CONFIG = validate(ControllerConfig, {}, "test")


class FakeBus:
    """Hands over what the test says, and keeps what the process sends."""

    def __init__(self) -> None:
        self.receive: dict[str, Callable[[Received], None]] = {}
        self.sent: dict[str, list[bytes]] = {}

    def publisher(self, topic: Topic) -> Callable[[bytes], None]:
        return self.sent.setdefault(topic.name, []).append

    def listen(self, topic: Topic, receive: Callable[[Received], None]) -> None:
        self.receive[topic.name] = receive

    def alive(self, _: str) -> bool:
        return True

    def say(self, topic: Topic, payload: bytes) -> None:
        self.receive[topic.name](Received(topic, payload, 0))

    def codes(self) -> list[str]:
        return [wire.Event.FromString(payload).code for payload in self.sent[CONTROLLER_EVENT.name]]


def block(number: int, length_ms: float = 1.0) -> bytes:
    sensors = sensor_block(20).blank()
    sensors["sequence"], sensors["t_ns"] = number, (number + 1) * round(length_ms * 1e6)
    return sensors.tobytes()


def process() -> tuple[Any, FakeBus]:
    bus: Any = FakeBus()
    made = _Process(CONFIG, ControllerNode(CONFIG), bus, lockstep=False)
    made.prepare()
    return made, bus


END = wire.Event(source="plant", code="END").SerializeToString()
STOP = wire.Operator(action=wire.Operator.STOP, who="test").SerializeToString()


def test_a_rig_that_begins_anew_is_not_taken_for_duplicates() -> None:
    node = ControllerNode(CONFIG)
    for number in range(1000, 1300):
        assert node.block(block(number)) is not None
    assert node.block(block(1299 - 255)) is None
    assert node.duplicates == 1
    with pytest.raises(Fault, match=r"BAD_MESSAGE: sensors: block 0 after block 1299: must count up.*restart"):
        node.block(block(0))


def test_blocks_of_another_length_are_refused() -> None:
    node = ControllerNode(CONFIG)
    node.block(block(0, 2.0))
    node.block(block(3, 2.0))  # across a gap it cannot be told
    node.stale(20)
    with pytest.raises(Fault, match=r"CONFIG: sensors: blocks are 2 ms apart: must be block_s = 0.001 s; set"):
        node.block(block(4, 2.0))


def test_a_repeated_block_is_not_fresh() -> None:
    controller, bus = process()
    stop = threading.Event()
    thread = threading.Thread(target=controller.loop, args=(stop, ""), daemon=True)
    bus.say(SENSORS, block(0))
    thread.start()
    wait_for(lambda: "STALE" in bus.codes())
    bus.say(SENSORS, block(0))
    wait_for(lambda: controller._node.duplicates == 1)
    bus.say(PLANT_EVENT, END)
    thread.join(5.0)
    assert bus.codes() == ["START", "STALE", "END"]


def wait_for(true: Callable[[], bool]) -> None:
    pause = threading.Event()
    for _ in range(5000):
        if true():
            return
        pause.wait(0.001)
    pytest.fail("did not come within 5 s")


def test_without_blocks_the_command_ramps_at_the_slew_limit() -> None:
    controller, bus = process()
    bus.say(SENSORS, block(0))
    controller._node._state["allowed_m"] = 3e-8
    controller._node._state["allowed_Hz"] = 2600.0
    thread = threading.Thread(target=controller.loop, args=(threading.Event(), ""), daemon=True)
    thread.start()
    wait_for(lambda: len(bus.sent[COMMAND.name]) >= 40)
    bus.say(PLANT_EVENT, END)
    thread.join(5.0)
    commands = [COMMAND_LAYOUT.read(payload, "command")[0] for payload in bus.sent[COMMAND.name]]
    assert commands[1].t_ns == 21_000_000  # silent for 20 ms
    faded_ns = next(command.t_ns for command in commands if command.amplitude_m == 0.0)
    assert faded_ns < 60_000_000  # 30 nm at 1e-6 m/s are 30 ms


def test_a_stop_is_taken_however_full_the_inbox_is() -> None:
    controller, bus = process()
    for number in range(300):
        bus.say(SENSORS, block(number))
    bus.say(OPERATOR, STOP)
    bus.say(PLANT_EVENT, END)
    stop = threading.Event()
    timer = threading.Timer(5.0, stop.set)
    timer.start()  # were the plant's END dropped, it would never come back
    controller.loop(stop, "")
    timer.cancel()
    assert controller._inbox.dropped == 300 - 256
    assert bus.codes() == ["START", "OPERATOR", "END"]
