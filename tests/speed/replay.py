"""How fast a log is replayed, reading included."""

import tempfile
import time
from pathlib import Path
from statistics import median

from bridge.log.log_reader import LogReader
from bridge.log.logfile import iter_pieces
from cockpit.run.in_process import run_onboard
from cockpit.run.replay import replay_log
from cockpit.run.scenario import load_scenario

SECONDS = 60.0
BAR = 350.0  # times real time
REPETITIONS, QUICK_REPETITIONS = 5, 2


def bench(quick: bool = False) -> bool:
    """Print the figure; whether the bar is kept."""
    repetitions = QUICK_REPETITIONS if quick else REPETITIONS
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        run_onboard(load_scenario("paper-c45-c45", [f"duration_s={SECONDS}"]), path, {})
        reading_s: list[float] = []
        total_s: list[float] = []
        identical = True
        for _ in range(repetitions + 1):  # the first one loads the kernels
            started_s = time.perf_counter()
            for _piece in iter_pieces(LogReader(path)):
                pass
            reading_s.append(time.perf_counter() - started_s)
            started_s = time.perf_counter()
            identical &= replay_log(path, 0.0, []).identical
            total_s.append(time.perf_counter() - started_s)
        speed = SECONDS / median(total_s[1:])
        kept = identical and speed >= BAR
        print(f"\nreplay of a {SECONDS:g} s log, median of {repetitions}: {speed:.0f} times real time (bar {BAR:g})")
        share = 100 * median(reading_s[1:]) / median(total_s[1:])
        print(f"  reading alone takes {share:.0f} % of that time; identical: {identical}; {'PASS' if kept else 'FAIL'}")
        return kept
