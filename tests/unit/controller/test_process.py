"""The controller's process on a bus of its own making: rigs that begin anew, silence, and words that must not be missed."""

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.messages import sensor_block
from bridge.wire.topics import COMMAND, CONTROLLER_EVENT, OPERATOR, PLANT_EVENT, SENSORS, Topic
from bridge.wire.zenoh_link import Received
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


def test_a_slip_of_a_drive_that_seems_to_stand_is_an_event() -> None:
    controller, bus = process()
    chance = np.random.default_rng(1)
    for number in range(220):
        sensors = np.frombuffer(bytearray(block(number)), sensor_block(20).dtype)
        slid_s = np.clip(1e-3 * (number - 200) + 5e-5 * np.arange(20), 0.0, None)
        sensors["mass_position_m"] = 0.02 * slid_s + chance.normal(0.0, 5e-7, 20)
        sensors["drive_force_N"] = 10.0 - 11700.0 * 0.02 * slid_s + chance.normal(0.0, 0.02, 20)
        bus.say(SENSORS, sensors.tobytes())
    bus.say(PLANT_EVENT, END)
    controller.loop(threading.Event(), "")
    assert bus.codes() == ["START", "DRIVE_UNSEEN", "END"]


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


def test_a_rig_that_repeats_its_last_block_is_stale() -> None:
    controller, bus = process()
    controller._node._state["allowed_m"] = 3e-8
    controller._node._state["allowed_Hz"] = 2600.0
    thread = threading.Thread(target=controller.loop, args=(threading.Event(), ""), daemon=True)
    bus.say(SENSORS, block(0))
    thread.start()
    for _ in range(2000):
        bus.say(SENSORS, block(0))
        if bus.sent[COMMAND.name] and commanded_m(bus)[-1] == 0.0:
            break
        time.sleep(0.001)
    bus.say(PLANT_EVENT, END)
    thread.join(5.0)
    assert bus.codes() == ["START", "STALE", "END"]
    assert commanded_m(bus)[-1] == 0.0
    assert max(abs(np.diff(commanded_m(bus)))) < 1.001e-9


def commanded_m(bus: FakeBus) -> list[float]:
    return [float(COMMAND_LAYOUT.read(payload, "command")[0].amplitude_m) for payload in bus.sent[COMMAND.name]]


@pytest.mark.parametrize("why", ["stop", "fault"])
def test_who_leaves_takes_the_amplitude_down_first(why: str) -> None:
    controller, bus = process()
    stop = threading.Event()
    bus.say(SENSORS, block(1000))
    controller._node._state["allowed_m"] = 3e-8
    controller._node._state["allowed_Hz"] = 2600.0
    if why == "stop":
        timer = threading.Timer(0.01, stop.set)
        timer.start()
        controller.loop(stop, "")
        timer.join()
    else:
        bus.say(SENSORS, block(0))
        with pytest.raises(Fault, match="BAD_MESSAGE"):
            controller.loop(stop, "")
    assert commanded_m(bus)[0] == pytest.approx(2.9e-8)
    assert commanded_m(bus)[-1] == 0.0
    assert max(abs(np.diff(commanded_m(bus)))) < 1.001e-9


def test_samples_that_are_no_numbers_are_said_once() -> None:
    controller, bus = process()
    for number in range(6):
        made = sensor_block(20).blank()
        made["sequence"], made["t_ns"] = number, (number + 1) * 1_000_000
        if number in {2, 3}:
            made["base_accel_mps2"][0, 7] = np.nan
        bus.say(SENSORS, made.tobytes())
    bus.say(PLANT_EVENT, END)
    controller.loop(threading.Event(), "")
    assert bus.codes() == ["START", "NOT_FINITE", "FRESH", "END"]
    assert "block 2 holds a sample" in wire.Event.FromString(bus.sent[CONTROLLER_EVENT.name][1]).text


def test_a_controller_in_lockstep_refuses_a_rig_that_does_not_wait() -> None:
    bus: Any = FakeBus()
    controller = _Process(CONFIG, ControllerNode(CONFIG), bus, lockstep=True)
    controller.prepare()
    bus.say(PLANT_EVENT, wire.Event(source="plant", code="START", text="SCHED_FIFO 50").SerializeToString())
    with pytest.raises(Fault, match=r"CONFIG: event/plant: START says 'SCHED_FIFO 50': must say 'lockstep'"):
        controller.loop(threading.Event(), "")
