"""The end of the time for a diagnosis: by the budget, and by Ctrl-C, whatever the main thread computes then."""

import os
import signal
import threading
import time

import pytest

from diagnosis.deadline import EndedError, OutOfTimeError, ended_by_ctrl_c, forecast, limited
from tests.patience import PATIENCE_S


def test_a_body_ends_at_its_limit_whatever_it_does():
    with pytest.raises(OutOfTimeError), limited(time.monotonic() + 0.02):
        time.sleep(PATIENCE_S)
    with pytest.raises(OutOfTimeError), limited(time.monotonic() - 1.0):
        time.sleep(PATIENCE_S)


def test_a_body_within_its_limit_leaves_handler_and_timer_as_they_were():
    rung: list[int] = []
    handler = signal.signal(signal.SIGALRM, lambda number, _: rung.append(number))
    before = signal.setitimer(signal.ITIMER_REAL, 0.2)
    try:
        with limited(time.monotonic() + PATIENCE_S), limited(float("inf")):
            pass
        signal.pause()
        assert rung == [signal.SIGALRM]
    finally:
        signal.setitimer(signal.ITIMER_REAL, *before)
        signal.signal(signal.SIGALRM, handler)


def test_another_thread_has_no_limit():
    ended: list[str] = []

    def work() -> None:
        with limited(time.monotonic() - 1.0):
            ended.append("by itself")

    thread = threading.Thread(target=work)
    thread.start()
    thread.join(PATIENCE_S)
    assert ended == ["by itself"]


def test_the_first_ctrl_c_asks_for_the_answer_and_the_second_ends():
    before, pressed = signal.getsignal(signal.SIGINT), threading.Event()
    with pytest.raises(KeyboardInterrupt), ended_by_ctrl_c(pressed):  # noqa: PT012
        assert not pressed.is_set()
        with pytest.raises(EndedError):
            os.kill(os.getpid(), signal.SIGINT)
        assert pressed.is_set()
        os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before
    with pytest.raises(KeyboardInterrupt), ended_by_ctrl_c(threading.Event()):
        os.kill(os.getpid(), signal.SIGINT)  # nothing handles it


def test_the_forecast_is_shared_by_the_processes():
    assert forecast(30.0, 1, 1e-3) == "18 to 45 s"
    assert forecast(30.0, 2, 1e-3) == "14 to 34 s"  # half of the work is one thread at a time
