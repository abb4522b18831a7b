"""The controller's process on a fake bus: lost, returning and silent rigs, floods, and the operator's commands."""

import itertools
import threading
import time
from collections.abc import Callable
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.inbox import WAITING
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.messages import sensor_block
from bridge.wire.topics import ANNOUNCE, COMMAND, CONTROLLER_EVENT, OPERATOR, PLANT_EVENT, SENSORS
from bridge.wire.zenoh_link import BusConfig
from controller.app import ControllerProcess, run
from controller.node import ControllerNode
from tests.patience import PATIENCE_S
from tests.unit.controller.fake_bus import CONFIG, END, MS, FakeBus, block, process

JOIN_S = 20.0  # shorter than the 30 s after which a controller ends by itself where its rig is gone


@pytest.fixture(autouse=True)
def never_stalled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide stalls of the test's computer from the controller; a test of stalls replaces this."""
    monkeypatch.setattr(realtime, "was_paused", lambda *_: False)


STOP = wire.Operator(action=wire.Operator.STOP, who="test").SerializeToString()


def test_a_repeated_block_is_not_fresh() -> None:
    controller, bus = process()
    stop = threading.Event()
    thread = threading.Thread(target=controller.realtime, args=(stop, ""), daemon=True)
    bus.publish(SENSORS, block(0))
    thread.start()
    wait_for(lambda: "STALE" in bus.codes())
    bus.publish(SENSORS, block(0))
    wait_for(lambda: controller._node.duplicates == 1)
    bus.leave()
    thread.join(JOIN_S)
    assert [code for code in bus.codes() if code != "REPEATED"] == ["START", "STALE", "END"]


def test_a_stall_until_the_end_of_the_run_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """No FRESH follows where the rig has left, so PAUSED may not wait for it."""
    controller, bus = process()
    monkeypatch.setattr(realtime, "was_paused", lambda *_: True)
    bus.publish(SENSORS, block(0))
    bus.leave()
    controller.realtime(threading.Event(), "")
    assert bus.codes() == ["START", "PAUSED", "END"]


def test_a_slip_at_a_drive_that_seems_at_rest_is_an_event() -> None:
    controller, bus = process()
    chance = np.random.default_rng(1)
    for number in range(220):
        sensors = np.frombuffer(bytearray(block(number)), sensor_block(20).dtype)
        slid_s = np.clip(1e-3 * (number - 200) + 5e-5 * np.arange(20), 0.0, None)
        sensors["mass_position_m"] = 0.02 * slid_s + chance.normal(0.0, 5e-7, 20)
        sensors["drive_force_N"] = 10.0 - 11700.0 * 0.02 * slid_s + chance.normal(0.0, 0.02, 20)
        bus.publish(SENSORS, sensors.tobytes())
    bus.leave()
    controller.realtime(threading.Event(), "")
    assert bus.codes() == ["START", "DRIVE_UNSEEN", "END"]


def wait_for(holds: Callable[[], bool]) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        if holds():
            return
        time.sleep(0.001)
    pytest.fail(f"did not come within {PATIENCE_S:g} s")


def publish_blocks_until(bus: FakeBus, code: str, first: int) -> None:
    numbers = itertools.count(first)

    def came() -> bool:
        bus.publish(SENSORS, block(next(numbers)))
        return code in bus.codes()

    wait_for(came)


def test_without_blocks_the_command_ramps_at_the_slew_limit() -> None:
    controller, bus = process()
    bus.publish(SENSORS, block(0))
    controller._node._state["allowed_m"] = 3e-8
    controller._node._state["allowed_Hz"] = 2600.0
    thread = threading.Thread(target=controller.realtime, args=(threading.Event(), ""), daemon=True)
    thread.start()
    wait_for(lambda: len(bus.sent[COMMAND.name]) >= 40)
    bus.leave()
    thread.join(JOIN_S)
    commands = [COMMAND_LAYOUT.read(payload, "command")[0] for payload in bus.sent[COMMAND.name]]
    assert commands[1].t_ns == 21_000_000  # silent for 20 ms
    faded_ns = next(command.t_ns for command in commands if command.amplitude_m == 0.0)
    assert faded_ns < 60_000_000  # 30 nm at 1e-6 m/s are 30 ms


@pytest.mark.slow
def test_a_stop_is_taken_however_full_the_inbox_is() -> None:
    controller, bus = process()
    for number in range(WAITING + 44):
        bus.publish(SENSORS, block(number))
    bus.publish(OPERATOR, STOP)
    bus.leave()
    stop = threading.Event()
    timer = threading.Timer(PATIENCE_S, stop.set)
    timer.start()  # ends the loop if the END of the plant is dropped
    controller.realtime(stop, "")
    timer.cancel()
    assert controller._inbox.dropped == 44
    assert bus.codes() == ["START", "FLOOD", "OPERATOR", "END"]


