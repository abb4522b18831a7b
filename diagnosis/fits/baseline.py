"""The rig without effects: refitted inside its tolerances, on a floor whose surface is as rough as the evidence shows."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bridge.faults import Fault
from diagnosis.deadline import forecast
from diagnosis.features.grid import BLOCK_S
from diagnosis.fits.batch import together
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.surface import ROUGHNESS, surface_of
from diagnosis.gap.measure import differences, floor_of, gap, replicates
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.hypothesis import NOTHING
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import Roughness

Progress = Callable[[str, float], None]
# Replicates for the roughness, and for the floor. Fewer: the covariance of the features is chance. More: 0.03 s of CPU each.
_FIRST, _REPLICATES = 12, 32


class Baseline(NamedTuple):
    """The refitted rig, the fitter with its floor, and the surface that the floor is made with."""

    fitter: Fitter
    fit: Fit
    surface: Roughness


def baseline_of(problem: Problem, progress: Progress) -> Baseline:
    """Refit the rig of a problem. Raises Fault BAD_EVIDENCE when nothing can be compared."""
    nuisances = Nuisances(problem.rig, problem.travel_m)
    described = np.zeros(len(nuisances))
    point = nuisances.point(described, {})
    drawn = replicates(problem, point, ROUGHNESS, _FIRST, 1)
    fitted_s = sum(len(run.commands.drive) for run in problem.runs) * BLOCK_S
    progress(
        f"the simulated fits take about {forecast(fitted_s, problem.jobs, problem.pace)} at the present pace", 0.05
    )
    floor = floor_of(problem, point, drawn)
    if not floor.compared.any():
        line = (
            "the rig as described shows none of the measured features: check the friction and the stiffness of [rig] against "
            "the runs, and that the drive moves in them"
        )
        raise Fault("BAD_EVIDENCE", line)
    apart = gap(floor, differences(floor, problem, problem.predicted(point)))
    progress(f"as described, the rig and the model are {apart:.1f} noise floors apart", 0.1)
    surface = surface_of(problem, drawn)
    fit = Fitter(problem, floor, nuisances).refit(NOTHING, described, np.zeros(0))
    point = nuisances.point(fit.deviations, {})
    floor = floor_of(problem, point, replicates(problem, point, surface, _REPLICATES, 2), floor)
    fitter = Fitter(problem, floor, nuisances)
    (fit,) = together(fitter.predicted_many, [fitter.retuning(fit.deviations)])
    left = gap(floor, differences(floor, problem, fitter.predicted(fit.deviations, {})))
    progress(f"refitted inside its tolerances, {left:.1f} noise floors are left", 0.3)
    return Baseline(fitter, fit, surface)
