"""A run of several processes: starts plant, controller and recorder, supervises them, and ends them all; its progress line."""

import contextlib
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection, Generator, Iterable
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.text import Text

from bridge.compiling import Progress, left_in
from bridge.faults import FAULTS, Fault
from bridge.log.watches.event_watch import pauses_of
from bridge.plain import ANOTHER_COMPILES, plain, print_line
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import harms, is_listed
from bridge.wire.payloads import parsed
from bridge.wire.topics import STATE
from bridge.wire.words import word_of
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox, Received
from cockpit.live.listener import EVENTS, ROLES
from cockpit.run.child_process import endings_handled
from cockpit.run.writable import stamp_of

_GRACE_S = 6.0  # time for a child to fade out, leave the bus and close the log, before it is killed
_LOOK_S = 0.05  # interval of the checks of the children
_REPORT_S = 30.0  # time between two lines about a run that has not begun
_FOREVER_S = 1e6  # wait of a child for the others: unlimited in practice, as the parent supervises and ends it
_WARNING = "stickslip: warning: "  # prefix of a child's line that is passed on to the operator at once
_UPDATE_S = 0.1  # interval of the updates of the progress line, and of attempts to reach the bus
_SHOWN_S = 3.0  # time for which the progress line shows an event; it shows a harmful event to the end of the run


