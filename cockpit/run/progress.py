"""The live progress line of a run, fed from the bus."""

import contextlib
import math
import sys
import threading
import time
from collections.abc import Callable, Iterable

from rich.console import Console
from rich.live import Live
from rich.text import Text

from bridge.faults import Fault
from bridge.log.pause_events import pauses_of
from bridge.plain import plain
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import TRIPS, WEAK_REASONS, harms, is_listed
from bridge.wire.payloads import parsed
from bridge.wire.topics import APPLIED, COMMAND, CONTROLLER_EVENT, PLANT_EVENT, RECORDER_EVENT, STATE
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox, Received

_LOOK_S = 0.1
_SHOWN_S = 3.0  # of an event that is no failure
_EVENTS = (PLANT_EVENT, CONTROLLER_EVENT, RECORDER_EVENT)


def progress_line(
    state: wire.State, duration_s: float, pauses: int = 0, paused_ms: float = 0.0, warnings: Iterable[str] = ()
) -> str:
    """The state of the run in one line, with the number and total length of the computer's stalls."""
    t_s = state.t_ns * 1e-9
    bar = (
        f"[{'#' * round(20 * min(t_s / duration_s, 1.0)):<20}] " if duration_s else ""
    )  # none for a run without an end
    ratio = f"v_a/v_d {state.velocity_ratio:4.2f}" if state.velocity_ratio > 0.01 else "no vibration"
    paused = f"  computer stalled {pauses} x, {paused_ms:.0f} ms" if pauses else ""
    warned = "".join(f"  {warning}" for warning in warnings)
    return (
        f"{t_s:6.1f} s {bar}{wire.ContactState.Name(state.state):<10} {wire.Mode.Name(state.mode):<8} "
        f"F_d {state.drive_force_N:5.2f} N  {ratio:<12}  slips {state.slips}{paused}{warned}"
    )


def follower(config: BusConfig, duration_s: float) -> Callable[[threading.Event], None]:
    """A watcher for `run_processes`: shows the progress line on a terminal, prints nothing elsewhere."""

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


class ProgressWatch:
    """Warnings to show at once with the progress: no fresh command, a weak exciter, events with a severity."""

    def __init__(self) -> None:
        self._shown_until_s: dict[str, float] = {}  # by code of the event
        self._applied: bytes | None = None
        self._command: bytes | None = None

    def note(self, received: Received) -> None:
        """Take a message of the rig or the controller, or an event. Raises Fault BAD_MESSAGE."""
        if received.topic is APPLIED:
            self._applied = received.payload
        elif received.topic is COMMAND:
            self._command = received.payload
        elif received.topic in _EVENTS:
            event = parsed(wire.Event, received.payload, received.topic.name)
            if is_listed(event.code):
                # a failure is shown to the end of the run
                self._shown_until_s[event.code] = math.inf if harms(event.code) else time.monotonic() + _SHOWN_S

    def warnings(self, roles: Iterable[str]) -> list[str]:
        """The warnings now, with `roles` on the bus."""
        lines = [f"no {role}" for role in ("controller", "recorder") if role not in roles]
        if self._applied is not None and parsed(wire.Applied, self._applied, APPLIED.name).fallback:
            lines.append("FALLBACK: no fresh command")
        if self._command is not None:
            reason = parsed(wire.Command, self._command, COMMAND.name).reason
            lines += [name for name in (*WEAK_REASONS, *TRIPS) if wire.Reason.Value(name) == reason]
        return [*lines, *(code for code, until_s in self._shown_until_s.items() if time.monotonic() < until_s)]


def _show(bus: Bus, duration_s: float, over: threading.Event) -> None:
    inbox = Inbox(1000)
    watch = ProgressWatch()
    for topic in (STATE, *_EVENTS):
        bus.listen(topic, inbox.push)
    newest_of: dict[str, Received] = {}
    for topic in (APPLIED, COMMAND):  # a thousand per second; only the newest of each 0.1 s is parsed
        bus.listen(topic, lambda received: newest_of.__setitem__(received.topic.name, received))
    pauses, paused_ms = 0, 0.0
    # shown from the first state message on; before, the terminal shows the progress of compilation
    live = Live(console=Console(stderr=True), refresh_per_second=8, transient=True)
    with contextlib.ExitStack() as shown:
        while not over.wait(_LOOK_S):
            newest = None
            while (received := inbox.get_nowait()) is not None:
                if received.topic is STATE:
                    newest = received
                    continue
                with contextlib.suppress(Fault):  # skip malformed messages of other clients
                    watch.note(received)
                    for pause in pauses_of([parsed(wire.Event, received.payload, received.topic.name)]):
                        pauses, paused_ms = pauses + 1, paused_ms + (pause.until_ns - pause.from_ns) * 1e-6
            if newest is not None:
                with contextlib.suppress(Fault):
                    for received in [*newest_of.values()]:
                        watch.note(received)
                    state = parsed(wire.State, newest.payload, STATE.name)
                    roles = [role for role in ("controller", "recorder") if bus.alive(role)]
                    line = progress_line(state, duration_s, pauses, paused_ms, watch.warnings(roles))
                    if not live.is_started:
                        shown.enter_context(live)
                    live.update(Text(plain(line)))
