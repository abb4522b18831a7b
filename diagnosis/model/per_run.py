"""Parameters of an effect that differ from run to run: `NAME of FILE`, for the fitted runs. No rig file has them.

Waves over time whose phase differs from run to run: a load that turns does not wait for the log to begin.

Such a form has a phase for every fitted run, `phase_rad` for the first and `phase_rad of FILE` for the others. What the phase is
in a run that was kept aside nobody knows: there a draw has any, and a prediction has none of the wave, which is its mean.
"""

import math
from collections.abc import Collection, Mapping
from zlib import crc32

import numpy as np

Table = Mapping[str, float | str]
_OF = " of "


def of_run(name: str, file: str) -> str:
    """The name of a parameter in one run."""
    return name + _OF + file


def is_of_run(name: str, parameter: str = "") -> bool:
    """Whether a name is of one run, of any parameter or of this one."""
    return name.startswith(parameter + _OF) if parameter else _OF in name


def name_and_run(name: str) -> tuple[str, str]:
    """The parameter, and the file of its run or nothing."""
    parameter, _, file = name.partition(_OF)
    return parameter, file


def as_in_rig_file(table: Table) -> dict[str, float | str]:
    """The effect without what is of single runs."""
    return {name: value for name, value in table.items() if not is_of_run(name)}


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
