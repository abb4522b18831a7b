"""The screen of a terminal: the whole state in words, and dashes for unknown values."""

import collections

from rich.console import Console

from bridge.wire import stickslip_pb2 as wire
from cockpit.live.frame_words import frame_lines
from cockpit.live.screen import screen_of
from cockpit.live.view import EventRow, View
from tests.unit.cockpit.live.made import Rig


def shown(view: View, events: collections.deque[EventRow]) -> str:
    console = Console(width=120, height=40, color_system=None)
    with console.capture() as caught:
        console.print(screen_of(view.now(), events, console.height))
    return caught.get()


def test_a_live_rig_is_described_in_words(rig: Rig) -> None:
    view = View(rig, "tcp/127.0.0.1:7447", rig.clock)
    for number in range(30):
        rig.block(number, 12.5)
        rig.answer(number, breakaway_force_N=17.4)
        rig.applied(number, amplitude_m=2e-8, frequency_Hz=2600.0)
    rig.event("GUARD", "ARMED -> ACTIVE")
    words = shown(view, collections.deque(view.step().events))
    for part in (
        "EXCITE: vibrating, so that v_a stays above v_d",
        "lathe at tcp/127.0.0.1:7447",
        "plant, controller, recorder",
        "12.50 N, breaks away at 17.40 N",
        "1.20: v_a 600 µm/s, v_d 500 µm/s",
        "20 nm of 100 nm at 2600 Hz",
        "reason    STICK_SEEN: vibrating, because the contact sticks",
        "forecast  no slip expected",
        "GUARD (check): ARMED -> ACTIVE",
    ):
        assert part in words, words


def test_a_controller_of_another_rig_is_a_warning(rig: Rig) -> None:
    view = View(rig, "tcp/127.0.0.1:7447", rig.clock)
    assert not any(line.startswith("warning") for line in frame_lines(view.now(), []))
    rig.rigs["controller"] = "mill"
    line = (
        "warning  controller: its scenario describes the rig mill, but the rig is lathe; start `stickslip controller`"
    )
    assert any(words.startswith(line) for words in frame_lines(view.now(), []))


def test_an_idle_rig_has_dashes_and_no_vibration(rig: Rig) -> None:
    view = View(rig, "tcp/127.0.0.1:7447", rig.clock)
    for number in range(30):
        rig.block(number)
        rig.applied(number, guard_limit=wire.HEAT)
    assert "applied  -" in frame_lines(view.now(), view.step().events)
    lines = dict(line.split(maxsplit=1) for line in frame_lines(view.now(), []))
    assert (lines["applied"], lines["mode"], lines["v_a/v_d"].partition(":")[0]) == ("no vibration", "-", "-")
    assert lines["held"].startswith("by  HEAT: out of specification: the exciter is too warm")
    assert lines["answer"].startswith("no controller")


def test_a_fault_names_the_next_commands(rig: Rig) -> None:
    view = View(rig, "tcp/127.0.0.1:7447", rig.clock)
    for number in range(30):
        rig.block(number)
        rig.applied(number, guard_state=wire.FAULT, cause=wire.LOUD)
    view.step()
    assert frame_lines(view.now(), [])[-1] == "next     no vibration until `stickslip reset`, then `stickslip arm`"


def test_a_silent_rig_has_no_figures(rig: Rig) -> None:
    view = View(rig, "tcp/127.0.0.1:7447", rig.clock)
    rig.blocks(range(30))
    view.step()
    rig.now_s += 2.0
    words = shown(view, collections.deque())
    assert words.startswith("no data for 2 s")
    assert wire.Mode.Name(wire.EXCITE) not in words
    assert "500" not in words
