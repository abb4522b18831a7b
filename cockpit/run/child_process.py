"""Running as one process among several: signals, a dying parent, one clear line for every fault."""

import contextlib
import errno
import functools
import io
import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator
from typing import Any

from bridge import compiling
from bridge.faults import Fault
from bridge.plain import say
from bridge.wire import realtime

_PARENT_CHECK_S = 0.25
_LONG_S = 2.0  # of work that nobody waits for without a word; shorter: a busy computer tells of every run of seconds
# a full disk, a size limit, a quota, a terminal that went away, a file that was closed
_STDOUT_REFUSED = frozenset({errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO, errno.EBADF})
_LONGEST_NAME = 255  # of a file; what is longer holds a name
# what `stickslip[all]` brings and a plain installation lacks
EXTRA_MODULES = frozenset(
    {
        "clevercsv", "h5py", "jinja2", "joblib", "mcap_ros2", "nptdms", "pyarrow", "python_calamine", "threadpoolctl",
        "xlsxwriter",
    }
)  # fmt: skip


def stop_event(parent: int = 0) -> threading.Event:
    """An event that Ctrl-C, SIGTERM and SIGHUP set, and for a child the death of its parent: no orphan keeps a rig running.

    Args:
        parent: the process that started this one; asked for only here, it could be dead and another in its place. 0: nobody
            watches.

    """
    stop = threading.Event()

    def on_signal(_number: int, _frame: Any) -> None:
        stop.set()

    handle_endings(on_signal)
    if parent:

        def watch() -> None:
            while os.getppid() == parent and not stop.wait(_PARENT_CHECK_S):
                pass
            stop.set()

        threading.Thread(target=watch, daemon=True, name="parent").start()
    return stop


def _like_ctrl_c() -> list[signal.Signals]:
    """SIGTERM, and SIGHUP of a terminal that closes, but for a command that was started with nohup, which ignores it."""
    hangs_up = signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN
    return [signal.SIGTERM, signal.SIGHUP] if hangs_up else [signal.SIGTERM]


def handle_endings(handler: Callable[[int, Any], Any]) -> dict[signal.Signals, Any]:
    """Let Ctrl-C, SIGTERM and SIGHUP do the same; the handlers before, by signal."""
    return {number: signal.signal(number, handler) for number in (signal.SIGINT, *_like_ctrl_c())}


def end_like_ctrl_c() -> None:
    """Let SIGTERM and SIGHUP end the command as Ctrl-C does: it stops its workers, keeps whole files, and says INTERRUPTED."""

    def on_signal(number: int, _frame: Any) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    for number in _like_ctrl_c():
        signal.signal(number, on_signal)


@contextlib.contextmanager
def stopped_once() -> Generator[None]:
    """Ctrl-C, SIGTERM or SIGHUP raises KeyboardInterrupt in what is done here, once: what then stops and judges goes on."""
    came = threading.Event()

    def on_signal(number: int, _frame: Any) -> None:
        if not came.is_set():
            came.set()
            raise KeyboardInterrupt("" if number == signal.SIGINT else signal.Signals(number).name)

    before = handle_endings(on_signal)
    try:
        yield
    finally:
        for number, handler in before.items():
            # after one the command ends, and until then another would end it without its status
            signal.signal(number, signal.SIG_IGN if came.is_set() else handler)


@contextlib.contextmanager
def left_on_ctrl_c(line: str, left: str, again: bool) -> Generator[None]:
    """Work that Ctrl-C, SIGTERM or SIGHUP ends with Fault INTERRUPTED; a line on stderr says so where it takes long.

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
        say(line)

    def on_signal(_number: int, _frame: Any) -> None:
        if heeded.is_set():
            raise KeyboardInterrupt

    before = handle_endings(on_signal)
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


@contextlib.contextmanager
def _ended_at_once(as_json: bool) -> Generator[None]:
    """Ctrl-C, SIGTERM or SIGHUP ends the process here and now, with status and line of INTERRUPTED.

    A handler in Python has to wait for the compiler, seconds at a time, and an exception from it ends one function of
    hundreds. So a thread reads the signal's number from a pipe, into which the interpreter writes it at once. No kernel is kept
    half.
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
    """Say on stderr where a process that keeps time would get no real-time priority."""
    if not realtime.may_claim():
        print(f"stickslip: warning: {realtime.NORMAL}: {realtime.NOT_GUARANTEED}", file=sys.stderr)


def report(fault: Fault, as_json: bool) -> int:
    """Print a fault, one line on stderr or a JSON object on stdout; its exit status."""
    if as_json:
        print(json.dumps({"fault": fault.kind.code, "line": fault.line, "exit_status": fault.kind.exit_status}))
    else:
        say(f"stickslip: {fault.kind.code}: {fault.line}")
    return fault.kind.exit_status


def guarded(work: Callable[[], int | None], as_json: bool = False) -> int:
    """Run a command's work; its exit status, faults and Ctrl-C included."""
    compiling.guard = functools.partial(_ended_at_once, as_json)
    try:
        status = _status(work, as_json)
        sys.stdout.flush()  # here, where a closed pipe or a full disk can still be told
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
    """Let stdout escape what its encoding does not have, and refuse what is written where the caller closed it."""
    if sys.stdout is None:  # pyright: ignore[reportUnnecessaryComparison]
        # not closed, or the next file that is opened would be stdout; not to be written, or a result would be lost unsaid
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w", encoding="utf-8")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def _stdout_to_nowhere() -> None:
    """Let what is left in the buffer of stdout go nowhere: else the interpreter fails at its end as well."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _status(work: Callable[[], int | None], as_json: bool) -> int:
    try:
        return work() or 0
    except Fault as fault:
        return report(fault, as_json)
    except KeyboardInterrupt as ended:
        return report(Fault("INTERRUPTED", f"stopped by {str(ended) or 'Ctrl-C'}"), as_json)
    except MemoryError:
        files = ", ".join(word for word in sys.argv[1:] if os.access(word, os.F_OK)) or "the command"
        line = f"{files}: needs more memory than there is; end other programs, or use a machine with more or a smaller file"
        return report(Fault("NO_MEMORY", line), as_json)
    except UnicodeEncodeError as error:  # of a library that takes only UTF-8; stdout escapes what it cannot show
        name = error.object if len(error.object) <= _LONGEST_NAME else error.object[error.start : error.end]
        shown = name.encode(errors="backslashreplace").decode()
        line = f"{shown}: is not UTF-8, which is needed here; rename it"
        return report(Fault("CONFIG", line), as_json)
    except ModuleNotFoundError as error:
        module = (error.name or "").partition(".")[0]
        if module not in EXTRA_MODULES and module != "foxglove":  # which is large, and of one option: no part of [all]
            raise
        extra = "foxglove" if module == "foxglove" else "all"
        line = f"this command needs {module}, which is not installed; pip install 'stickslip[{extra}]'"
        return report(Fault("MISSING_EXTRA", line), as_json)