class Child:
    """One process of the run; its lines on stderr are kept for the fault line."""

    def __init__(self, role: str, arguments: list[str]) -> None:
        self.role = role
        # started in a new session: Ctrl-C reaches only the parent, which ends the children in order
        self.process = subprocess.Popen(
            # -P: otherwise Python would import a plant.py from the current folder first
            [sys.executable, "-P", "-m", "cockpit", role, *arguments, "--child", str(os.getpid())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self._lines: list[str] = []
        self.left = (0, 0)  # number of kernels left to compile, and of all that need compilation
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        if self.process.stderr is not None:
            with self.process.stderr as lines:
                for line in lines:
                    self._lines.append(line.rstrip())
                    self.left = left_in(line) or self.left
                    if line.startswith((_WARNING, f"stickslip: {ANOTHER_COMPILES}")):
                        print_line(line.rstrip())

    def last_words(self) -> str:
        """The last line that the process wrote to stderr, which names its fault."""
        self._reader.join(1.0)
        return next((line for line in reversed(self._lines) if line.strip()), "")


def _check_free(endpoint: str) -> None:
    """Raise Fault ENDPOINT_BUSY if the plant could not listen.

    Checked before anything starts: recorder and controller would connect to the run that listens there already, overwrite its
    log and command its rig.
    """
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        socket.create_server((host.strip("[]"), int(port)), family=family).close()
    except (OSError, OverflowError) as error:
        line = f"{endpoint}: cannot listen there ({error})"
        raise Fault("ENDPOINT_BUSY", f"{line}; end the process that holds it or choose another --endpoint") from None


def run_processes(
    arguments: list[str],
    endpoint: str,
    log: Path,
    lockstep: bool,
    watch: Callable[[threading.Event], None],
    wait_s: float | None = None,
    to_fail: Collection[str] = (),
) -> None:
    """Run a scenario to its end and close its log.

    Args:
        arguments: command line of a child that gives the same scenario.
        endpoint: address of the bus; it must be free.
        watch: follows the run on the bus until its event is set, or sets it to end the run; runs in a separate thread.
        wait_s: longest time until the log begins; None: no limit. A line every 30 s reports that the run has not begun.
        to_fail: roles that a fault of the run ends; the others go on.

    Raises Fault ENDPOINT_BUSY, NO_PEER after `wait_s`, the Fault of the child that failed first, PEER_DIED if a child was killed,
    KeyboardInterrupt after Ctrl-C.

    """
    _check_free(endpoint)
    more = ["--set", f"bus.wait_s={_FOREVER_S:g}", *(["--lockstep"] if lockstep else [])]
    children: list[Child] = []
    over = threading.Event()
    watcher = threading.Thread(target=watch, args=(over,), daemon=True)
    try:
        with _ctrl_c_afterwards():
            # also the order of the stop: the plant first fades the vibration out and sends END to the others
            for role in ROLES:
                extra = ["--log", str(log)] if role == "recorder" else []
                wait_for = ["--wait-for", "controller,recorder"] if role == "plant" else []
                children.append(Child(role, [*arguments, *more, *extra, *wait_for]))
        watcher.start()
        _until_the_end(children, StartWatch(children, log, wait_s), over, to_fail)
    except KeyboardInterrupt:
        _stop(children)
        raise
    finally:
        over.set()
        _stop(children)
        if watcher.is_alive():
            watcher.join(2.0)


@contextlib.contextmanager
def _ctrl_c_afterwards() -> Generator[None]:
    """Delay Ctrl-C, SIGTERM and SIGHUP to the end of the block: a child that is not yet in the list would never be ended."""
    signals: list[int] = []

    def note(number: int, _frame: Any) -> None:
        signals.append(number)

    with endings_handled(note):
        yield
    if signals:
        signal.raise_signal(signals[0])


class StartWatch:
    """Prints, until the log begins, the number of kernels left to compile, or every 30 s that the run has not begun.

    A first start compiles for up to a minute, on a busy or small computer for several minutes. So no time limit is set.
    """

    def __init__(self, children: list[Child], log: Path, wait_s: float | None) -> None:
        self._children = children
        self._log = log
        self._before = stamp_of(log)
        self._since_s = time.monotonic()
        self._due_s = self._since_s + _REPORT_S
        self._wait_s = wait_s
        self._begun = False
        self._progress = Progress()

    def look(self) -> None:
        """Print a line when it is due. Raises Fault NO_PEER after the longest time."""
        left, total = (sum(counts) for counts in zip(*(child.left for child in self._children), strict=True))
        self._progress.show(left, total)
        now_s = time.monotonic()
        late = self._wait_s is not None and now_s > self._since_s + self._wait_s
        if self._begun or not (late or now_s > self._due_s):
            return
        self._begun = stamp_of(self._log) != self._before
        if self._begun:
            return
        since = f"{now_s - self._since_s:.0f} s"
        missing = (
            "kernels are still compiled" if left else "plant, controller and recorder have not connected to each other"
        )
        if late:
            raise Fault("NO_PEER", f"{missing} after {since}; allow more time with --wait S, or omit --wait")
        if not left:  # the progress shows compilation
            print_line(f"waiting  {missing}, since {since}; Ctrl-C ends it")
        self._due_s = now_s + _REPORT_S


def _until_the_end(
    children: list[Child], beginning: StartWatch, over: threading.Event, to_fail: Collection[str]
) -> None:
    """Wait until all children have ended with status 0, or `over` is set.

    Raises the Fault of the child whose failure ended the others.
    """
    children = [child for child in children if child.role not in to_fail]
    while not over.is_set():
        beginning.look()
        ended = [child for child in children if child.process.poll() is not None]
        failed = [child for child in ended if child.process.returncode != 0]
        if failed:
            # the first failure makes the others fail with PEER_DIED or NO_PEER: `_fault` picks a killed child or another fault
            time.sleep(_LOOK_S)
            failed = [child for child in children if child.process.poll() not in {None, 0}]
            raise _fault(failed)
        if len(ended) == len(children):
            return
        time.sleep(_LOOK_S)


def _fault(failed: list[Child]) -> Fault:
    for child in failed:
        if child.process.returncode < 0:
            return Fault(
                "PEER_DIED", f"the {child.role} was killed by signal {-child.process.returncode}; the run was stopped"
            )
    followers = {FAULTS["PEER_DIED"].exit_status, FAULTS["NO_PEER"].exit_status}
    first = next((child for child in failed if child.process.returncode not in followers), failed[0])
    words = first.last_words()
    code, _, line = words.removeprefix("stickslip: ").partition(": ")  # several faults share one exit status
    if code not in FAULTS:
        return Fault("PEER_DIED", f"the {first.role} ended with status {first.process.returncode}: {words}")
    return Fault(code, line)


def _stop(children: list[Child]) -> None:
    """Ask all children to stop, in order, and kill each that has not ended in time."""
    for child in children:
        if child.process.poll() is None:
            child.process.terminate()
    until_s = time.monotonic() + _GRACE_S
    for child in children:
        try:
            child.process.wait(max(0.0, until_s - time.monotonic()))
        except subprocess.TimeoutExpired:
            child.process.kill()
            child.process.wait()


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
                time.sleep(_UPDATE_S)

    return follow


class _EventWatch:
    """Events that the progress line shows for a while, and number and length of the computer's stalls."""

    def __init__(self) -> None:
        self.pauses, self.paused_ms = 0, 0.0
        self._shown_until_s: dict[str, float] = {}  # end of display of an event, by its code

    def note(self, received: Received) -> None:
        """Count a stall of the computer, or show an event. Raises Fault BAD_MESSAGE."""
        event = parsed(wire.Event, received.payload, received.topic.name)
        if is_listed(event.code):
            self._shown_until_s[event.code] = math.inf if harms(event.code) else time.monotonic() + _SHOWN_S
        for pause in pauses_of([event]):
            self.pauses, self.paused_ms = self.pauses + 1, self.paused_ms + (pause.until_ns - pause.from_ns) * 1e-6

    def shown(self) -> list[str]:
        """Codes to show now."""
        return [code for code, until_s in self._shown_until_s.items() if time.monotonic() < until_s]


def _show(bus: Bus, duration_s: float, over: threading.Event) -> None:
    inbox, watch, state = Inbox(1000), _EventWatch(), None
    for topic in (STATE, *EVENTS):
        bus.listen(topic, inbox.push)
    # shown from the first state message on; before, the terminal shows the progress of compilation
    live = Live(console=Console(stderr=True), refresh_per_second=8, transient=True)
    with contextlib.ExitStack() as shown:
        while not over.wait(_UPDATE_S):
            while (received := inbox.get()) is not None:
                with contextlib.suppress(Fault):  # skip malformed messages of other clients
                    if received.topic is STATE:
                        state = parsed(wire.State, received.payload, STATE.name)
                    else:
                        watch.note(received)
            if state is not None:
                if not live.is_started:
                    shown.enter_context(live)
                live.update(Text(plain(progress_line(state, duration_s, watch.pauses, watch.paused_ms, watch.shown()))))
