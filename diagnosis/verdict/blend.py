"""The flexible residual: every effect of the library at once, in its first form, blended linearly with a ridge.

The blend names no effect. It shows how far so free a model closes the gap on held-out runs; the report compares the named
effect with it.
"""

import numpy as np

from bridge.arrays import Floats
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.screening import Directions
from diagnosis.hypotheses.starts import Trial
from diagnosis.processes import spread
from diagnosis.verdict.held_out import HeldOut

# Step for the derivatives of the nuisances on the held-out runs, in tolerances. Too small: the grid of the features shows.
# Too large: curvature does.
_STEP = 0.5


def flexible_differences(fitter: Fitter, baseline: Fit, trials: list[Trial], held_out: HeldOut, jobs: int) -> Floats:
    """Differences on the held-out runs, in floors [compared], under the blend that is fitted to the other runs.

    Args:
        fitter: of the fitted runs.
        baseline: the rig without effects, refitted within its tolerances.
        trials: the library's trials; the first trial of every effect takes part.
        held_out: the held-out runs.
        jobs: processes.

    """
    trials = list({trial.hypothesis.effects: trial for trial in reversed(trials)}.values())
    directions = Directions(baseline, fitter.most)
    base_features = fitter.predicted(baseline.deviations, {})
    _, slope = fitter.whitened(base_features)
    added = [(baseline.deviations, trial.hypothesis.tables(trial.w)) for trial in trials]
    columns = [
        fitter.column(base_features, shown, slope) for shown in spread(jobs, Fitter.predicted_many, fitter, added)
    ]
    free = np.stack([directions.freed(column) for column in columns], axis=1)
    shares = np.linalg.solve(free.T @ free + np.eye(len(trials)), free.T @ directions.left)
    blended = np.stack(columns, axis=1) @ shares
    moved = directions.moved(blended) - baseline.deviations
    points = [fitter.nuisances.point(baseline.deviations, {})]
    points += [fitter.nuisances.point(*at) for at in added]
    points += [fitter.nuisances.point(ahead, {}) for ahead in baseline.deviations + _STEP * np.eye(len(moved))]
    unmoved, *others = held_out.problem.predicted_many(points)
    total = unmoved.copy()
    for share, moved_features in zip([*shares, *(moved / _STEP)], others, strict=True):
        total += share * _finite(moved_features - unmoved)
    return held_out.differences_of(total)


def _finite(values: Floats) -> Floats:
    return np.where(np.isfinite(values), values, 0.0)
