"""Work that a thread repeats as long as its process lives."""

import contextlib
import threading
import time
from collections.abc import Callable

_REPORT_S = 10.0  # shortest time between two reports of failed work; shorter: work that always fails fills a log


def repeat(work: Callable[[], object], every_s: float, over: threading.Event, report: Callable[[str], object]) -> None:
    """Call `work` each `every_s` until `over` is set. An error, such as too many open files, is reported and ends nothing."""
    reported_s = -_REPORT_S
    while not over.wait(every_s):
        try:
            work()
        except Exception as error:
            if time.monotonic() - reported_s >= _REPORT_S:
                reported_s = time.monotonic()
                with contextlib.suppress(Exception):
                    report(f"{threading.current_thread().name}: {type(error).__name__}: {error}; tried again")
