"""The kept runs: the remainder of each fit in runs that no fit has seen."""

from collections.abc import Sequence

import numpy as np

from bench.judge.linear.rig import Rig
from diagnosis.fits.fit import Fit
from diagnosis.gap.measure import floor_of, replicates, whitened
from diagnosis.gap.prepare import Prepared
from diagnosis.gap.problem import Problem

_REPLICATES = 16  # for the floor. Fewer: it is uncertain. More: 0.01 s of CPU each.


def left_of_kept(rig: Rig, runs: list[Prepared], floor_at: Fit, fits: Sequence[Fit]) -> tuple[list[float], int]:
    """chi2 of the kept runs under each fit, and the number of compared features: 0 without kept runs."""
    kept = [run for run in runs if run.holdout]
    if not kept:
        return [0.0] * len(fits), 0
    problem = Problem(rig.fitter.problem.rig, kept)
    points = [rig.fitter.nuisances.point(fit.deviations, fit.effects) for fit in (floor_at, *fits)]
    floor = floor_of(problem, points[0], replicates(problem, points[0], rig.surface, _REPLICATES, 3))
    if not floor.compared.any():
        return [0.0] * len(fits), 0
    lefts = [whitened(floor, problem, predicted)[0] for predicted in problem.predicted_many(points[1:])]
    return [float(left @ left) for left in lefts], int(np.count_nonzero(floor.compared))
