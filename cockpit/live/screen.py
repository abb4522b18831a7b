"""`stickslip watch`: a running rig on one terminal screen, or as periodic lines of JSON."""

import collections
import json
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from bridge.results import strict_json
from bridge.wire.event_codes import FAILURE
from bridge.wire.zenoh_link import BusConfig
from cockpit.live.frame_words import event_line, rows
from cockpit.live.listener import Listener
from cockpit.live.view import BAD, GOOD, LIVE, LOOK, OFF, EventRow, View

_PERIOD_S = 0.1  # time between two updates of the screen
_STYLES = {GOOD: "bold green", LOOK: "bold yellow", BAD: "bold red", OFF: "bold"}
_HEAD_LINES = 20  # lines of the screen above the events
_FEWEST_EVENTS = 3  # events shown even if the terminal has no room for them


def lines(bus: BusConfig, stop: threading.Event, every_s: float) -> None:
    """Print a line of JSON each `every_s` until `stop` is set: the current state, and the events since the line before."""
    events: list[EventRow] = []
    due_s = time.monotonic() + every_s
    for view, fresh in _steps(bus, stop, min(_PERIOD_S, every_s)):
        events += fresh
        if time.monotonic() >= due_s:
            due_s = max(due_s + every_s, time.monotonic())
            state = view.now() | {"events": [event._asdict() for event in events]}
            print(json.dumps(strict_json(state), allow_nan=False), flush=True)
            events = []


def show(bus: BusConfig, stop: threading.Event) -> None:
    """Show the rig on one screen until `stop` is set; without a terminal, print a line at each change of state."""
    console = Console(file=sys.stdout, highlight=False)
    if not console.is_terminal:
        _print_changes(bus, stop)
        return
    events: collections.deque[EventRow] = collections.deque(maxlen=100)
    with Live(console=console, screen=True, auto_refresh=False) as live:
        for view, fresh in _steps(bus, stop, _PERIOD_S):
            events.extendleft(fresh)
            live.update(screen_of(view.now(), events, console.height), refresh=True)


def _steps(bus: BusConfig, stop: threading.Event, period_s: float) -> Iterator[tuple[View, list[EventRow]]]:
    """A view after each step, with the new events, until `stop` is set."""
    with Listener(bus) as listener:
        view = View(listener, bus.endpoint)
        while not stop.wait(period_s):
            yield view, view.step().events


def _print_changes(bus: BusConfig, stop: threading.Event) -> None:
    before = ""
    for view, fresh in _steps(bus, stop, _PERIOD_S):
        for event in fresh:
            print(event_line(event), flush=True)
        now = view.now()
        state = f"{now['phase']} {now.get('mode')} {now.get('reason')} {now.get('guard_state')}"
        if state != before:
            before = state
            print(f"state    {now['answer']['text']}", flush=True)


def screen_of(now: Mapping[str, Any], events: collections.deque[EventRow], height: int) -> RenderableType:
    """The screen for a terminal of `height` lines."""
    answer = now["answer"]
    table = Table.grid(padding=(0, 2))
    for name, words in rows(now):
        table.add_row(Text(name, style="dim"), Text(words, style="" if now["phase"] == LIVE else "dim"))
    shown = [*events][: max(_FEWEST_EVENTS, height - _HEAD_LINES)]
    event_lines = [Text(event_line(event), style=_STYLES[BAD] if event.letter == FAILURE else "") for event in shown]
    head = Text(answer["text"], style=_STYLES[answer["level"]])
    return Group(head, Text(""), table, Text(""), *(event_lines or [Text("no events yet", style="dim")]))
