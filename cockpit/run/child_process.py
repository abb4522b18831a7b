"""Running as one process among several: signals, a dying parent, one clear line for every fault."""

import contextlib
import errno
import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator
from typing import Any

from bridge.faults import Fault
from bridge.wire import realtime

_PARENT_CHECK_S = 0.25
_LONG_S = (
    2.0  # of work that nobody waits for without a word; shorter, and a busy computer tells of every run of seconds
)
# what `stickslip[all]` brings and a plain installation lacks
EXTRA_MODULES = frozenset({"jinja2", "joblib", "nptdms", "pyarrow", "threadpoolctl"})


def stop_event(parent: int = 0) -> threading.Event:
    """An event that SIGINT and SIGTERM set, and for a child the death of its parent: no orphan keeps a rig running.

    Args:
        parent: the process that started this one; asked for only here, it could be dead and another in its place. 0: nobody
            watches.

    """
    stop = threading.Event()

    def on_signal(_number: int, _frame: Any) -> None:
        stop.set()

    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # a terminal that closes; nohup ignores it
        signal.signal(signal.SIGHUP, on_signal)
    if parent:

        def watch() -> None:
            while os.getppid() == parent and not stop.wait(_PARENT_CHECK_S):
                pass
            stop.set()

        threading.Thread(target=watch, daemon=True, name="parent").start()
    return stop


def end_like_ctrl_c() -> None:
    """Let SIGTERM end the command as Ctrl-C does: it stops its workers, keeps whole files only, and says INTERRUPTED."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)


@contextlib.contextmanager
def stopped_once() -> Generator[None]:
    """Ctrl-C or SIGTERM raises KeyboardInterrupt in what is done here, once: what then stops and judges is not interrupted."""
    came = threading.Event()

    def on_signal(_number: int, _frame: Any) -> None:
        if not came.is_set():
            came.set()
            raise KeyboardInterrupt

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            # after one the command ends, and until then another would end it without its status
            signal.signal(number, signal.SIG_IGN if came.is_set() else handler)


@contextlib.contextmanager
def left_on_ctrl_c(line: str, left: str, again: bool) -> Generator[None]:
    """Work that Ctrl-C or SIGTERM ends with Fault INTERRUPTED; a line on stderr says so where it takes long.

    Args:
        line: what is done, and that Ctrl-C leaves it.
        left: what the fault says.
        again: Ctrl-C was pressed before. Until the line came, another is that of a person who presses it twice: it does nothing.

    """
    heeded = threading.Event()
    if not again:
        heeded.set()

    def tell() -> None:
        heeded.set()
        print(line, file=sys.stderr, flush=True)

    def on_signal(_number: int, _frame: Any) -> None:
        if heeded.is_set():
            raise KeyboardInterrupt

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    timer = threading.Timer(_LONG_S, tell)
    timer.daemon = True
    timer.start()
    try:
        yield
    except KeyboardInterrupt:
        raise Fault("INTERRUPTED", left) from None
    finally:
        timer.cancel()
        for number, handler in before.items():
            signal.signal(number, handler)


def warn_without_priority() -> None:
    """Say on stderr where a process that keeps time would get no real-time priority."""
    if not realtime.may_claim():
        print(f"stickslip: warning: {realtime.NORMAL}: {realtime.NOT_GUARANTEED}", file=sys.stderr)


def report(fault: Fault, as_json: bool) -> int:
    """Print a fault, one line on stderr or a JSON object on stdout; its exit status."""
    if as_json:
        print(json.dumps({"fault": fault.kind.code, "line": fault.line, "exit_status": fault.kind.exit_status}))
    else:
        print(f"stickslip: {fault.kind.code}: {fault.line}", file=sys.stderr)
    return fault.kind.exit_status


def guarded(work: Callable[[], int | None], as_json: bool = False) -> int:
    """Run a command's work; its exit status, faults and Ctrl-C included."""
    try:
        status = _status(work, as_json)
        if sys.stdout is not None:  # None where the caller closed it  # pyright: ignore[reportUnnecessaryComparison]
            sys.stdout.flush()  # here, where a closed pipe or a full disk can still be told
    except BrokenPipeError:
        _stdout_to_nowhere()
        return 128 + signal.SIGPIPE
    except OSError as error:
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        _stdout_to_nowhere()
        return report(
            Fault("LOG_WRITE", "stdout: cannot be written: the disk is full; free space or write elsewhere"), False
        )
    return status


def _stdout_to_nowhere() -> None:
    """Let what is left in the buffer of stdout go nowhere: else the interpreter fails at its end as well."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _status(work: Callable[[], int | None], as_json: bool) -> int:
    try:
        return work() or 0
    except Fault as fault:
        return report(fault, as_json)
    except KeyboardInterrupt:
        return report(Fault("INTERRUPTED", "stopped by Ctrl-C"), as_json)
    except ModuleNotFoundError as error:
        module = (error.name or "").partition(".")[0]
        if module not in EXTRA_MODULES:
            raise
        line = f"this command needs {module}, which is not installed; pip install 'stickslip[all]'"
        return report(Fault("MISSING_EXTRA", line), as_json)
