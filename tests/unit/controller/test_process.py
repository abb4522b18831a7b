"""The controller's process on a bus of its own making: rigs that begin anew, silence, and words that must not be missed."""

import itertools
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from bridge.faults import Fault
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.inbox import WAITING
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.messages import sensor_block
from bridge.wire.topics import ANNOUNCE, COMMAND, CONTROLLER_EVENT, OPERATOR, PLANT_EVENT, SENSORS, Topic
from bridge.wire.zenoh_link import Received
from controller.app import ControllerProcess
from controller.config import ControllerConfig
from controller.node import ControllerNode
from tests.patience import PATIENCE_S

CONFIG = validate(ControllerConfig, {}, "test")
JOIN_S = 20.0  # shorter than the 30 s after which a controller ends by itself where its rig is gone


class FakeBus:
    """Hands over what the test says, and keeps what the process sends."""

    def __init__(self) -> None:
        self.receive: dict[str, Callable[[Received], None]] = {}
        self.sent: dict[str, list[bytes]] = {}
        self.rig_left = False
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
        return True

    def headers(self, roles: list[str], _timeout_s: float, _stop: threading.Event) -> dict[str, wire.Header]:
        self.asked.set()
        return {} if self.rig_header is None else dict.fromkeys(roles, self.rig_header)

    def leave(self) -> None:
        """The rig says END and leaves."""
        self.say(PLANT_EVENT, END)
        self.rig_left = True

    def say(self, topic: Topic, payload: bytes, arrival_ns: int = 0) -> None:
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
    made.prepare()
    return made, bus


