"""How visible a case's effect is: its signature in the fitted runs, freed of what the nuisances can imitate, in detection limits.

The signature is the difference between two noise-free predictions, with and without the effect, in floors and whitened. Its
length is what a matched filter would see; a detection limit is the length at which the log evidence of a single effect with
one parameter reaches the cost of an alarm.
"""

import numpy as np

from diagnosis.evidence import Evidence
from diagnosis.gap import KNEE, floor_of, replicates
from diagnosis.nuisance import Nuisances
from diagnosis.problem import Problem, prepare
from diagnosis.refit import Fitter
from diagnosis.search import Directions
from diagnosis.twin import Effects, Roughness
from diagnosis.verdict import COST_OF_EFFECT, JITTER
from plant.effects import checked

_OCCAM = 5.0  # of one parameter, as it comes out of most refits
LIMIT = float(np.sqrt(2.0 * JITTER * (COST_OF_EFFECT + _OCCAM)))


def of_evidence(evidence: Evidence, effects: Effects) -> float:
    """Detection limits that the effects of an evidence are worth, at the described rig."""
    runs = [run for run in prepare(evidence) if not run.holdout]
    problem, nuisances = Problem(evidence.rig, runs), Nuisances(evidence.rig)
    described = np.zeros(len(nuisances))
    point = nuisances.point(described, {})
    floor = floor_of(problem, point, replicates(problem, point, Roughness(0.003, 1.5e-4, 0), 12, 1))
    fitter = Fitter(problem, floor, nuisances)
    plain = fitter.predicted(described, {})
    there = fitter.predicted(described, {name: checked(name, table) for name, table in effects.items()})
    # about the prediction without the effect, not about what was measured
    problem.measured = plain + floor.bias
    fit = fitter.described(described)
    _, slope = fitter.whitened(plain, KNEE)
    return float(np.linalg.norm(Directions(fit).freed(fitter.column(plain, there, slope)))) / LIMIT
