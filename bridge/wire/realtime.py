"""Settings of the operating system with which a process keeps a period of 1 ms: core, priority, timer slack."""

import contextlib
import ctypes
import gc
import os
import threading
import time
from pathlib import Path

_PR_SET_TIMERSLACK = 29
LOOP_PRIORITY = 50
RECORDER_PRIORITY = 10  # below the loop, above every process without SCHED_FIFO: a starved recorder loses blocks

NORMAL = "normal scheduling"  # how the text of a START event begins where SCHED_FIFO was refused
NOT_GUARANTEED = "real time is not guaranteed; grant CAP_SYS_NICE or an rtprio limit"


def claim(core: int | None, priority: int = LOOP_PRIORITY) -> str:
    """Pin every thread of this process to `core` (None: no pinning) and ask for SCHED_FIFO; return what was granted, in words.

    Call it after the bus is open, so that the threads of the bus are included. Also stops the garbage collector.

    Pinning needs no privilege; it reduced the median round trip from 143 to 88 us. Without SCHED_FIFO, 0.6 to 1.4 % of the
    answers miss 1 ms on a computer whose cores are all busy.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    threads = (
        [int(entry.name) for entry in Path("/proc/self/task").iterdir()] if Path("/proc/self/task").exists() else []
    )
    pinned = bool(threads) and core is not None and core in os.sched_getaffinity(0)
    fifo = bool(threads)
    for thread in threads:
        if pinned and core is not None:
            with contextlib.suppress(OSError):  # a thread may have ended meanwhile
                os.sched_setaffinity(thread, {core})
        try:
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
        except ProcessLookupError:
            continue
        except PermissionError:
            fifo = False
    if threads:
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1)
    where = f"core {core}" if pinned else "any core"
    if fifo:
        return f"SCHED_FIFO {priority}, {where}"
    return f"{NORMAL}, {where}: {NOT_GUARANTEED}"


def may_claim(priority: int = LOOP_PRIORITY) -> bool:
    """Whether this process could get SCHED_FIFO. Tried in a thread that ends at once, so that nothing keeps the priority."""
    granted: list[bool] = []

    def attempt() -> None:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(threading.get_native_id(), os.SCHED_FIFO, os.sched_param(priority))
            granted.append(True)

    thread = threading.Thread(target=attempt)
    thread.start()
    thread.join()
    return bool(granted)


class Pacer:
    """Wakes once a period at absolute times, so that the duration of the work between does not add up."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._start_ns = time.perf_counter_ns()

    def wait(self, tick: int) -> int:
        """Sleep until the end of period `tick` (from 0) and return how late that was [ns]."""
        due_ns = self._start_ns + (tick + 1) * self._period_ns
        left_ns = due_ns - time.perf_counter_ns()
        if left_ns > 0:
            time.sleep(left_ns * 1e-9)
        return time.perf_counter_ns() - due_ns
