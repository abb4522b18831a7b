"""Waves over time whose phase differs from run to run: a load that turns does not wait for the log to begin.

Such a form has a phase for every fitted run, `phase_rad` for the first and `phase_rad of FILE` for the others. What the phase is
in a run that was kept aside nobody knows: there a draw has any, and a prediction has none of the wave, which is its mean.
"""

import math
from collections.abc import Collection
from zlib import crc32

import numpy as np

from diagnosis.by_run import Table, as_in_rig_file, is_of_run, of_run

PHASE = "phase_rad"
OTHER_PHASE = "other_phase_rad"  # of a second wave


def phase_of(file: str) -> str:
    """The name of the phase in one of the runs after the first."""
    return of_run(PHASE, file)


def is_phase(name: str) -> bool:
    """Whether a parameter is a phase, in whichever run."""
    return name in {PHASE, OTHER_PHASE} or is_of_run(name, PHASE)


def has_own_phases(table: Collection[str]) -> bool:
    """Whether an effect begins in another phase in every run."""
    return any(is_of_run(name, PHASE) for name in table)


def in_run(table: Table, file: str, kept_aside: bool, seed: int | None) -> dict[str, float | str] | None:
    """An effect as it is in one run, with a drawn phase where there is a seed and no phase is known; None: its mean."""
    plain = as_in_rig_file(table)
    if not has_own_phases(table):
        return plain
    if not kept_aside:
        return plain | {PHASE: table.get(phase_of(file), plain[PHASE])}
    if seed is None:
        return None
    return plain | {PHASE: float(np.random.default_rng([seed, crc32(file.encode())]).uniform(-math.pi, math.pi))}
