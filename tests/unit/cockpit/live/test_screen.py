"""The screen of a terminal: all of the state in words, and dashes for what is not known."""

import collections

import pytest
from rich.console import Console

from bridge.wire import stickslip_pb2 as wire
from cockpit.live.screen import screen_of
from cockpit.live.view import EventRow, View
from tests.unit.cockpit.live.made import Rig


def shown(view: View, events: collections.deque[EventRow]) -> str:
    console = Console(width=120, height=40, color_system=None)
    with console.capture() as caught:
        console.print(screen_of(view.now(), events, console.height))
    return caught.get()


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_a_live_rig_is_told_in_words(rig: Rig) -> None:
    view = View(rig, "tcp/127.0.0.1:7447", rig.clock)
    for number in range(30):
        rig.block(number, 12.5)
        rig.answer(number, breakaway_force_N=17.4)
        rig.applied(number, amplitude_m=2e-8, frequency_Hz=2600.0)
    rig.event("GUARD", "ARMED -> ACTIVE")
    words = shown(view, collections.deque(view.step().events))
    for part in (
        "no slip in the last 0 s; EXCITE: vibrating",
        "rig lathe; on the bus: controller, plant, recorder",
        "12.50 N, breaks away at 17.40 N",
        "1.20: v_a 600 µm/s, v_d 500 µm/s",
        "20 nm of 100 nm at 2600 Hz",
        "reason     HELD: vibrating, because it was needed",
        "next slip  none expected",
        "GUARD (C): ARMED -> ACTIVE",
    ):
        assert part in words, words


def test_of_a_rig_that_is_silent_there_are_no_figures(rig: Rig) -> None:
    view = View(rig, "tcp/127.0.0.1:7447", rig.clock)
    rig.blocks(range(30))
    view.step()
    rig.now_s += 2.0
    words = shown(view, collections.deque())
    assert words.startswith("no data for 2 s")
    assert "no rig connected" in words
    assert wire.Mode.Name(wire.EXCITE) not in words
    assert "500" not in words