def test_a_rig_that_repeats_its_last_block_is_stale() -> None:
    controller, bus = process()
    controller._node._state["allowed_m"] = 3e-8
    controller._node._state["allowed_Hz"] = 2600.0
    thread = threading.Thread(target=controller.realtime, args=(threading.Event(), ""), daemon=True)
    bus.publish(SENSORS, block(0))
    thread.start()
    for _ in range(2000):
        bus.publish(SENSORS, block(0))
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
def test_a_leaving_controller_ramps_the_amplitude_down_first(why: str) -> None:
    controller, bus = process()
    stop = threading.Event()
    bus.publish(SENSORS, block(1000))
    controller._node._state["allowed_m"] = 3e-8
    controller._node._state["allowed_Hz"] = 2600.0
    if why == "stop":
        timer = threading.Timer(0.01, stop.set)
        timer.start()
        controller.realtime(stop, "")
        timer.join()
    else:
        for number in (1001, 1002, 1003, 1004):
            bus.publish(SENSORS, block(number, 2.0))
        with pytest.raises(Fault, match="CONFIG: sensors: blocks are 2 ms apart"):
            controller.realtime(stop, "")
    assert commanded_m(bus)[0] == pytest.approx(2.9e-8)
    assert commanded_m(bus)[-1] == 0.0
    assert max(abs(np.diff(commanded_m(bus)))) < 1.001e-9


def test_samples_of_nan_are_reported_at_once_and_counted() -> None:
    controller, bus = process()
    for number in range(30):
        made = sensor_block(20).blank()
        made["sequence"], made["t_ns"] = number, (number + 1) * 1_000_000
        if number in {2, 3}:
            made["base_accel_mps2"][0, 7] = np.nan
        bus.publish(SENSORS, made.tobytes())
    bus.leave()
    controller.realtime(threading.Event(), "")
    assert bus.codes() == ["START", "NOT_FINITE", "NOT_FINITE", "END"]
    assert "block 2 holds a sample" in wire.Event.FromString(bus.sent[CONTROLLER_EVENT.name][1]).text


def test_a_controller_in_lockstep_refuses_a_rig_that_does_not_wait() -> None:
    bus: Any = FakeBus()
    controller = ControllerProcess(CONFIG, ControllerNode(CONFIG), bus, lockstep=True)
    bus.publish(PLANT_EVENT, wire.Event(source="plant", code="START", text="SCHED_FIFO 50").SerializeToString())
    with pytest.raises(Fault, match=r"CONFIG: event/plant: START 'SCHED_FIFO 50': must be 'lockstep'"):
        controller.realtime(threading.Event(), "")


def test_undecodable_messages_are_dropped_and_reported_once_a_second() -> None:
    controller, bus = process()
    bus.publish(SENSORS, block(0))
    for number in range(1, 50):
        bus.publish(SENSORS, b"\xff" * 12)
        bus.publish(SENSORS, block(number))
        bus.publish(OPERATOR, b"\x08\x07")
    bus.publish(ANNOUNCE, b"\xff" * (1 << 17))
    bus.leave()
    controller.realtime(threading.Event(), "")
    assert len(bus.sent[COMMAND.name]) == 50
    reported = [(event.code, event.text) for event in bus.events()]
    assert [code for code, _ in reported] == ["START", *["BAD_MESSAGE"] * 5, "END"]
    assert (
        reported[1][1]
        == "sensors: 12 bytes cannot be decoded as SensorBlock; see bridge/wire/PROTOCOL.md for its fields: dropped"
    )
    assert reported[2][1] == "operator: action = 7: not known: dropped"
    assert reported[3][1].startswith("announce: a message of more than 65536 bytes: a Announce must be shorter")
    assert reported[4][1].endswith("(48 times, 49 in all)")


def test_blocks_of_foreign_senders_are_dropped_and_reported() -> None:
    controller, bus = process()
    for number in range(60):
        bus.publish(SENSORS, block(number))
        for foreign in (2**62, number + 10**6, max(number - 1, 0)):
            bus.publish(SENSORS, block(foreign))
    bus.leave()
    controller.realtime(threading.Event(), "")
    assert [commanded.block for commanded in bus.commands()] == list(range(60))
    codes = bus.codes()
    assert codes.count("FOREIGN") <= 2
    assert codes.count("REPEATED") <= 2
    assert {"FOREIGN", "REPEATED", "END"} <= set(codes)


@pytest.mark.slow
def test_an_end_does_not_end_the_controller_while_the_rig_stays() -> None:
    controller, bus = process()
    thread = threading.Thread(target=controller.realtime, args=(threading.Event(), ""), daemon=True)
    bus.publish(SENSORS, block(0))
    thread.start()
    bus.publish(PLANT_EVENT, END)
    publish_blocks_until(bus, "FOREIGN", 1)
    assert thread.is_alive()
    bus.leave()
    thread.join(JOIN_S)
    assert not thread.is_alive()


