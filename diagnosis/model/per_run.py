"""Parameters of an effect that differ from run to run: `NAME of FILE`, for the fitted runs. No rig file has them.

An example is the phase of a wave over time: a rotating load has any phase when a log begins. Such a form has a phase for every
fitted run, `phase_rad` for the first and `phase_rad of FILE` for the others. The phase in a held-out run is unknown: a draw has a
random phase there, and a prediction leaves the wave out, as its mean over all phases is 0.
"""

import math
from collections.abc import Collection, Mapping
from zlib import crc32

import numpy as np

Table = Mapping[str, float | str]
_OF = " of "


def of_run(name: str, file: str) -> str:
    """The name of the parameter `name` in the run `file`."""
    return name + _OF + file


def is_of_run(name: str, parameter: str = "") -> bool:
    """Whether a name belongs to a single run; with `parameter`, whether it is this parameter in a single run."""
    return name.startswith(parameter + _OF) if parameter else _OF in name


def name_and_run(name: str) -> tuple[str, str]:
    """The parameter, and the file of its run; empty for a parameter of all runs."""
    parameter, _, file = name.partition(_OF)
    return parameter, file


def as_in_rig_file(table: Table) -> dict[str, float | str]:
    """The effect without the parameters of single runs."""
    return {name: value for name, value in table.items() if not is_of_run(name)}


PHASE = "phase_rad"
OTHER_PHASE = "other_phase_rad"  # phase of a second wave


def is_phase(name: str) -> bool:
    """Whether a parameter is a phase, for all runs or for a single run."""
    return name in {PHASE, OTHER_PHASE} or is_of_run(name, PHASE)


def has_own_phases(table: Collection[str]) -> bool:
    """Whether an effect has a phase for each run."""
    return any(is_of_run(name, PHASE) for name in table)


def in_run(table: Table, file: str, held_out: bool, seed: int | None) -> dict[str, float | str] | None:
    """An effect with the parameters that it has in the run `file`; None where only its mean, 0, is known.

    Args:
        table: the effect.
        file: file of the run.
        held_out: whether the run is held out, so that its phase is unknown.
        seed: seed of the draw of an unknown phase; None in a prediction.

    """
    plain = as_in_rig_file(table)
    if not has_own_phases(table):
        return plain
    if not held_out:
        return plain | {PHASE: table.get(of_run(PHASE, file), plain[PHASE])}
    if seed is None:
        return None
    return plain | {PHASE: float(np.random.default_rng([seed, crc32(file.encode())]).uniform(-math.pi, math.pi))}
