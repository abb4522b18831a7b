"""On every way out of its loop the rig's process fades the vibration to zero first."""

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from bridge.rig.process import GuardedRig
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import APPLIED, COMMAND
from bridge.wire.topics import Outgoing, Topic
from cockpit.run.scenario import load_rig
from plant.rig.node import PlantNode


class Wire:
    """Collects sent messages."""

    def __init__(self) -> None:
        self.sent: dict[str, list[bytes]] = {}

    def publisher(self, topic: Topic) -> Callable[[bytes], None]:
        return self.sent.setdefault(topic.name, []).append

    def listen(self, topic: Topic, receive: Any) -> None:
        pass

    def withdraw(self) -> None:
        pass

    def expiring(self) -> str:
        return ""


class Commanded(PlantNode):
    """A rig whose controller wants 30 nm, until it fails at a block."""

    fails_at = 10**9
    failed = False
    run_of_controller = 1
    stops: threading.Event | None = None  # set after 60 blocks

    def advance(self, _commands: list[bytes], *times: int) -> tuple[Outgoing, Outgoing]:
        if self.block == self.fails_at and not self.failed:
            self.failed = True
            raise RuntimeError("the converter is gone")
        if self.block == 59 and self.stops is not None:
            self.stops.set()
        wanted = COMMAND.blank()
        wanted["run"], wanted["sequence"], wanted["block"] = self.run_of_controller, self.block, max(self.block - 1, 0)
        wanted["frequency_Hz"], wanted["amplitude_m"] = 2600.0, 3e-8
        return super().advance([wanted.tobytes()] if self.block and not self.failed else [], *times)


def left(node: Commanded, blocks: int, stop: threading.Event, lockstep: bool) -> Any:
    """The applied amplitude of each block, to the end of the process."""
    bus: Any = Wire()
    process = GuardedRig(node, bus, None)
    process._answer = lambda _block, _stop: b""
    advance = process.lockstep if lockstep else process.realtime
    if node.fails_at < blocks:
        with pytest.raises(RuntimeError, match="converter"):
            advance(blocks, stop)
    else:
        advance(blocks, stop)
    return np.frombuffer(b"".join(bus.sent["applied"]), APPLIED.dtype)


@pytest.mark.parametrize("lockstep", [False, True])
@pytest.mark.parametrize("way", ["end", "fault"])
def test_the_vibration_fades_at_its_own_rate_before_the_process_ends(way: str, lockstep: bool) -> None:
    node = Commanded(load_rig("paper-c45-c45", []), 1, arm=True)
    node.warm_up()
    if way == "fault":
        node.fails_at = 60
    stop = threading.Event()
    if way == "end" and lockstep:  # a whole run in lockstep has no fade
        node.stops = stop
    applied = left(node, 60 if way == "end" and not lockstep else 100, stop, lockstep)
    assert applied["amplitude_m"][59] == pytest.approx(3e-8)
    assert applied["amplitude_m"][-1] == 0.0
    assert len(applied) == pytest.approx(90, abs=2)
    assert np.diff(applied["amplitude_m"]).min() > -1.001e-9
    assert applied["guard_state"][-1] == wire.DISARMED
    assert applied["cause"][-1] == wire.RUN_ENDED


def test_a_stall_that_no_command_follows_is_reported_at_the_end() -> None:
    """It was published with the next command alone, which a rig without a controller never gets."""
    bus: Any = Wire()
    process = GuardedRig(PlantNode(load_rig("paper-c45-c45", []), 1), bus, None)
    process._paused_ns = 300_000_000
    process.end()
    events = [wire.Event.FromString(payload) for payload in bus.sent["event/plant"]]
    assert [event.code for event in events] == ["PAUSED", "END"]
    assert events[0].text.startswith("this rig stalled for 0.30 s")


def test_a_controller_of_another_run_moves_nothing_and_is_reported() -> None:
    node = Commanded(load_rig("paper-c45-c45", []), 1, arm=True)
    node.run_of_controller = 2
    bus: Any = Wire()
    GuardedRig(node, bus, None).realtime(50, threading.Event())
    assert np.frombuffer(b"".join(bus.sent["applied"]), APPLIED.dtype)["amplitude_m"].max() == 0.0
    events = [wire.Event.FromString(payload) for payload in bus.sent["event/plant"]]
    assert any(event.code == "FOREIGN" and "of another run" in event.text for event in events)
