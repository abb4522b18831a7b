"""The time of a diagnosis: an estimate, and its end by the budget or by Ctrl-C. The best answer by then is the result."""

import math
import signal
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any, Never

# Time for the answer after Ctrl-C [s]. Smaller: the held-out runs, which take 1 s, are not compared. Larger: the operator waits.
GRACE_S = 2.0
# Predictions of all fitted runs that a diagnosis takes: counted on 9 made rigs (docs/method/diagnosis.md); for an estimate
_FEW, _MANY = 600, 1500
# Share of a prediction that a single thread computes at a time: its features. The simulation, 0.5 of it, runs in all threads.
_ONE_AT_A_TIME = 0.5
# Computing time of a simulated second on an idle core before it is measured [s/s]: four rigs of 30 s, 46 s of CPU
_USUAL_PACE = 1e-3


class OutOfTimeError(Exception):
    """The time is used up; the best answer so far is the result."""


class EndedError(OutOfTimeError):
    """Ctrl-C: the operator wants the best answer so far."""


def forecast(fitted_s: float, jobs: int, pace: float = _USUAL_PACE) -> str:
    """The time that the simulated fits take, in words, for runs of `fitted_s` in total."""
    prediction_s = pace * fitted_s * (_ONE_AT_A_TIME + (1.0 - _ONE_AT_A_TIME) / jobs)
    return f"{_FEW * prediction_s:.0f} to {_MANY * prediction_s:.0f} s"


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
def ended_by_ctrl_c(pressed: threading.Event) -> Generator[None]:
    """A body: its first Ctrl-C sets `pressed` and raises EndedError; the next, or an unhandled first, KeyboardInterrupt."""

    def on_signal(_number: int, _frame: Any) -> Never:
        signal.signal(signal.SIGINT, handler)
        pressed.set()
        raise EndedError

    handler = signal.signal(signal.SIGINT, on_signal)
    try:
        yield
    except EndedError:
        raise KeyboardInterrupt from None
    finally:
        signal.signal(signal.SIGINT, handler)
