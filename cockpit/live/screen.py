"""`stickslip watch`: a running rig on one terminal screen, or as periodic lines of JSON."""

import collections
import json
import sys
import threading
import time
from collections.abc import Mapping
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from bridge.files import strict_json
from bridge.units import counted, quantity
from bridge.wire.zenoh_link import BusConfig
from cockpit.live.answer import BAD, GOOD, LOOK, OFF, help_of
from cockpit.live.listener import Listener
from cockpit.live.view import LIVE, EventRow, View

_PERIOD_S = 0.1
_STYLES = {GOOD: "bold green", LOOK: "bold yellow", BAD: "bold red", OFF: "bold"}
_HEAD_LINES = 18  # on the screen above the events
_FEWEST_EVENTS = 3
_UNKNOWN = "-"


def lines(bus: BusConfig, stop: threading.Event, every_s: float) -> None:
    """Print a line of JSON each `every_s` until `stop` is set: the current state, and the events since the line before."""
    events: list[EventRow] = []
    with Listener(bus) as listener:
        view = View(listener, bus.endpoint)
        due_s = time.monotonic() + every_s
        while not stop.wait(min(_PERIOD_S, every_s)):
            events += view.step().events
            if time.monotonic() < due_s:
                continue
            due_s = max(due_s + every_s, time.monotonic())
            state = view.now() | {"events": [event._asdict() for event in events]}
            print(json.dumps(strict_json(state), allow_nan=False), flush=True)
            events = []


def show(bus: BusConfig, stop: threading.Event) -> None:
    """Show the rig on one screen until `stop` is set; without a terminal, print a line at each change of state."""
    console = Console(file=sys.stdout, highlight=False)
    events: collections.deque[EventRow] = collections.deque(maxlen=100)
    with Listener(bus) as listener:
        view = View(listener, bus.endpoint)
        if not console.is_terminal:
            _print_changes(view, stop)
            return
        with Live(console=console, screen=True, auto_refresh=False) as live:
            while not stop.wait(_PERIOD_S):
                events.extendleft(view.step().events)
                live.update(screen_of(view.now(), events, console.height), refresh=True)


def _print_changes(view: View, stop: threading.Event) -> None:
    before = ""
    while not stop.wait(_PERIOD_S):
        for event in view.step().events:
            print(_event_line(event), flush=True)
        now = view.now()
        state = f"{now['phase']} {now.get('mode')} {now.get('reason')} {now.get('guard_state')}"
        if state != before:
            before = state
            print(f"state    {now['answer']['text']}", flush=True)


def screen_of(now: Mapping[str, Any], events: collections.deque[EventRow], height: int) -> RenderableType:
    """The screen for a terminal of `height` lines."""
    answer = now["answer"]
    live = now["phase"] == LIVE
    head = Text(answer["text"], style=_STYLES[answer["level"]])
    rig = f"rig {now['rig'] or 'of unknown name'}" if live else "no rig connected"
    bus = f"{rig}; on the bus: {', '.join(now['roles']) or 'no process'}"
    if "recorder" not in now["roles"] and live:
        bus += "; not recorded"
    table = Table.grid(padding=(0, 2))
    for name, words in _rows(now):
        table.add_row(Text(name, style="dim"), Text(words, style="" if live else "dim"))
    few = max(_FEWEST_EVENTS, height - _HEAD_LINES)
    event_lines = [
        Text(_event_line(event), style=_STYLES[BAD] if event.letter == "F" else "") for event in [*events][:few]
    ]
    return Group(
        head, Text(bus, style="dim"), Text(""), table, Text(""), *(event_lines or [Text("no events yet", style="dim")])
    )


def _rows(now: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Name and text of each line."""

    def figure(name: str, unit: str) -> str:
        value = now.get(name)
        return _UNKNOWN if value is None else quantity(value, unit)

    def word(column: str, name: str) -> str:
        return f"{now[name]}: {help_of(column, now[name])}" if now.get(name) else _UNKNOWN

    def number(name: str, form: str) -> str:
        return _UNKNOWN if now.get(name) is None else format(now[name], form)

    stroke_m = min((limit["value"] for limit in now["limits"]), default=None)
    of = f" of {quantity(stroke_m, 'm')}" if stroke_m is not None else ""
    lost, late = now["lost"], now["late_us"]
    commands = _UNKNOWN
    if now["phase"] == LIVE and lost is not None and late is not None and late["p50"] is not None:
        share = 100.0 * lost["late"] / max(lost["commands"], 1)
        commands = f"half within {late['p50']:.0f} us, 99 % within {late['p99']:.0f} us, {share:.2f} % later than 1 ms"
    run = f"{number('t_s', '.1f')} s, "
    if now["slips_of_late"] is None:
        run += "no controller counts slips"
    else:
        run += f"{counted(now['slips'], 'slip')}, {now['slips_of_late']} in the last {now['slips_over_s']:.0f} s"
    breaks = f", breaks away at {now['breakaway_force_N']:.2f} N" if now.get("breakaway_force_N") else ""
    next_slip = number("time_to_slip_s", ".2f") + " s" if now.get("time_to_slip_s") is not None else "none expected"
    return [
        ("run", run if now["phase"] == LIVE else _UNKNOWN),
        ("guard", word("guard_state", "guard_state")),
        ("cause", word("cause", "cause")),
        ("mode", word("mode", "mode")),
        ("reason", word("reason", "reason")),
        ("limit", word("limit", "limit")),
        ("contact", word("state", "state")),
        ("force", f"{number('drive_force_N', '.2f')} N{breaks}"),
        ("v_a/v_d", f"{number('velocity_ratio', '.2f')}: v_a {figure('vibration_velocity_mps', 'm/s')}, v_d "
                    f"{figure('drive_velocity_mps', 'm/s')}, set point {figure('wanted_velocity_mps', 'm/s')}"),
        ("applied", f"{figure('amplitude_m', 'm')}{of} at {number('frequency_Hz', '.0f')} Hz"),
        ("next slip", next_slip if now.get("mode") else _UNKNOWN),
        ("commands", commands),
        ("lost", _lost(lost)),
    ]  # fmt: skip


def _lost(lost: Mapping[str, int] | None) -> str:
    if lost is None:
        return _UNKNOWN
    return (
        f"{counted(lost['controller'], 'block')} to the controller, {counted(lost['viewer'], 'block')} to this screen; "
        f"{counted(lost['dropped'], 'message')} dropped here"
    )


def _event_line(event: EventRow) -> str:
    letter = f" ({event.letter})" if event.letter else ""
    return f"{event.t_s:9.3f} s  {event.source:<10} {event.code}{letter}: {event.text}"
