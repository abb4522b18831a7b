"""The trials on an evidence: every effect of the plant in each of its forms, with the coordinates and starts of its refit.

Scales derive from the rig, so that a step of 1 in a coordinate is a noticeable effect on any rig.
"""

from collections.abc import Sequence

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.gap.prepare import Prepared
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import CATALOGUE
from diagnosis.hypotheses.hypothesis import LEVELS
from diagnosis.hypotheses.scales import sizes
from diagnosis.hypotheses.starts import Trial, TrialRequest
from plant.effects.library import EFFECTS


def trials(problem: Problem) -> list[Trial]:
    """Every form of every effect that this rig can have and these runs could show."""
    rig, runs = problem.rig, problem.runs
    frequencies = np.concatenate([run.commands.frequency_Hz for run in runs])
    highest_Hz = float(frequencies.max())
    of_rig = sizes(rig, runs, highest_Hz)
    result: list[Trial] = []
    for name, effect in EFFECTS.items():
        if not _shows(name, rig, highest_Hz):
            continue
        for form in effect.forms:
            tried = CATALOGUE[name].forms.get(form)
            if tried is not None:
                result += tried.starts(TrialRequest(name, form, tried.scale(of_rig), problem, highest_Hz))
    return result


def cannot_show(rig: RigTable, runs: Sequence[Prepared], assumed: Sequence[str]) -> tuple[str, ...]:
    """Effects that this kind of drive cannot have, that need a missing vibration, or that change an assumed rig number."""
    highest_Hz = max(float(run.commands.frequency_Hz.max()) for run in runs)
    return tuple(name for name in EFFECTS if not _shows(name, rig, highest_Hz) or LEVELS.get(name) in assumed)


def _shows(name: str, rig: RigTable, highest_Hz: float) -> bool:
    effect = EFFECTS[name]
    return rig.drive in effect.drives and (effect.acts_on != "piezo" or highest_Hz > 0.0)
