"""Speed of reading: a log against the official reader, a table of text against NumPy, and `look` at that table."""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from mcap.reader import make_reader

from bridge.log.logfile import read_run
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from diagnosis.evidence.import_table import import_file
from diagnosis.look.look import RecordFacts, look
from tests.unit.diagnosis.test_slips import sawtooth

SECONDS = 20.0
RATE_HZ = 20_000
REPETITIONS, QUICK_REPETITIONS = 5, 2
MAP = """
[rig]
drive = "spring"
mass_kg = 1.5
drive_stiffness_N_per_m = 11700.0
coulomb_force_N = 14.49
static_force_N = 17.38
stribeck_velocity_mps = 0.0005
[run]
drive_velocity_mps = 0.0005
[channels]
t_s = { column = "t_s" }
drive_force_N = { column = "drive_force_N" }
"""


def bench(quick: bool = False) -> bool:
    """Print the figures; whether the bars are kept."""
    turns = QUICK_REPETITIONS if quick else REPETITIONS
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log, table, channel_map = folder / "run.mcap", folder / "measured.csv", folder / "map.toml"
        run_onboard(load_scenario("paper-c45-c45", [f"duration_s={SECONDS}"]), log, {})
        t_s, force_N = sawtooth(RATE_HZ, 17.4, 11.6, duration_s=SECONDS)
        np.savetxt(table, np.column_stack([t_s, force_N]), "%.9g", ",", header="t_s,drive_force_N", comments="")
        channel_map.write_text(MAP)
        made = iter(range(100))
        reading = _ratio(turns, lambda: read_run(log), lambda: _messages(log))
        importing = _ratio(
            turns,
            lambda: import_file(table, channel_map, folder / f"made-{next(made)}.mcap"),
            lambda: np.loadtxt(table, delimiter=",", skiprows=1),
        )
        looking = _ratio(
            turns,
            lambda: look(t_s, force_N, None, RecordFacts(5e-4)),
            lambda: np.loadtxt(table, delimiter=",", skiprows=1),
        )
    print(f"\nfiles of {SECONDS:g} s at {RATE_HZ / 1e3:g} kHz, medians of {turns} turns")
    kept = True
    for what, ratio, bar in (
        ("a log is read and checked, beside the official reader that decodes nothing", reading, 1.0),
        ("a table of text becomes a log, beside numpy.loadtxt of it", importing, 3.0),
        ("the figures of `look` are found, beside numpy.loadtxt of the table", looking, 5.0),
    ):
        print(f"  {what}: {ratio:.2f} of its time (bar {bar:g}); {'PASS' if ratio <= bar else 'FAIL'}")
        kept = kept and ratio <= bar
    return kept


def _messages(path: Path) -> int:
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file).iter_messages())


def _ratio(turns: int, ours: Callable[[], Any], theirs: Callable[[], Any]) -> float:
    ratios: list[float] = []
    for _ in range(turns + 1):  # the first one loads kernels
        began_s = time.process_time()
        ours()
        between_s = time.process_time()
        theirs()
        ratios.append((between_s - began_s) / (time.process_time() - between_s))
    return median(ratios[1:])
