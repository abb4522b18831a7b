"""Publish a log on the bus in real time: for viewers, or to feed a rig's record to a controller on the bench."""

import contextlib
import select
import signal
import sys
import termios
import threading
import time
import tty
from collections.abc import Generator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from bridge.faults import Fault
from bridge.log.logfile import RunData, read_run
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.topics import ANNOUNCE, APPLIED, COMMAND, PLANT_EVENT, SENSORS, STATE, TRACE, Topic
from bridge.wire.zenoh_link import Bus, BusConfig
from plant.app import wait_for_peers

_GOODBYE_S = 1.0  # longest wait at the end until the other processes have left the bus
_KEY_LOOK_S = 0.05  # interval at which keys are read


class _Pause:
    """Pause of a replay, switched by a key or a signal. Not an Event, whose `set` would hang if a signal interrupted it."""

    on = False

    def toggle(self, *_: Any) -> None:
        self.on = not self.on


def publish_log(
    path: Path,
    bus_config: BusConfig,
    speed: float,
    from_s: float,
    everything: bool,
    wait_for: list[str],
    stop: threading.Event,
) -> None:
    """Publish a log in the role of the plant, until its end or `stop`.

    The space bar, or SIGUSR1, pauses and resumes.

    Args:
        speed: multiple of real time.
        from_s: time of the first message that is published.
        everything: also publish the controller's topics; otherwise a live controller may answer.
        wait_for: roles that must be on the bus first.

    Raises Fault BAD_LOG, ENDPOINT_BUSY, NO_PEER.

    """
    run = read_run(path)
    tables = [(ANNOUNCE, run.announce), (SENSORS, run.sensors), (APPLIED, run.applied)]
    if everything:
        tables += [(COMMAND, run.command), (TRACE, run.trace), (STATE, run.state)]
    schedule = _schedule(tables, round(from_s * 1e9))
    pause = _Pause()
    signal.signal(signal.SIGUSR1, pause.toggle)
    # lockstep, so that no message is dropped: unlike a rig, a record can wait
    with Bus(bus_config, "plant", lockstep=True) as bus, _keys(pause.toggle, stop):
        for role in ("plant", "controller") if everything else ("plant",):
            if role in run.headers:
                bus.serve_header(_header(run, role))
        send = {topic.name: bus.publisher(topic) for topic, _ in tables}
        send_event = bus.publisher(PLANT_EVENT)
        bus.announce()
        wait_for_peers(bus, bus_config, wait_for, stop)
        send_event(_event("START", f"replay of {path.name} at {speed:g} times real time"))
        blocks = _play(schedule, tables, send, speed, pause, stop)
        send_event(_event("END", f"blocks={blocks}"))
        bus.withdraw()
        bus.wait_until_alone(_GOODBYE_S)


def _schedule(tables: list[tuple[Topic, Any]], from_ns: int) -> list[tuple[int, int, int]]:
    """Time, table and row of every message, in order of time; within a block in the order of the tables."""
    entries = [
        np.stack([table["t_ns"].astype(np.int64), np.full(len(table), place), np.arange(len(table))], axis=1)
        for place, (_, table) in enumerate(tables)
    ]
    together = np.concatenate(entries)
    together = together[together[:, 0] >= from_ns]
    order = np.lexsort((together[:, 1], together[:, 0]))
    return [(int(t_ns), int(place), int(row)) for t_ns, place, row in together[order]]


def _play(
    schedule: list[tuple[int, int, int]],
    tables: list[tuple[Topic, Any]],
    send: dict[str, Any],
    speed: float,
    pause: _Pause,
    stop: threading.Event,
) -> int:
    """Send each message when it is due, until the end or `stop`; return the number of blocks sent."""
    blocks = 0
    if not schedule:
        return blocks
    first_ns = schedule[0][0]
    began_s = time.perf_counter()
    shown_s = 0.0
    console = Console(stderr=True)
    live = Live(Text(""), console=console, transient=True) if console.is_terminal else None
    with live or contextlib.nullcontext():
        for t_ns, place, row in schedule:
            if pause.on:
                paused_s = time.perf_counter()
                while pause.on and not stop.is_set():
                    time.sleep(_KEY_LOOK_S)
                began_s += time.perf_counter() - paused_s
            if stop.is_set():
                break
            left_s = began_s + (t_ns - first_ns) * 1e-9 / speed - time.perf_counter()
            if left_s > 0:
                time.sleep(left_s)
            topic, table = tables[place]
            send[topic.name](table[row : row + 1].tobytes())
            blocks += topic is SENSORS
            if live is not None and t_ns * 1e-9 > shown_s + 0.2 * speed:
                shown_s = t_ns * 1e-9
                live.update(Text(f"{shown_s:7.1f} s of {schedule[-1][0] * 1e-9:.1f} s; space pauses"))
    return blocks


def _header(run: RunData, role: str) -> wire.Header:
    fields = run.headers[role]
    try:
        return wire.Header(
            role=role,
            schema_version=int(fields["schema_version"]),
            configuration=fields["configuration"],
            versions=fields["versions"],
        )
    except (KeyError, ValueError):
        line = f"{run.path}: the header of the {role} lacks schema_version, configuration or versions"
        raise Fault("BAD_LOG", f"{line}; take another copy of the log") from None


def _event(code: str, text: str) -> bytes:
    sequence = 0 if code == "START" else 1
    return wire.Event(sequence=sequence, source="plant", code=code, text=text).SerializeToString()


@contextlib.contextmanager
def _keys(toggle: Any, stop: threading.Event) -> Generator[None]:
    """Listen for the space bar while the body runs, on a terminal; restore the terminal afterwards."""
    if not sys.stdin.isatty():
        yield
        return
    before = termios.tcgetattr(sys.stdin)
    over = threading.Event()

    def listen() -> None:
        while not over.is_set() and not stop.is_set():
            if select.select([sys.stdin], [], [], _KEY_LOOK_S)[0] and sys.stdin.read(1) == " ":
                toggle()

    thread = threading.Thread(target=listen, daemon=True)
    try:
        tty.setcbreak(sys.stdin)
        thread.start()
        yield
    finally:
        over.set()
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
