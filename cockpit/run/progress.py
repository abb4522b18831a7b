"""The live progress line of a run, fed from the bus."""

import contextlib
import math
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping

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
from bridge.wire.words import word_of
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox, Received

_LOOK_S = 0.1  # interval of the updates of the line
_SHOWN_S = 3.0  # time for which an event is shown; a failure is shown to the end of the run
_ROLES = ("controller", "recorder")
_EVENTS = (PLANT_EVENT, CONTROLLER_EVENT, RECORDER_EVENT)


def progress_line(
    state: wire.State, duration_s: float, pauses: int = 0, paused_ms: float = 0.0, warnings: Iterable[str] = ()
) -> str:
    """The state of the run in one line, with the number and total length of the computer's stalls."""
    t_s = state.t_ns * 1e-9
    # a run without an end has no bar
    bar = f"[{'#' * round(20 * min(t_s / duration_s, 1.0)):<20}] " if duration_s else ""
    ratio = f"v_a/v_d {state.velocity_ratio:4.2f}" if state.velocity_ratio > 0.01 else "no vibration"
    paused = f"  computer stalled {pauses} x, {paused_ms:.0f} ms" if pauses else ""
    warned = "".join(f"  {warning}" for warning in warnings)
    return (
        f"{t_s:6.1f} s {bar}{word_of('state', state.state):<10} {word_of('mode', state.mode):<8} "
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


class _EventWatch:
    """Events with a severity, each shown for a while, and the stalls of the computer."""

    def __init__(self) -> None:
        self.pauses, self.paused_ms = 0, 0.0
        self._shown_until_s: dict[str, float] = {}  # by code

    def note(self, received: Received) -> None:
        """Take an event. Raises Fault BAD_MESSAGE."""
        event = parsed(wire.Event, received.payload, received.topic.name)
        if is_listed(event.code):
            self._shown_until_s[event.code] = math.inf if harms(event.code) else time.monotonic() + _SHOWN_S
        for pause in pauses_of([event]):
            self.pauses, self.paused_ms = self.pauses + 1, self.paused_ms + (pause.until_ns - pause.from_ns) * 1e-6

    def shown(self) -> list[str]:
        """Codes to show now."""
        return [code for code, until_s in self._shown_until_s.items() if time.monotonic() < until_s]


def _warnings(roles: Iterable[str], newest: Mapping[str, bytes]) -> list[str]:
    """Warnings of missing roles, of no fresh command, of a weak or doubted sensor or exciter. Raises Fault BAD_MESSAGE."""
    lines = [f"no {role}" for role in _ROLES if role not in roles]
    if APPLIED.name in newest and parsed(wire.Applied, newest[APPLIED.name], APPLIED.name).fallback:
        lines.append("FALLBACK: no fresh command")
    if COMMAND.name in newest:
        reason = word_of("reason", parsed(wire.Command, newest[COMMAND.name], COMMAND.name).reason)
        lines += [reason] if reason in {*WEAK_REASONS, *TRIPS} else []
    return lines


def _show(bus: Bus, duration_s: float, over: threading.Event) -> None:
    inbox, watch = Inbox(1000), _EventWatch()
    for topic in _EVENTS:
        bus.listen(topic, inbox.push)
    newest: dict[str, bytes] = {}
    for topic in (STATE, APPLIED, COMMAND):  # up to a thousand per second; only the newest of each 0.1 s is parsed
        bus.listen(topic, lambda received: newest.__setitem__(received.topic.name, received.payload))
    # shown from the first state message on; before, the terminal shows the progress of compilation
    live = Live(console=Console(stderr=True), refresh_per_second=8, transient=True)
    with contextlib.ExitStack() as shown:
        while not over.wait(_LOOK_S):
            while (received := inbox.get_nowait()) is not None:
                with contextlib.suppress(Fault):  # skip malformed messages of other clients
                    watch.note(received)
            if STATE.name not in newest:
                continue
            with contextlib.suppress(Fault):
                state = parsed(wire.State, newest[STATE.name], STATE.name)
                warnings = [*_warnings([*filter(bus.alive, _ROLES)], newest), *watch.shown()]
                line = progress_line(state, duration_s, watch.pauses, watch.paused_ms, warnings)
                if not live.is_started:
                    shown.enter_context(live)
                live.update(Text(plain(line)))
