"""How fast slips are counted, on a record of stick and slip as the rig's."""

import time
from statistics import median

from diagnosis.slips import find_cycles
from tests.unit.diagnosis.test_slips import sawtooth

SECONDS = 20.0
RATE_HZ = 20000
REPETITIONS = 15


def bench(quick: bool = False) -> bool:
    """Print the figure; whether the bar is kept."""
    t_s, force_N = sawtooth(RATE_HZ, 17.4, 11.6, duration_s=SECONDS)
    taken_s: list[float] = []
    for _ in range(REPETITIONS + 1):  # the first one loads the kernel
        started_s = time.perf_counter()
        find_cycles(t_s, force_N)
        taken_s.append(time.perf_counter() - started_s)
    speed = SECONDS / median(taken_s[1:])
    kept = speed >= 400.0
    print(f"\nslips counted in {SECONDS:g} s at {RATE_HZ / 1e3:g} kHz, median of {REPETITIONS}:", end=" ")
    print(f"{speed:.0f} times real time (bar 400); {'PASS' if kept else 'FAIL'}")
    return kept