@pytest.mark.parametrize("link_cut", [False, True])
@pytest.mark.slow
def test_a_rig_that_leaves_without_an_end_is_reported_and_waited_for(link_cut: bool) -> None:
    """Events of a cut link would be lost, so they wait until the recorder is back."""
    controller, bus = process()
    bus.link_cut = link_cut
    stop = threading.Event()
    thread = threading.Thread(target=controller.realtime, args=(stop, ""), daemon=True)
    for number in range(1000, 1003):
        bus.publish(SENSORS, block(number))
    thread.start()
    wait_for(lambda: len(bus.sent[COMMAND.name]) > 2)
    bus.rig_left = True
    wait_for(lambda: bool(controller._rig_lost))
    wait_for(lambda: link_cut or "RIG_LOST" in bus.codes())
    assert ("RIG_LOST" in bus.codes()) != link_cut
    bus.rig_left, bus.times_came = False, 2
    publish_blocks_until(bus, "FRESH", 0)
    lost = next(event for event in bus.events() if event.code == "RIG_LOST")
    why = "the link to the rig is down" if link_cut else "the rig left the bus"
    assert lost.text == f"{why}; last block at 1.003 s; waiting for it for 30 s"
    stop.set()
    thread.join(JOIN_S)
    codes = bus.codes()
    assert codes[:6] == ["START", "STALE", "RIG_LOST", "RIG_RESTARTED", "RIG_BACK", "FRESH"]


def test_a_controller_of_another_rig_says_so_at_its_start(monkeypatch: pytest.MonkeyPatch) -> None:
    bus = MagicMock()
    bus.__enter__.return_value, bus.claim.return_value, bus.alive.return_value = bus, ("", set), False
    bus.headers.return_value = {"plant": wire.Header(role="plant", schema_version=3, configuration="{}", rig="lathe")}
    monkeypatch.setattr("controller.app.Bus", lambda *_: bus)
    monkeypatch.setattr(realtime, "claim", lambda *_: "")
    stop, lines = threading.Event(), list[str]()
    stop.set()
    for rig in ("lathe", "mill"):
        run(CONFIG, BusConfig(), wire.Header(rig=rig), False, stop, lambda *line: lines.append(" ".join(line)))
    assert [line.partition(";")[0] for line in lines if line.startswith("warning")] == [
        "warning controller: its scenario describes the rig mill, but the rig is lathe"
    ]


def test_another_rig_in_the_place_of_the_first_is_refused() -> None:
    controller, bus = process()
    bus.rig_header = wire.Header(
        role="plant", schema_version=2, configuration='{"rig": {"solver": {"block_s": 0.001, "samples_per_block": 40}}}'
    )
    faults = list[Fault]()

    def loop() -> None:
        try:
            controller.realtime(threading.Event(), "")
        except Fault as fault:
            faults.append(fault)

    thread = threading.Thread(target=loop, daemon=True)
    thread.start()
    for at_ms, number in enumerate([*range(1000, 1030), *range(30)]):
        bus.publish(SENSORS, block(number), (at_ms if number >= 1000 else 1000 + at_ms) * MS)
    assert bus.asked.wait(PATIENCE_S)
    wait_for(lambda: bool(controller._refusal))
    bus.publish(SENSORS, block(30), 2000 * MS)
    thread.join(JOIN_S)
    assert (
        str(faults[0])
        == "CONFIG: header/plant: rig.solver.samples_per_block = 40: must be controller.samples_per_block = 20; "
        "set both to the same number"
    )


def test_a_jump_of_the_clock_is_reported() -> None:
    controller, bus = process()
    for number in range(30):
        made = np.frombuffer(bytearray(block(number)), sensor_block(20).dtype)
        made["t_ns"] += 3_600_000 * MS if number >= 10 else 0
        bus.publish(SENSORS, made.tobytes())
    bus.leave()
    controller.realtime(threading.Event(), "")
    assert bus.codes() == ["START", "CLOCK", "END"]
    assert "sensors: block 10: t_ns is 3.6e+06 ms off the time that the block number gives" in bus.events()[1].text


def test_a_flood_of_stops_is_applied_and_answered_sparsely() -> None:
    controller, bus = process()
    bus.publish(SENSORS, block(0))
    for _ in range(1000):
        bus.publish(OPERATOR, STOP)
    bus.publish(SENSORS, block(1))
    bus.leave()
    controller.realtime(threading.Event(), "")
    assert [event.text for event in bus.events() if event.code == "OPERATOR"] == [
        "STOP by test",
        "STOP by test (255 times, 256 in all)",
    ]
    flood = next(event.text for event in bus.events() if event.code == "FLOOD")
    assert flood == "operator: more messages than can be answered: dropped (744 times)"
    assert controller._node._trace[0]["limit"] == wire.OPERATOR_STOP
