"""The rig without effects: refitted inside its tolerances, on a floor whose surface is as rough as the evidence shows."""

from typing import NamedTuple

import numpy as np

from bench.judge.linear.surface import surface_of
from bridge.faults import Fault
from diagnosis.fits.batch import together
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.retuning import ROUGHNESS
from diagnosis.gap.measure import floor_of, replicates
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.hypothesis import NOTHING
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import Roughness

# Replicates for the roughness, and for the floor. Fewer: the covariance of the features is chance. More: 0.03 s of CPU each.
_FIRST, _REPLICATES = 12, 32


class Rig(NamedTuple):
    """The refitted rig, and the fitter with its floor."""

    fitter: Fitter
    fit: Fit
    surface: Roughness


def fitted_rig(problem: Problem) -> Rig:
    """Refit the rig of a problem. Raises Fault BAD_EVIDENCE when nothing can be compared."""
    nuisances = Nuisances(problem.rig)
    described = np.zeros(len(nuisances))
    point = nuisances.point(described, {})
    drawn = replicates(problem, point, ROUGHNESS, _FIRST, 1)
    floor = floor_of(problem, point, drawn)
    if not floor.compared.any():
        line = "the rig as described shows none of the measured features: check the friction and the stiffness of [rig]"
        raise Fault("BAD_EVIDENCE", line)
    surface = surface_of(problem, drawn)
    fit = Fitter(problem, floor, nuisances).refit(NOTHING, described, np.zeros(0))
    point = nuisances.point(fit.deviations, {})
    floor = floor_of(problem, point, replicates(problem, point, surface, _REPLICATES, 2), floor)
    fitter = Fitter(problem, floor, nuisances)
    (fit,) = together(fitter.predicted_many, [fitter.retuning(fit.deviations)])
    return Rig(fitter, fit, surface)
