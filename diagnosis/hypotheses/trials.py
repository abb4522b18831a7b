"""What is tried on an evidence: every effect of the plant in each of its formulas, with the coordinates and starts of its refit.

Scales come from the rig, so that a step of 1 in a coordinate is an effect that one would notice, on any rig.
"""

import numpy as np

from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import CATALOGUE
from diagnosis.hypotheses.scales import sizes
from diagnosis.hypotheses.starts import Asked, Trial
from plant.effects.library import EFFECTS


def trials(problem: Problem) -> list[Trial]:
    """Every form of every effect that this rig can have and these runs could show."""
    rig, runs = problem.rig, problem.runs
    frequencies = np.concatenate([run.commands.frequency_Hz for run in runs])
    highest_Hz = float(frequencies.max())
    of_rig = sizes(rig, runs, highest_Hz)
    found: list[Trial] = []
    for name, effect in EFFECTS.items():
        if rig.drive not in effect.drives or (effect.acts_on == "piezo" and highest_Hz == 0.0):
            continue
        for form in effect.forms:
            tried = CATALOGUE[name].forms.get(form)
            if tried is not None:
                found += tried.starts(Asked(name, form, tried.scale(of_rig), problem, highest_Hz))
    return found
