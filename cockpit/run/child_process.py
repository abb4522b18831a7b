"""Behaviour of each process: signals, the death of the parent, one line for every fault, lines of a process started alone."""

import contextlib
import errno
import functools
import io
import json
import os
import queue
import select
import signal
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any, NamedTuple

from bridge import compiling
from bridge.faults import Fault, install
from bridge.plain import StepReport, no_report, print_line
from bridge.wire import realtime

# Interval at which the death of the parent is noticed. 0.25: the exciter vibrated up to 0.25 s after a SIGKILL of its test,
# longer than a dead man of 0.1 s. 0.01: a hundred wake-ups a second in each process of a run.
_PARENT_CHECK_S = 0.05
# Work that takes longer prints a line. Larger: the operator waits without a message. Smaller: on a busy computer short runs
# print it too.
_LONG_S = 2.0
# errors of a write to stdout that are reported as LOG_WRITE: full disk, size limit, quota, closed terminal, closed file
_STDOUT_REFUSED = frozenset({errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO, errno.EBADF})
_LONGEST_NAME = 255  # characters of the longest file name; of a longer text only the invalid characters are shown
# modules of `stickslip[all]` that a plain installation lacks
EXTRA_MODULES = frozenset(
    {
        "chardet", "clevercsv", "h5py", "jinja2", "joblib", "mcap_protobuf", "mcap_ros2", "nptdms", "pyarrow",
        "python_calamine", "threadpoolctl",
        "xlsxwriter",
    }
)  # fmt: skip

_LAST_LINES_S = 1.0  # longest wait at the end of a process for its queued lines on stderr


def stop_event(parent: int = 0) -> threading.Event:
    """An event that Ctrl-C, SIGTERM and SIGHUP set. The death of the parent sets it too, so that no orphan runs a rig.

    Args:
        parent: process id of the parent, passed by it: os.getppid() here would miss a parent that has already died. 0: none.

    """
    stop = threading.Event()
    # `stop.set` in the handler would wait for ever if the signal came within `stop.wait` or within an earlier handler, which hold
    # its lock. A pipe may be written at any point, and a thread passes the signal on.
    read, write = os.pipe()
    handle_endings(lambda _number, _frame: os.write(write, b"!"))

    def watch() -> None:
        while not parent or os.getppid() == parent:
            if select.select([read], [], [], _PARENT_CHECK_S if parent else None)[0]:
                break
        stop.set()

    threading.Thread(target=watch, daemon=True, name="endings").start()
    return stop


def _ending_signals() -> list[signal.Signals]:
    """SIGTERM, and SIGHUP, which a closing terminal sends, unless the command was started with nohup."""
    hangs_up = signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN
    return [signal.SIGTERM, signal.SIGHUP] if hangs_up else [signal.SIGTERM]


def handle_endings(handler: Callable[[int, Any], Any]) -> dict[signal.Signals, Any]:
    """Handle Ctrl-C, SIGTERM and SIGHUP alike; return the earlier handlers by signal."""
    return {number: signal.signal(number, handler) for number in (signal.SIGINT, *_ending_signals())}


@contextlib.contextmanager
def endings_handled(handler: Callable[[int, Any], Any]) -> Generator[None]:
    """Handle Ctrl-C, SIGTERM and SIGHUP alike in the body."""
    before = handle_endings(handler)
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def end_like_ctrl_c() -> None:
    """Let SIGTERM and SIGHUP end the command like Ctrl-C: it stops its workers, keeps whole files, reports INTERRUPTED."""

    def on_signal(number: int, _frame: Any) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    for number in _ending_signals():
        signal.signal(number, on_signal)


@contextlib.contextmanager
def stopped_once() -> Generator[None]:
    """The first Ctrl-C, SIGTERM or SIGHUP raises KeyboardInterrupt in the body; later ones do not disturb its cleanup."""
    stopped: list[int] = []  # no Event: a second signal within its `set` would wait for the lock of the first for ever

    def on_signal(number: int, _frame: Any) -> None:
        if not stopped:
            stopped.append(number)
            raise KeyboardInterrupt("" if number == signal.SIGINT else signal.Signals(number).name)

    before = handle_endings(on_signal)
    try:
        yield
    finally:
        for number, handler in before.items():
            # after a signal the command is about to end; a second signal would end it without its exit status
            signal.signal(number, signal.SIG_IGN if stopped else handler)


@contextlib.contextmanager
def left_on_ctrl_c(line: str, left: str, again: bool) -> Generator[None]:
    """Work that Ctrl-C, SIGTERM or SIGHUP ends with Fault INTERRUPTED; after 2 s a line on stderr announces this.

    Args:
        line: names the work, and that Ctrl-C ends it.
        left: text of the fault.
        again: Ctrl-C was pressed before. Another one before the line is a double press, and is ignored.

    """
    enabled = threading.Event()
    if not again:
        enabled.set()

    def announce() -> None:
        enabled.set()
        print_line(line)

    def on_signal(_number: int, _frame: Any) -> None:
        if enabled.is_set():
            raise KeyboardInterrupt

    timer = threading.Timer(_LONG_S, announce)
    timer.daemon = True
    with endings_handled(on_signal):
        timer.start()
        try:
            yield
        except KeyboardInterrupt:
            raise Fault("INTERRUPTED", left) from None
        finally:
            timer.cancel()


