"""Settings of the operating system for a period of 1 ms: core, priority, timer slack, locked memory."""

import contextlib
import ctypes
import functools
import gc
import os
import resource
import threading
from collections.abc import Generator, Iterable
from pathlib import Path

from bridge.wire.clock import Wait, time

_PR_SET_TIMERSLACK = 29
# `on fault` locks pages at their first use, so that thread stacks of 8 MB each are not filled
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
LOOP_PRIORITY = 50
# Lockstep has no deadlines, so it runs below real-time loops and their recorders. With normal scheduling it took 1.5 times as
# long (docs/method/rig.md).
LOCKSTEP_PRIORITY = 1
RECORDER_PRIORITY = 10  # below the loop, above every process without SCHED_FIFO: a starved recorder loses blocks
VIEWER_PRIORITY = 1  # viewers: below the loop and the recorder, above every process without SCHED_FIFO

# A wait that ends this much later counts as a stall of this process. Shorter: a busy core looks like a stall. Longer: after a
# stall, this process gives up a peer that works.
_PAUSE_S = 0.25
NORMAL = "normal scheduling"  # start of the text of a START event of a process that did not get SCHED_FIFO
NOT_GUARANTEED = "real time is not guaranteed; grant CAP_SYS_NICE or an rtprio limit"


def core(place: int) -> int:
    """The core for thread number `place`, among the cores that this process may use.

    Choose the cores with `taskset`: with two cores for each rig, no rig delays another.
    """
    cores = sorted(os.sched_getaffinity(0))
    return cores[place % len(cores)]


def _threads() -> list[int]:
    return [int(entry.name) for entry in Path("/proc/self/task").iterdir()]


def pin(to_core: int | None) -> bool:
    """Pin every thread of this process to a core, which needs no privilege. Returns whether it was possible.

    Call it after the bus is open, to include the threads of the bus. It reduced the median round trip from 143 to 88 us.
    """
    if to_core is None:
        return False
    for thread in _threads():
        with contextlib.suppress(OSError):  # a thread may have ended since
            os.sched_setaffinity(thread, {to_core})
    return True


def claim(to_core: int | None, priority: int = LOOP_PRIORITY) -> str:
    """Pin this process, request SCHED_FIFO and lock its memory; returns a text of the granted settings.

    Call it after the bus is open, to include the threads of the bus. It also stops the garbage collector.

    Without SCHED_FIFO, 0.6 to 1.4 % of the answers take more than 1 ms on a computer whose cores are all busy.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    pinned = pin(to_core)
    fifo = True
    for thread in _threads():
        try:
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
        except ProcessLookupError:
            continue
        except PermissionError:
            fifo = False
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1)
    where = f"core {to_core}" if pinned else "any core"
    memory = "memory locked" if _lock_memory() else "memory not locked"
    if fifo:
        return f"SCHED_FIFO {priority}, {where}, {memory}"
    return f"{NORMAL}, {where}, {memory}: {NOT_GUARANTEED}"


@functools.cache  # cached from before this process is pinned, which would hide the other cores
def _cores_outside_the_loop() -> frozenset[int]:
    """The cores of this process without the cores of the loop's two processes; empty on a computer with two cores."""
    return frozenset(os.sched_getaffinity(0)) - {core(0), core(1)}


def raise_priority() -> None:
    """For viewers and operator commands: run off the loop's cores and, if permitted, before all processes without SCHED_FIFO.

    If all cores are busy it would otherwise wait for about 100 ms, and so would an operator's STOP. New threads inherit it.
    """
    cores = _cores_outside_the_loop()
    for thread in _threads():
        with contextlib.suppress(OSError):
            if cores:
                os.sched_setaffinity(thread, cores)
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(VIEWER_PRIORITY))


@contextlib.contextmanager
def raised_priority() -> Generator[None]:
    """The priority of `raise_priority` within a block; all threads of this process have their own one again afterwards."""
    before = {thread: (os.sched_getscheduler(thread), os.sched_getparam(thread)) for thread in _threads()}
    cores, (policy, param) = os.sched_getaffinity(0), before[threading.get_native_id()]
    raise_priority()
    try:
        yield
    finally:
        for thread in _threads():
            with contextlib.suppress(OSError):
                os.sched_setscheduler(thread, *before.get(thread, (policy, param)))
                os.sched_setaffinity(thread, cores)


def _lock_memory() -> bool:
    """Lock the present and future memory of this process; returns whether the system granted it.

    With a limit on locked memory it does nothing, as a later allocation would fail.
    """
    if os.geteuid() != 0 and resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] != resource.RLIM_INFINITY:
        return False
    return ctypes.CDLL(None).mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) == 0


def let_the_bus_send() -> None:
    """Let the sending thread run now: on the same core and priority, it would otherwise wait until the loop sleeps.

    Without it the median time of a command is 410 to 440 us instead of 320 to 350 (docs/method/rig.md).
    """
    os.sched_yield()


def may_claim(priority: int = LOOP_PRIORITY) -> bool:
    """Whether this process could get SCHED_FIFO. The attempt runs in a thread that ends, so no thread keeps the priority."""
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
    """Whether this process itself stalled: a wait from `since_s` until `due_s` ended much later (`time.monotonic`).

    The silence of a peer during a stall is not evidence against the peer.
    """
    return time.monotonic() > max(since_s, due_s) + _PAUSE_S


class Pacer:
    """Wakes once a period at absolute times, so that the duration of the work does not accumulate."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._start_ns = self._due_ns = time.perf_counter_ns()

    def wait(self, tick: int) -> Iterable[Wait]:
        """Wait until the end of period `tick` (from 0)."""
        self._due_ns = self._start_ns + (tick + 1) * self._period_ns
        left_ns = self._due_ns - time.perf_counter_ns()
        return time.wait(left_ns * 1e-9) if left_ns > 0 else ()

    @property
    def late_ns(self) -> int:
        """Time since the end of the period of the last wait."""
        return time.perf_counter_ns() - self._due_ns
