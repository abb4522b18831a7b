"""The end of the time for a diagnosis: by its budget, or by Ctrl-C. What is known by then is the answer."""

import math
import signal
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any, Never

# Time for the answer after Ctrl-C [s]. Smaller: the held-out runs, which take 1 s, are not compared. Larger: the operator waits.
GRACE_S = 2.0


class OutOfTimeError(Exception):
    """The time is used up; the best answer so far is the result."""


class EndedError(OutOfTimeError):
    """Ctrl-C: the operator wants the best answer so far."""


@contextmanager
def limited(until_s: float) -> Generator[None]:
    """A body that OutOfTimeError ends at `until_s` of `time.monotonic`, whatever it computes then.

    Only in the main thread, which alone gets signals. An earlier timer of the process goes on.
    """
    if math.isinf(until_s) or threading.current_thread() is not threading.main_thread():
        yield
        return

    def on_alarm(_number: int, _frame: Any) -> Never:
        raise OutOfTimeError

    began_s, handler = time.monotonic(), signal.signal(signal.SIGALRM, on_alarm)
    left_s, _ = signal.setitimer(signal.ITIMER_REAL, max(until_s - began_s, 1e-6))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, max(left_s - (time.monotonic() - began_s), 1e-6) if left_s else 0.0)
        signal.signal(signal.SIGALRM, handler)


@contextmanager
def ended_by_ctrl_c() -> Generator[None]:
    """A body in which the first Ctrl-C raises EndedError; a second one, or one that nothing handles, KeyboardInterrupt."""

    def on_signal(_number: int, _frame: Any) -> Never:
        signal.signal(signal.SIGINT, handler)
        raise EndedError

    handler = signal.signal(signal.SIGINT, on_signal)
    try:
        yield
    except EndedError:
        raise KeyboardInterrupt from None
    finally:
        signal.signal(signal.SIGINT, handler)
