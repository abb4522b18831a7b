"""A timer on one core that detects stalls of the core. `bridge/wire/pauses.py` runs it as a separate process.

In a thread of the recorder, a wait for Python's lock (GIL) would look like a stall. The script uses the standard library alone,
so that a timer takes 10 MB of memory and does not load numba.
"""

import gc
import os
import signal
import sys
import time

# Period of the timer. Longer: a stall must be longer to be detected for certain. Shorter: the timer loads its core more, which
# is 1.6 to 1.9 % now and 1.9 to 2.5 % with 1 ms (docs/method/rig.md).
PERIOD_NS = 1_500_000
# Lateness from which a timer reports a stall. Shorter: ordinary wake-ups count, one in 1000 of which is 0.16 to 0.26 ms late.
# Longer: stalls are missed that make a command late, which takes 0.25 ms of its 1 ms. Each stall from PERIOD_NS + LEAST_NS on
# is detected.
LEAST_NS = 300_000
# Number of wake-ups between two checks of the parent and of the waiting time; a check takes as long as a wake-up.
_LOOKS = 16


def stall_end_ns(due_ns: int, woke_ns: int, waited_ns: int) -> int:
    """The end of the stall of a core whose timer was due at `due_ns`; 0 without a stall, or if it was too short.

    Args:
        due_ns: due time of the timer.
        woke_ns: time at which its thread ran.
        waited_ns: time for which the thread was ready while another one ran: the core did not stall then.

    """
    until_ns = woke_ns - waited_ns
    return until_ns if until_ns - due_ns > LEAST_NS else 0


def reports_waiting() -> bool:
    """Whether this system reports how long a thread was ready to run but waited."""
    try:
        with open("/proc/self/schedstat", "rb") as stat:
            return len(stat.read().split()) == 3
    except OSError:
        return False


def watch(core: int, priority: int, parent: int, phase_ns: int) -> None:
    """Write a line `core from until` [ns of time.perf_counter_ns] for each stall of the core, until the parent ends."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # after Ctrl-C the recorder closes its log and then ends this process
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
            until_ns = stall_end_ns(due_ns, woke_ns, waited_ns - before_ns)
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
