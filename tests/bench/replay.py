"""How fast a log is replayed, reading included."""

import tempfile
import time
from pathlib import Path
from statistics import median

from bridge.log.logfile import read_run
from cockpit.run.in_process import run_onboard
from cockpit.run.replay import changes_of
from cockpit.run.scenario import load_scenario
from controller.replay import replay

SECONDS = 60.0
REPETITIONS, QUICK_REPETITIONS = 5, 2


def bench(quick: bool = False) -> bool:
    """Print the figure; whether the bar is kept."""
    repetitions = QUICK_REPETITIONS if quick else REPETITIONS
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        run_onboard(load_scenario("paper-c45-c45", [f"duration_s={SECONDS}"]), path, {})
        reading_s: list[float] = []
        total_s: list[float] = []
        for _ in range(repetitions + 1):  # the first one loads the kernels
            started_s = time.perf_counter()
            run = read_run(path)
            reading_s.append(time.perf_counter() - started_s)
            result = replay(run, changes_of(run, []))
            total_s.append(time.perf_counter() - started_s)
        speed = SECONDS / median(total_s[1:])
        kept = result.identical and speed >= 200.0
        print(f"\nreplay of a {SECONDS:g} s log, median of {repetitions}: {speed:.0f} times real time (bar 200)")
        share = 100 * median(reading_s[1:]) / median(total_s[1:])
        print(f"  of which reading {share:.0f} %; identical: {result.identical}; {'PASS' if kept else 'FAIL'}")
        return kept
