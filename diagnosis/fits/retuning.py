"""The rig without effects: its floor, and its numbers refitted inside their tolerances. All evidence is measured against it."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from diagnosis.deadline import forecast
from diagnosis.evidence.folder import Evidence
from diagnosis.features.grid import BLOCK_S
from diagnosis.fits.batch import together
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.screening import Directions
from diagnosis.gap.measure import between, compress, differences, floor_of, gap, replicates
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.hypothesis import NOTHING
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import Roughness
from diagnosis.processes import spread

ROUGHNESS = Roughness(0.003, 1.5e-4, 0)  # before the breakaways of the evidence say more
_MARGIN = 1.2  # on the roughness: too small a floor makes causes out of scatter
# What surfaces lie within, a factor of two of 0.3 %, says as much as this many slips; breakaway and re-stick count twice. Pooled
# over the segments, the estimate is off by 28 % (rms over 26 rigs).
_SLIPS_OF_OTHERS = 8.0
# Rougher than 0.5 % is no surface but an effect: friction that varies along the track makes the breakaways scatter too, and would
# be in the floor. Of 28 rigs without a gap the scatter said 0.04 to 0.53 %, of 13 with friction or load that vary 0.47 to 2.7 %.
_SMOOTHEST, _ROUGHEST = 0.002, 0.005
FIRST_REPLICATES, REPLICATES = 12, 32  # for the roughness, and for the floor
_NEW_REPLICATES = 24  # that the floor does not know
# of chi2 a compared feature: what the least floors promise is not held against a rig that is better
_LEAST_EXPECTED = 0.2


class Retuned(NamedTuple):
    """The refitted rig, the fitter with its floor, and the surface that the floor is made with."""

    fitter: Fitter
    fit: Fit
    roughness: Roughness
    expected_chi2: float  # that a perfect model would leave


def retuned_rig(evidence: Evidence, problem: Problem, progress: Callable[[str, float], None], jobs: int = 1) -> Retuned:
    """Refit the rig of an evidence to its fitted runs. Raises Fault BAD_EVIDENCE when nothing can be compared."""
    nuisances = Nuisances(evidence.rig, problem.travel_m)
    described = np.zeros(len(nuisances))
    point = nuisances.point(described, {})
    first = replicates(problem, point, ROUGHNESS, FIRST_REPLICATES, 1)
    fitted_s = sum(len(run.commands.drive) for run in problem.runs) * BLOCK_S
    progress(f"the simulated fits take about {forecast(fitted_s, jobs, problem.pace)} at the present pace", 0.05)
    roughness = roughness_of(problem, first)
    floor = floor_of(problem, point, first)
    if not floor.compared.any():
        raise Fault(
            "BAD_EVIDENCE",
            f"{evidence.folder}: the rig as described shows none of the measured features: check the friction and the stiffness "
            "of [rig] against the runs, and that the drive moves in them",
        )
    apart = gap(floor, differences(floor, problem, problem.predicted(point)))
    progress(f"as described, the rig and the model are {apart:.1f} noise floors apart", 0.1)
    fit = Fitter(problem, floor, nuisances).refit(NOTHING, described, np.zeros(0))
    point = nuisances.point(fit.deviations, {})
    floor = floor_of(problem, point, replicates(problem, point, roughness, REPLICATES, 2, jobs), floor)
    # where slips come and go chi2 is jagged: from half the way 166 was found instead of 410
    starts = [fit.deviations, 0.5 * fit.deviations]
    again = spread(jobs, _retuned, Fitter(problem, floor, nuisances), starts)
    fitter, fit = min(again, key=lambda pair: pair[1].chi2)
    expected = expected_chi2(fitter, fit, roughness, jobs)
    left = differences(floor, problem, fitter.predicted(fit.deviations, {}))
    progress(f"refitted inside its tolerances, {gap(floor, left):.1f} noise floors are left", 0.25)
    return Retuned(fitter, fit, roughness, expected)


def _retuned(fitter: Fitter, starts: list[Floats]) -> list[tuple[Fitter, Fit]]:
    """The rig refitted from every start, and a fitter with the derivatives there."""
    fitters = [fitter.for_problem(fitter.problem) for _ in starts]
    works = [fitter.retuning(deviations) for fitter, deviations in zip(fitters, starts, strict=True)]
    return list(zip(fitters, together(fitter.predicted_many, works), strict=True))


def expected_chi2(fitter: Fitter, fit: Fit, roughness: Roughness, jobs: int) -> float:
    """chi2 of a perfect model: of new replicates of the fitted one, each refitted along its derivatives.

    Evidence without a gap has 0.6 to 1.7 times that. What it is depends on the evidence: 102 to 185 of 600 features.
    """
    point = fitter.nuisances.point(fit.deviations, fit.effects)
    surface = roughness._replace(ratio=roughness.ratio / _MARGIN)
    drawn = replicates(fitter.problem, point, surface, _NEW_REPLICATES, 3, jobs)
    z = between(fitter.floor, fitter.predicted(fit.deviations, fit.effects), drawn)
    z = np.where(np.isfinite(z), z, 0.0)  # what a rig does not show is not compared
    directions = Directions(fit, fitter.most)
    left = [directions.freed(fitter.floor.whitening @ compress(row)) for row in z]
    # the median, as a few replicates of a rig at the edge of slipping end elsewhere
    return max(float(np.median([row @ row for row in left])), _LEAST_EXPECTED * len(fit.residual))


def roughness_of(problem: Problem, drawn: Floats) -> Roughness:
    """Roughness of the surface from the scatter of the breakaways and re-sticks, drawn towards what bench surfaces have.

    `drawn` [replicates, features] are features of the model on surfaces of `ROUGHNESS`.
    """
    times = times_rougher(problem, drawn)
    if times is None:
        return ROUGHNESS
    return ROUGHNESS._replace(ratio=min(max(_MARGIN * ROUGHNESS.ratio * times, _SMOOTHEST), _ROUGHEST))


def times_rougher(problem: Problem, drawn: Floats) -> float | None:
    """Scatter of the slips over the scatter on surfaces of `ROUGHNESS`, drawn towards 1; None where no scatter is known."""
    segments = {run.file: run.commands.segments for run in problem.runs}
    slips = squares = 0.0
    for i, (file, label) in enumerate(problem.labels):
        if label.name != "scatter" or not np.isfinite(problem.measured[i]):
            continue
        known = drawn[np.isfinite(drawn[:, i]), i]
        if len(known) and known.mean() > 0.0:
            count = segments[file][label.segment].slips
            slips += count
            squares += count * problem.measured[i] / float(known.mean())
    if squares == 0.0:
        return None
    return math.sqrt(squares / slips) ** (slips / (slips + _SLIPS_OF_OTHERS))
