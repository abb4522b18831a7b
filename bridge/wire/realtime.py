"""Settings of the operating system with which a process keeps a period of 1 ms: core, priority, timer slack."""

import contextlib
import ctypes
import functools
import gc
import os
import resource
import sys
import threading
from pathlib import Path

from bridge.wire.clock import time

_PR_SET_TIMERSLACK = 29
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = (
    1,
    2,
    4,
)  # on fault: the stacks of all threads, 8 MB each, are not filled at once
LOOP_PRIORITY = 50
# Lockstep waits for nobody's clock: it goes on where the loops in real time and their recorders leave a core to it. Without a
# priority of its own it took half as long again (docs/method/bridge.md).
LOCKSTEP_PRIORITY = 1
RECORDER_PRIORITY = 10  # below the loop, above every process without SCHED_FIFO: a starved recorder loses blocks
VIEWER_PRIORITY = 1  # of who only looks on: below the loop and the recorder, above every process without SCHED_FIFO

# A wait that ends so much later was a pause of this process. Shorter: a busy core looks like one. Longer: a peer is given up.
_PAUSE_S = 0.25
NORMAL = "normal scheduling"  # how the text of a START event begins where SCHED_FIFO was refused
NOT_GUARANTEED = "real time is not guaranteed; grant CAP_SYS_NICE or an rtprio limit"


def core(place: int) -> int | None:
    """The core for a thread number `place` among those that this process may use; None where the system does not tell.

    `taskset` decides which cores these are: with two cores for each rig, no rig holds up another.
    """
    if not hasattr(os, "sched_getaffinity"):
        return None
    cores = sorted(os.sched_getaffinity(0))
    return cores[place % len(cores)]


def _threads() -> list[int]:
    tasks = Path("/proc/self/task")
    return [int(entry.name) for entry in tasks.iterdir()] if tasks.exists() else []


def pin(to_core: int | None) -> bool:
    """Keep every thread of this process on a core, which needs no privilege; whether that was done.

    Call it after the bus is open, so that the threads of the bus are included. It reduced the median round trip from 143 to
    88 us.
    """
    if to_core is None:
        return False
    threads = _threads()
    for thread in threads:
        with contextlib.suppress(OSError):  # a thread may have ended meanwhile
            os.sched_setaffinity(thread, {to_core})
    return bool(threads)


def claim(to_core: int | None, priority: int = LOOP_PRIORITY) -> str:
    """Pin this process, ask for SCHED_FIFO and keep its memory from being paged out; return what was granted, in words.

    Call it after the bus is open, so that the threads of the bus are included. Also stops the garbage collector.

    Without SCHED_FIFO, 0.6 to 1.4 % of the answers miss 1 ms on a computer whose cores are all busy.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    pinned = pin(to_core)
    threads = _threads()
    fifo = bool(threads)
    for thread in threads:
        try:
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
        except ProcessLookupError:
            continue
        except PermissionError:
            fifo = False
    if threads:
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1)
    where = f"core {to_core}" if pinned else "any core"
    memory = "memory locked" if _lock_memory() else "memory not locked"
    if fifo:
        return f"SCHED_FIFO {priority}, {where}, {memory}"
    return f"{NORMAL}, {where}, {memory}: {NOT_GUARANTEED}"


@functools.cache  # before this process is moved to them
def _beside_the_loop() -> frozenset[int]:
    """The cores of this process but for those of the loop's two processes; none on a computer with two."""
    if not hasattr(os, "sched_getaffinity"):
        return frozenset()
    return frozenset(os.sched_getaffinity(0)) - {core(0), core(1)}


def hasten() -> None:
    """Let this process go before all without SCHED_FIFO, where it may: for one who only looks on, and keeps no time.

    Where all cores are busy it otherwise waits for some 100 ms, and so does an operator's STOP. Later threads inherit it.
    """
    beside = _beside_the_loop()
    for thread in _threads():
        with contextlib.suppress(OSError):
            if beside:
                os.sched_setaffinity(thread, beside)
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(VIEWER_PRIORITY))


def _lock_memory() -> bool:
    """Keep what this process has touched, and what it will touch, in memory; whether the system grants it.

    Under a limit of locked memory nothing is asked for: a later allocation would fail then.
    """
    if not sys.platform.startswith("linux"):
        return False
    if os.geteuid() != 0 and resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] != resource.RLIM_INFINITY:
        return False
    return ctypes.CDLL(None).mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) == 0


def let_the_bus_send() -> None:
    """Let the thread that sends run now: it has this thread's core and priority, and waits until the loop sleeps otherwise.

    Without it a command takes 410 to 440 us in the median in place of 320 to 350 (docs/method/bridge.md).
    """
    os.sched_yield()


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


def was_paused(since_s: float, due_s: float) -> bool:
    """Whether this process itself stood still: a wait from `since_s` until `due_s` ended much later (`time.monotonic`).

    The silence of a peer in that time says nothing of the peer.
    """
    return time.monotonic() > max(since_s, due_s) + _PAUSE_S


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
