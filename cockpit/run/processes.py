"""A run of several processes: starts plant, controller and recorder, watches them, ends them, leaves nobody behind."""

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
from bridge.plain import ANOTHER_COMPILES, LOADED, say
from cockpit.run.child_process import handle_endings

_GRACE_S = 6.0  # to fade out, say goodbye on the bus and close the log
_LOOK_S = 0.05
_TOLD_S = 30.0  # between two words about a run that has not begun
_FOREVER_S = 1e6  # for a child: who has started it sees how the others are, and ends it
_WARNING = "stickslip: warning: "  # how a line of a child begins that a person must see at once
# how far a child is, as a person is told
STARTS, COMPILES, READY = "starts", "compiles", ""
# in this order they are asked to stop: the plant fades the vibration out and tells the others
_ROLES = ("plant", "controller", "recorder")


class Child:
    """One process of the run; what it says on stderr is kept for the fault line."""

    def __init__(self, role: str, arguments: list[str]) -> None:
        self.role = role
        # a session of its own: Ctrl-C reaches the parent alone, which ends the children in order
        self.process = subprocess.Popen(
            # -P: else the folder of the person who calls is searched first, with a plant.py of that person's own
            [sys.executable, "-P", "-m", "cockpit", role, *arguments, "--child", str(os.getpid())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self._lines: list[str] = []
        self.still = STARTS
        self.left = (0, 0)  # kernels to compile, of how many
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
                        say(line.rstrip())

    def last_words(self) -> str:
        """What it said last on stderr."""
        self._reader.join(1.0)
        return next((line for line in reversed(self._lines) if line.strip()), "")


def _check_free(endpoint: str) -> None:
    """Raise Fault ENDPOINT_BUSY where the plant could not listen.

    Asked before anything starts: recorder and controller would meet whoever listens there already, overwrite the log of
    that run and command its rig.
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
        arguments: the command line that makes the same scenario in a child.
        endpoint: where they meet; nobody may listen there yet.
        watch: follows the run on the bus until its event is set; runs in a thread of its own.
        wait_s: longest time until the log begins; None: as long as the processes need, which are told every half minute.

    Raises Fault ENDPOINT_BUSY, NO_PEER after `wait_s`, the Fault of the child that failed first, PEER_DIED when one was killed,
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
        _until_the_end(children, Beginning(children, log, wait_s))
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
    """Ctrl-C, SIGTERM and SIGHUP wait for the end of the block: a child that is not noted yet would be left behind."""
    came: list[int] = []

    def note(number: int, _frame: Any) -> None:
        came.append(number)

    before = handle_endings(note)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if came:
        signal.raise_signal(came[0])


class Beginning:
    """Until the log begins: who compiles or is not there yet is told now and then.

    A first start compiles for up to a minute, and on a busy or small computer for several: no time is too long for it.
    """

    def __init__(self, children: list[Child], log: Path, wait_s: float | None) -> None:
        self._children = children
        self._log = log
        self._before = self._stamp()
        self._since_s = time.monotonic()
        self._due_s = self._since_s + _TOLD_S
        self._wait_s = wait_s
        self._begun = False
        self._progress = Progress()

    def _stamp(self) -> tuple[int, int] | None:
        if not self._log.is_file():
            return None
        now = self._log.stat()
        return now.st_mtime_ns, now.st_size

    def look(self) -> None:
        """Tell what is waited for where it is due. Raises Fault NO_PEER after the longest time."""
        self._progress.show(*(sum(counts) for counts in zip(*(child.left for child in self._children), strict=True)))
        now_s = time.monotonic()
        late = self._wait_s is not None and now_s > self._since_s + self._wait_s
        if self._begun or not (late or now_s > self._due_s):
            return
        self._begun = self._stamp() != self._before
        if self._begun:
            return
        waited_s = now_s - self._since_s
        what = self._what_is_missing()
        if late:
            raise Fault(
                "NO_PEER", f"{what} after {waited_s:.0f} s; give the start longer: --wait S, or no --wait at all"
            )
        if not any(child.still == COMPILES for child in self._children):  # which the progress shows
            say(f"waiting  {what}, since {waited_s:.0f} s; Ctrl-C ends it")
        self._due_s = now_s + _TOLD_S

    def _what_is_missing(self) -> str:
        who: list[str] = []
        for still in (COMPILES, STARTS):
            roles = [child.role for child in self._children if child.still == still]
            if roles:
                who.append(f"the {' and the '.join(roles)} still {still if len(roles) == 1 else still[:-1]}")
        return ", ".join(who) or "plant, controller and recorder have not found each other"


def _until_the_end(children: list[Child], beginning: Beginning) -> None:
    """Wait for all to end well; raise for the first that does not."""
    while True:
        beginning.look()
        ended = [child for child in children if child.process.poll() is not None]
        failed = [child for child in ended if child.process.returncode != 0]
        if failed:
            # the others fail in the wake of the first: the one that was killed, or that names a cause, is the news
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
    """Ask all to stop, in order, and end those that do not."""
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
