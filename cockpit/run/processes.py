"""A run of several processes: starts plant, controller and recorder, supervises them, and ends them all."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

from bridge.compiling import Progress, left_in
from bridge.faults import FAULTS, Fault
from bridge.plain import ANOTHER_COMPILES, LOADED, print_line
from cockpit.run.child_process import endings_handled
from cockpit.run.writable import stamp_of

_GRACE_S = 6.0  # time for a child to fade out, leave the bus and close the log, before it is killed
_LOOK_S = 0.05  # interval of the checks of the children
_REPORT_S = 30.0  # time between two lines about a run that has not begun
_FOREVER_S = 1e6  # time for which a child waits for the others: the parent supervises them, and ends the child
_WARNING = "stickslip: warning: "  # prefix of a child's line that is passed on to the operator at once
# progress of a child, as printed
STARTS, COMPILES, READY = "starts", "compiles", ""
# order in which the processes are asked to stop: the plant first fades the vibration out and sends END to the others
_ROLES = ("plant", "controller", "recorder")


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
        self.still = STARTS
        self.left = (0, 0)  # number of kernels left to compile, and of all that need compilation
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        if self.process.stderr is not None:
            with self.process.stderr as lines:
                for line in lines:
                    self._lines.append(line.rstrip())
                    words = line.removeprefix("stickslip: ")
                    waits = words.startswith(ANOTHER_COMPILES)
                    if left := left_in(line):
                        self.left = left
                        self.still = COMPILES if left[0] else STARTS
                    elif waits:
                        self.still = COMPILES
                    elif words.rstrip() == LOADED:
                        self.still = READY
                    if waits or line.startswith(_WARNING):
                        print_line(line.rstrip())

    def last_words(self) -> str:
        """The last line on stderr."""
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
) -> None:
    """Run a scenario to its end and close its log.

    Args:
        arguments: command line of a child that gives the same scenario.
        endpoint: address of the bus; it must be free.
        watch: follows the run on the bus until its event is set; runs in a separate thread.
        wait_s: longest time until the log begins; None: no limit, with a line every 30 s.

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
            for role in _ROLES:
                extra = ["--log", str(log)] if role == "recorder" else []
                wait_for = ["--wait-for", "controller,recorder"] if role == "plant" else []
                children.append(Child(role, [*arguments, *more, *extra, *wait_for]))
        watcher.start()
        _until_the_end(children, StartWatch(children, log, wait_s))
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
    """Reports every 30 s, until the log begins, which processes still start or compile.

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
        """Report the missing processes when a line is due. Raises Fault NO_PEER after the longest time."""
        self._progress.show(*(sum(counts) for counts in zip(*(child.left for child in self._children), strict=True)))
        now_s = time.monotonic()
        late = self._wait_s is not None and now_s > self._since_s + self._wait_s
        if self._begun or not (late or now_s > self._due_s):
            return
        self._begun = stamp_of(self._log) != self._before
        if self._begun:
            return
        waited_s, missing = now_s - self._since_s, self._missing()
        if late:
            raise Fault("NO_PEER", f"{missing} after {waited_s:.0f} s; allow more time with --wait S, or omit --wait")
        if not any(child.still == COMPILES for child in self._children):  # the progress shows compilation
            print_line(f"waiting  {missing}, since {waited_s:.0f} s; Ctrl-C ends it")
        self._due_s = now_s + _REPORT_S

    def _missing(self) -> str:
        parts: list[str] = []
        for still in (COMPILES, STARTS):
            roles = [child.role for child in self._children if child.still == still]
            if roles:
                parts.append(f"the {' and the '.join(roles)} still {still if len(roles) == 1 else still[:-1]}")
        return ", ".join(parts) or "plant, controller and recorder have not connected to each other"


def _until_the_end(children: list[Child], beginning: StartWatch) -> None:
    """Wait until all children have ended with status 0. Raises the Fault of the child that failed first."""
    while True:
        beginning.look()
        ended = [child for child in children if child.process.poll() is not None]
        failed = [child for child in ended if child.process.returncode != 0]
        if failed:
            # the first failure makes the others fail; a killed child, or a child that names a cause, is reported
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
                "PEER_DIED",
                f"the {child.role} was killed by signal {-child.process.returncode}; the run was stopped",
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