@pytest.fixture(autouse=True)
def never_stalled(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stall of the test's computer is no stall of the controller; a test of stalls replaces this."""
    monkeypatch.setattr(realtime, "was_paused", lambda *_: False)


MS = 1_000_000
END = wire.Event(source="plant", code="END").SerializeToString()
STOP = wire.Operator(action=wire.Operator.STOP, who="test").SerializeToString()


def test_a_rig_that_begins_anew_is_taken_up_again() -> None:
    node = ControllerNode(CONFIG)
    for number in range(1000, 1300):
        assert node.block(block(number), number * MS) is not None
    assert node.block(block(1299 - 255), 1300 * MS) is None
    assert node.duplicates == 1
    answered = [node.block(block(number), (1400 + number) * MS) is not None for number in range(20)]
    assert answered == [False] * 7 + [True] * 13
    assert (node.restarts, node.strays, node.last_block) == (1, 0, 19)
    assert node._trace[0]["gap_blocks"] == 0
    assert node.t_ns == 20 * MS


def test_a_rig_that_came_back_is_taken_up_at_its_first_block() -> None:
    node = ControllerNode(CONFIG)
    for number in range(100):
        node.block(block(number), number * MS)
    node.rig_was_away()
    assert node.block(block(0), 100 * MS) is not None
    assert node.restarts == 1


def test_blocks_of_another_length_are_refused() -> None:
    node = ControllerNode(CONFIG)
    node.block(block(0, 2.0))
    node.block(block(3, 2.0))  # across a gap it cannot be told
    node.stale(20)
    for number in (4, 5):  # a clock that jumps once is no other length
        node.block(block(number, 2.0))
    with pytest.raises(Fault, match=r"CONFIG: sensors: blocks are 2 ms apart: must be block_s = 0.001 s; set"):
        node.block(block(6, 2.0))


@pytest.mark.parametrize("wrong_mps", [float("nan"), float("inf"), -1e300])
def test_an_announcement_that_is_no_velocity_is_refused(wrong_mps: float) -> None:
    node = ControllerNode(CONFIG)
    said = wire.Announce(holds_from_ns=5, drive_velocity_mps=wrong_mps)
    with pytest.raises(Fault, match=r"BAD_MESSAGE: announce: drive_velocity_mps"):
        node.announcement(said.SerializeToString())
    assert node._state[0]["announced_count"] == 0


def test_a_repeated_block_is_not_fresh() -> None:
    controller, bus = process()
    stop = threading.Event()
    thread = threading.Thread(target=controller.loop, args=(stop, ""), daemon=True)
    bus.say(SENSORS, block(0))
    thread.start()
    wait_for(lambda: "STALE" in bus.codes())
    bus.say(SENSORS, block(0))
    wait_for(lambda: controller._node.duplicates == 1)
    bus.leave()
    thread.join(JOIN_S)
    assert [code for code in bus.codes() if code != "REPEATED"] == ["START", "STALE", "END"]


def test_a_stall_until_the_end_of_the_run_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was published with FRESH alone, which does not come where the rig has left."""
    controller, bus = process()
    monkeypatch.setattr(realtime, "was_paused", lambda *_: True)
    bus.say(SENSORS, block(0))
    bus.leave()
    controller.loop(threading.Event(), "")
    assert bus.codes() == ["START", "PAUSED", "END"]


def test_a_slip_of_a_drive_that_seems_to_stand_is_an_event() -> None:
    controller, bus = process()
    chance = np.random.default_rng(1)
    for number in range(220):
        sensors = np.frombuffer(bytearray(block(number)), sensor_block(20).dtype)
        slid_s = np.clip(1e-3 * (number - 200) + 5e-5 * np.arange(20), 0.0, None)
        sensors["mass_position_m"] = 0.02 * slid_s + chance.normal(0.0, 5e-7, 20)
        sensors["drive_force_N"] = 10.0 - 11700.0 * 0.02 * slid_s + chance.normal(0.0, 0.02, 20)
        bus.say(SENSORS, sensors.tobytes())
    bus.leave()
    controller.loop(threading.Event(), "")
    assert bus.codes() == ["START", "DRIVE_UNSEEN", "END"]


def wait_for(true: Callable[[], bool]) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        if true():
            return
        time.sleep(0.001)
    pytest.fail(f"did not come within {PATIENCE_S:g} s")


def say_blocks_until(bus: FakeBus, code: str, first: int) -> None:
    numbers = itertools.count(first)

    def came() -> bool:
        bus.say(SENSORS, block(next(numbers)))
        return code in bus.codes()

    wait_for(came)


def test_without_blocks_the_command_ramps_at_the_slew_limit() -> None:
    controller, bus = process()
    bus.say(SENSORS, block(0))
    controller._node._state["allowed_m"] = 3e-8
    controller._node._state["allowed_Hz"] = 2600.0
    thread = threading.Thread(target=controller.loop, args=(threading.Event(), ""), daemon=True)
    thread.start()
    wait_for(lambda: len(bus.sent[COMMAND.name]) >= 40)
    bus.leave()
    thread.join(JOIN_S)
    commands = [COMMAND_LAYOUT.read(payload, "command")[0] for payload in bus.sent[COMMAND.name]]
    assert commands[1].t_ns == 21_000_000  # silent for 20 ms
    faded_ns = next(command.t_ns for command in commands if command.amplitude_m == 0.0)
    assert faded_ns < 60_000_000  # 30 nm at 1e-6 m/s are 30 ms


def test_a_stop_is_taken_however_full_the_inbox_is() -> None:
    controller, bus = process()
    for number in range(WAITING + 44):
        bus.say(SENSORS, block(number))
    bus.say(OPERATOR, STOP)
    bus.leave()
    stop = threading.Event()
    timer = threading.Timer(PATIENCE_S, stop.set)
    timer.start()  # were the plant's END dropped, it would never come back
    controller.loop(stop, "")
    timer.cancel()
    assert controller._inbox.dropped == 44
    assert bus.codes() == ["START", "FLOOD", "OPERATOR", "END"]


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
    bus.leave()
    thread.join(JOIN_S)
    assert [code for code in bus.codes() if code != "REPEATED"] == ["START", "STALE", "END"]
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
        for number in (1001, 1002, 1003, 1004):
            bus.say(SENSORS, block(number, 2.0))
        with pytest.raises(Fault, match="CONFIG: sensors: blocks are 2 ms apart"):
            controller.loop(stop, "")
    assert commanded_m(bus)[0] == pytest.approx(2.9e-8)
    assert commanded_m(bus)[-1] == 0.0
    assert max(abs(np.diff(commanded_m(bus)))) < 1.001e-9


def test_samples_that_are_no_numbers_are_said_once() -> None:
    controller, bus = process()
    for number in range(30):
        made = sensor_block(20).blank()
        made["sequence"], made["t_ns"] = number, (number + 1) * 1_000_000
        if number in {2, 3}:
            made["base_accel_mps2"][0, 7] = np.nan
        bus.say(SENSORS, made.tobytes())
    bus.leave()
    controller.loop(threading.Event(), "")
    assert bus.codes() == ["START", "NOT_FINITE", "FRESH", "END"]
    assert "block 2 holds a sample" in wire.Event.FromString(bus.sent[CONTROLLER_EVENT.name][1]).text


def test_a_controller_in_lockstep_refuses_a_rig_that_does_not_wait() -> None:
    bus: Any = FakeBus()
    controller = ControllerProcess(CONFIG, ControllerNode(CONFIG), bus, lockstep=True)
    controller.prepare()
    bus.say(PLANT_EVENT, wire.Event(source="plant", code="START", text="SCHED_FIFO 50").SerializeToString())
    with pytest.raises(Fault, match=r"CONFIG: event/plant: START 'SCHED_FIFO 50': must be 'lockstep'"):
        controller.loop(threading.Event(), "")


def test_what_cannot_be_read_is_dropped_and_told_once_a_second() -> None:
    controller, bus = process()
    bus.say(SENSORS, block(0))
    for number in range(1, 50):
        bus.say(SENSORS, b"\xff" * 12)
        bus.say(SENSORS, block(number))
        bus.say(OPERATOR, b"\x08\x07")
    bus.say(ANNOUNCE, b"\xff" * (1 << 17))
    bus.leave()
    controller.loop(threading.Event(), "")
    assert len(bus.sent[COMMAND.name]) == 50
    told = [(event.code, event.text) for event in bus.events()]
    assert [code for code, _ in told] == ["START", *["BAD_MESSAGE"] * 5, "END"]
    assert (
        told[1][1]
        == "sensors: 12 bytes cannot be decoded as SensorBlock; see bridge/wire/PROTOCOL.md for its fields: dropped"
    )
    assert told[2][1] == "operator: action = 7: not known: dropped"
    assert told[3][1].startswith("announce: a message of more than 65536 bytes: a Announce must be shorter")
    assert told[4][1].endswith("(48 times, 49 in all)")


def test_strangers_blocks_are_dropped_and_told() -> None:
    controller, bus = process()
    for number in range(60):
        bus.say(SENSORS, block(number))
        for strange in (2**62, number + 10**6, max(number - 1, 0)):
            bus.say(SENSORS, block(strange))
    bus.leave()
    controller.loop(threading.Event(), "")
    assert [commanded.block for commanded in bus.commands()] == list(range(60))
    codes = bus.codes()
    assert codes.count("FOREIGN") <= 2
    assert codes.count("REPEATED") <= 2
    assert {"FOREIGN", "REPEATED", "END"} <= set(codes)


def test_an_end_of_a_rig_that_stays_ends_nobody() -> None:
    controller, bus = process()
    thread = threading.Thread(target=controller.loop, args=(threading.Event(), ""), daemon=True)
    bus.say(SENSORS, block(0))
    thread.start()
    bus.say(PLANT_EVENT, END)
    say_blocks_until(bus, "FOREIGN", 1)
    assert thread.is_alive()
    bus.leave()
    thread.join(JOIN_S)
    assert not thread.is_alive()


def test_a_rig_that_leaves_without_an_end_is_waited_for_and_told_rightly() -> None:
    controller, bus = process()
    stop = threading.Event()
    thread = threading.Thread(target=controller.loop, args=(stop, ""), daemon=True)
    for number in range(1000, 1003):
        bus.say(SENSORS, block(number))
    thread.start()
    wait_for(lambda: len(bus.sent[COMMAND.name]) > 2)
    bus.rig_left = True
    wait_for(lambda: "RIG_LOST" in bus.codes())
    lost = next(event for event in bus.events() if event.code == "RIG_LOST")
    assert lost.text == "the rig left the bus; last block at 1.003 s; waiting for it for 30 s"
    bus.rig_left, bus.times_came = False, 2
    say_blocks_until(bus, "FRESH", 0)
    stop.set()
    thread.join(JOIN_S)
    codes = bus.codes()
    assert codes[:6] == ["START", "STALE", "RIG_LOST", "RIG_RESTARTED", "RIG_BACK", "FRESH"]


def test_another_rig_in_the_place_of_the_first_is_refused() -> None:
    controller, bus = process()
    bus.rig_header = wire.Header(
        role="plant", schema_version=2, configuration='{"rig": {"solver": {"block_s": 0.001, "samples_per_block": 40}}}'
    )
    found = list[Fault]()

    def loop() -> None:
        try:
            controller.loop(threading.Event(), "")
        except Fault as fault:
            found.append(fault)

    thread = threading.Thread(target=loop, daemon=True)
    thread.start()
    for at_ms, number in enumerate([*range(1000, 1030), *range(30)]):
        bus.say(SENSORS, block(number), (at_ms if number >= 1000 else 1000 + at_ms) * MS)
    assert bus.asked.wait(PATIENCE_S)
    wait_for(lambda: bool(controller._rig_again._refusal))
    bus.say(SENSORS, block(30), 2000 * MS)
    thread.join(JOIN_S)
    assert (
        str(found[0])
        == "CONFIG: header/plant: rig.solver.samples_per_block = 40: must be controller.samples_per_block = 20; "
        "set both to the same number"
    )


def test_a_clock_that_jumps_is_told() -> None:
    controller, bus = process()
    for number in range(30):
        made = np.frombuffer(bytearray(block(number)), sensor_block(20).dtype)
        made["t_ns"] += 3_600_000 * MS if number >= 10 else 0
        bus.say(SENSORS, made.tobytes())
    bus.leave()
    controller.loop(threading.Event(), "")
    assert bus.codes() == ["START", "CLOCK", "END"]
    assert "sensors: block 10: t_ns is 3.6e+06 ms off the block number" in bus.events()[1].text


def test_a_flood_of_an_operators_words_is_obeyed_and_answered_sparsely() -> None:
    controller, bus = process()
    bus.say(SENSORS, block(0))
    for _ in range(1000):
        bus.say(OPERATOR, STOP)
    bus.say(SENSORS, block(1))
    bus.leave()
    controller.loop(threading.Event(), "")
    assert bus.codes().count("OPERATOR") == 1
    flood = next(event.text for event in bus.events() if event.code == "FLOOD")
    assert flood == "operator: more messages than can be answered: dropped (744 times)"
    assert controller._node._trace[0]["limit"] == wire.OPERATOR_STOP
