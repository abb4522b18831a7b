"""A timer on one core that tells when the core stood still. A process of its own, which `bridge/wire/pauses.py` starts.

A thread of the recorder would not do: it waits for Python's lock, and a wait for that looks like a pause. The file is run by
itself with the standard library alone, so that a timer costs 10 MB and no start of numba.
"""

import gc
import os
import signal
import sys
import time

# How often a core is asked. Longer: a pause must last longer to be seen for certain. Shorter: the timer takes more of its core,
# which is 1.6 to 1.9 % now and 1.9 to 2.5 % with 1 ms (docs/method/bridge.md).
PERIOD_NS = 1_500_000
# How late a timer must be. Shorter: ordinary waking up is told, one in 1000 of which takes 0.16 to 0.26 ms. Longer: pauses are
# missed that make a command late, as it takes 0.25 ms itself and has 1 ms. From PERIOD_NS + LEAST_NS on each pause is seen.
LEAST_NS = 300_000
# Wakings between two looks at the parent and at the time spent waiting, which cost as much as a waking does
_LOOKS = 16


def stood_still_until_ns(due_ns: int, woke_ns: int, waited_ns: int) -> int:
    """Until when a core stood still whose timer was due at `due_ns`; 0 where it did not, or too briefly to tell.

    Args:
        due_ns: when the timer was due.
        woke_ns: when its thread ran.
        waited_ns: for how long that thread was ready to run, and something else ran: the core did not stand still then.

    """
    until_ns = woke_ns - waited_ns
    return until_ns if until_ns - due_ns > LEAST_NS else 0


def waiting_is_told() -> bool:
    """Whether this system tells for how long a thread was ready to run and did not."""
    try:
        with open("/proc/self/schedstat", "rb") as stat:
            return len(stat.read().split()) == 3
    except OSError:
        return False


def watch(core: int, priority: int, parent: int, phase_ns: int) -> None:
    """Write a line `core from until` [ns of time.perf_counter_ns] for each time the core stood still, until the parent ends."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the recorder closes its log after Ctrl-C, and ends this process then
    os.sched_setaffinity(0, {core})
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    gc.disable()
    stat = os.open("/proc/self/schedstat", os.O_RDONLY)
    now_ns, sleep = time.perf_counter_ns, time.sleep

    def waited_so_far_ns() -> int:
        return int(os.pread(stat, 100, 0).split()[1])

    def next_due_ns() -> int:
        return ((now_ns() - phase_ns) // PERIOD_NS + 1) * PERIOD_NS + phase_ns

    waited_ns, looks, due_ns = waited_so_far_ns(), 0, next_due_ns()
    while looks or os.getppid() == parent:
        left_ns = due_ns - now_ns()
        if left_ns > 0:
            sleep(left_ns * 1e-9)
        woke_ns = now_ns()
        if woke_ns - due_ns > LEAST_NS:
            before_ns, waited_ns = waited_ns, waited_so_far_ns()
            until_ns = stood_still_until_ns(due_ns, woke_ns, waited_ns - before_ns)
            if until_ns:
                os.write(1, b"%d %d %d\n" % (core, due_ns, until_ns))
            due_ns = next_due_ns()
            continue
        due_ns += PERIOD_NS
        looks = (looks + 1) % _LOOKS
        if looks == 0:
            waited_ns = waited_so_far_ns()


if __name__ == "__main__":
    watch(*(int(word) for word in sys.argv[1:5]))
