"""The live progress line of a run, fed from the bus."""

import sys
import threading
import time
from collections.abc import Callable

from rich.console import Console
from rich.live import Live
from rich.text import Text

from bridge.faults import Fault
from bridge.log.pause_events import pauses_of
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.topics import RECORDER_EVENT, STATE
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox

_LOOK_S = 0.1


def progress_line(state: wire.State, duration_s: float, pauses: int = 0, paused_ms: float = 0.0) -> str:
    """What is going on, in one line; of the machine's pauses how many there were and how long all of them."""
    t_s = state.t_ns * 1e-9
    bar = f"[{'#' * round(20 * min(t_s / duration_s, 1.0)):<20}] " if duration_s else ""  # none where no end is known
    ratio = f"v_a/v_d {state.velocity_ratio:4.2f}" if state.velocity_ratio > 0.01 else "no vibration"
    paused = f"  machine paused {pauses} x, {paused_ms:.0f} ms" if pauses else ""
    return (
        f"{t_s:6.1f} s {bar}{wire.ContactState.Name(state.state):<10} {wire.Mode.Name(state.mode):<8} "
        f"F_d {state.drive_force_N:5.2f} N  {ratio:<12}  slips {state.slips}{paused}"
    )


def follower(config: BusConfig, duration_s: float) -> Callable[[threading.Event], None]:
    """A watcher for `run_processes`: shows the progress line on a terminal, says nothing elsewhere."""

    def follow(over: threading.Event) -> None:
        if not sys.stderr.isatty():
            return
        while not over.is_set():
            try:
                with Bus(config, "cockpit", lockstep=False, stop=over) as bus:
                    _show(bus, duration_s, over)
            except Fault:
                time.sleep(_LOOK_S)

    return follow


def _show(bus: Bus, duration_s: float, over: threading.Event) -> None:
    inbox = Inbox(1000)
    for topic in (STATE, RECORDER_EVENT):
        bus.listen(topic, inbox.push)
    pauses, paused_ms = 0, 0.0
    with Live(Text("starting"), console=Console(stderr=True), refresh_per_second=8, transient=True) as live:
        while not over.wait(_LOOK_S):
            newest = None
            while (received := inbox.get_nowait()) is not None:
                if received.topic is STATE:
                    newest = received
                    continue
                for pause in pauses_of([wire.Event.FromString(received.payload)]):
                    pauses, paused_ms = pauses + 1, paused_ms + (pause.until_ns - pause.from_ns) * 1e-6
            if newest is not None:
                state = wire.State.FromString(newest.payload)
                live.update(Text(progress_line(state, duration_s, pauses, paused_ms)))
