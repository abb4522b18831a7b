"""A bus without a network, and the controller's process on it."""

import threading
from collections.abc import Callable
from typing import Any

from bridge.config import validate
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.messages import sensor_block
from bridge.wire.topics import COMMAND, CONTROLLER_EVENT, PLANT_EVENT, Topic
from bridge.wire.zenoh_link import Received
from controller.app import ControllerProcess
from controller.config import ControllerConfig
from controller.node import ControllerNode

CONFIG = validate(ControllerConfig, {}, "test")
MS = 1_000_000
END = wire.Event(source="plant", code="END").SerializeToString()


class FakeBus:
    """Delivers the messages of a test to the process and keeps its messages."""

    def __init__(self) -> None:
        self.receive: dict[str, Callable[[Received], None]] = {}
        self.sent: dict[str, list[bytes]] = {}
        self.rig_left = self.link_cut = False
        self.times_came = 1
        self.rig_header: wire.Header | None = None
        self.asked = threading.Event()

    def publisher(self, topic: Topic) -> Callable[[bytes], None]:
        return self.sent.setdefault(topic.name, []).append

    def listen(self, topic: Topic, receive: Callable[[Received], None]) -> None:
        self.receive[topic.name] = receive

    def alive(self, _: str) -> bool:
        return not self.rig_left

    def came(self, _: str) -> int:
        return self.times_came

    def linked(self) -> bool:
        return not self.link_cut

    def headers(self, roles: list[str], _timeout_s: float, _stop: threading.Event) -> dict[str, wire.Header]:
        self.asked.set()
        return {} if self.rig_header is None else dict.fromkeys(roles, self.rig_header)

    def leave(self) -> None:
        """Publish END of the rig and take it off the bus."""
        self.publish(PLANT_EVENT, END)
        self.rig_left = True

    def publish(self, topic: Topic, payload: bytes, arrival_ns: int = 0) -> None:
        self.receive[topic.name](Received(topic, payload, arrival_ns))

    def events(self) -> list[wire.Event]:
        return [wire.Event.FromString(payload) for payload in self.sent[CONTROLLER_EVENT.name]]

    def codes(self) -> list[str]:
        return [event.code for event in self.events()]

    def commands(self) -> list[Any]:
        return [COMMAND_LAYOUT.read(payload, "command")[0] for payload in self.sent[COMMAND.name]]


def block(number: int, length_ms: float = 1.0) -> bytes:
    sensors = sensor_block(20).blank()
    sensors["sequence"], sensors["t_ns"] = number, min((number + 1) * round(length_ms * 1e6), 2**62)
    return sensors.tobytes()


def process() -> tuple[Any, FakeBus]:
    bus: Any = FakeBus()
    node: Any = ControllerNode(CONFIG)
    node.age.note = lambda *_: None  # no block is late: how long the steps take depends on the computer
    made = ControllerProcess(CONFIG, node, bus, lockstep=False)
    return made, bus