@contextlib.contextmanager
def _ended_at_once(as_json: bool) -> Generator[None]:
    """Ctrl-C, SIGTERM or SIGHUP ends the process at once, with status and line of INTERRUPTED.

    A handler in Python waits for the compiler, for seconds, and its exception would end only one of hundreds of functions. So
    a thread reads the signal's number from a pipe, into which the interpreter writes it at once. No incomplete kernel is cached.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    read, write = os.pipe()
    os.set_blocking(write, False)
    endings = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}

    def wait() -> None:
        while number := os.read(read, 1):
            if number[0] in endings:
                name = "Ctrl-C" if number[0] == signal.SIGINT else signal.Signals(number[0]).name
                status = report(Fault("INTERRUPTED", f"stopped by {name} while kernels were compiled"), as_json)
                sys.stdout.flush()
                os._exit(status)

    watcher = threading.Thread(target=wait, name="endings", daemon=True)
    watcher.start()
    before = signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(write)
        watcher.join()
        os.close(read)


def warn_without_priority() -> None:
    """Warn on stderr if this process will get no real-time priority."""
    if not realtime.may_claim():
        print(f"stickslip: warning: {realtime.NORMAL}: {realtime.NOT_GUARANTEED}", file=sys.stderr)


class ReportedFault(NamedTuple):
    """A fault as the JSON object that `--json` prints."""

    fault: str  # code
    line: str
    exit_status: int


def report(fault: Fault, as_json: bool) -> int:
    """Print a fault, as one line on stderr or a JSON object on stdout; return its exit status."""
    if as_json:
        print(json.dumps(ReportedFault(fault.kind.code, fault.line, fault.kind.exit_status)._asdict()))
    else:
        print_line(f"stickslip: {fault.kind.code}: {fault.line}")
    return fault.kind.exit_status


def exit_status_of(work: Callable[[], int | None], as_json: bool = False) -> int:
    """Run a command's work; return its exit status, also for faults and Ctrl-C."""
    compiling.guard = functools.partial(_ended_at_once, as_json)
    try:
        status = _status(work, as_json)
        sys.stdout.flush()  # a closed pipe or a full disk can still be reported here
    except BrokenPipeError:
        _stdout_to_nowhere()
        return 128 + signal.SIGPIPE
    except OSError as error:
        if error.errno not in _STDOUT_REFUSED or error.filename is not None:
            raise
        _stdout_to_nowhere()
        line = f"stdout: cannot be written: {error.strerror}; free space or write elsewhere"
        return report(Fault("LOG_WRITE", line), False)
    return status


def prepare_stdout() -> None:
    """Let stdout escape characters that its encoding lacks. If the caller closed stdout, let every write to it fail."""
    if sys.stdout is None:  # pyright: ignore[reportUnnecessaryComparison]
        # Open, so that the next opened file does not become stdout; read-only, so that a lost result is reported.
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w", encoding="utf-8")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def _stdout_to_nowhere() -> None:
    """Discard the buffer of stdout, which would otherwise fail again at the end of the interpreter."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _status(work: Callable[[], int | None], as_json: bool) -> int:
    try:
        return work() or 0
    except Fault as fault:
        return report(fault, as_json)
    except KeyboardInterrupt as ended:
        return report(Fault("INTERRUPTED", f"stopped by {str(ended) or 'Ctrl-C'}"), as_json)
    except MemoryError:
        files = ", ".join(argument for argument in sys.argv[1:] if os.access(argument, os.F_OK)) or "the command"
        line = (
            f"{files}: needs more memory than is free; end other programs, or use a larger computer or a smaller file"
        )
        return report(Fault("NO_MEMORY", line), as_json)
    except UnicodeEncodeError as error:  # raised by a library that accepts only UTF-8 names; stdout escapes such names
        name = error.object if len(error.object) <= _LONGEST_NAME else error.object[error.start : error.end]
        shown = name.encode(errors="backslashreplace").decode()
        line = f"{shown}: must be UTF-8; rename it"
        return report(Fault("CONFIG", line), as_json)
    except ModuleNotFoundError as error:
        module = (error.name or "").partition(".")[0]
        if module not in EXTRA_MODULES and module != "foxglove":  # not in [all]: large, and used by one option only
            raise
        extra = "foxglove" if module == "foxglove" else "all"
        line = f"this command needs {module}, which is not installed; {install(extra)}"
        return report(Fault("MISSING_EXTRA", line), as_json)


@contextmanager
def step_reports(quiet: bool) -> Generator[StepReport]:
    """A function that prints a line on stderr, e.g. `waiting  for a rig`, in a thread: Ctrl-S must not stall a control loop.

    Args:
        quiet: print nothing, as a child of `stickslip run`.

    """
    if quiet:
        yield no_report
        return
    lines: queue.Queue[str | None] = queue.Queue()

    def print_lines() -> None:
        while (line := lines.get()) is not None:
            print_line(line)

    # Started before the process claims its priority for all its threads, this one too: the loop may wait for its Python lock.
    thread = threading.Thread(target=print_lines, name="step lines", daemon=True)
    thread.start()
    try:
        yield lambda label, text: lines.put(f"{label:<8} {text}")
    finally:
        lines.put(None)
        thread.join(_LAST_LINES_S)
