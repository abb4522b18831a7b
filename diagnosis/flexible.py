"""The flexible residual: every effect of the library at once, in its first form, blended linearly with a ridge.

It names nothing; it says how far the gap could be closed by something as free as this. What a named effect closes is measured
against it.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.heldout import HeldOut
from diagnosis.library import Trial
from diagnosis.refit import Fit, Fitter
from diagnosis.search import Directions
from diagnosis.workers import each

Floats = npt.NDArray[np.floating[Any]]
_STEP = 0.5  # of a nuisance's tolerance


def flexible_differences(fitter: Fitter, base: Fit, trials: list[Trial], held_out: HeldOut, jobs: int) -> Floats:
    """Differences on the held-out runs in floors [compared] under the blend that was fitted to the others."""
    trials = list({trial.form.effects: trial for trial in reversed(trials)}.values())
    directions = Directions(base)
    here = fitter.predicted(base.deviations, {})
    _, slope = fitter.whitened(here)
    shown = each(jobs, _shown, fitter, [(base.deviations, trials[i::jobs]) for i in range(jobs)])
    columns = [fitter.column(here, shown[i % jobs][i // jobs], slope) for i in range(len(trials))]
    free = np.stack([directions.freed(column) for column in columns], axis=1)
    shares = np.linalg.solve(free.T @ free + np.eye(len(trials)), free.T @ directions.left)
    blended = np.stack(columns, axis=1) @ shares
    moved = directions.moved(blended, 1.0) - base.deviations
    unseen = _predicted(fitter, held_out, base.deviations, None)
    total = unseen.copy()
    for trial, share in zip(trials, shares.tolist(), strict=True):
        total += share * _finite(_predicted(fitter, held_out, base.deviations, trial) - unseen)
    for i, change in enumerate(moved.tolist()):
        ahead = base.deviations.copy()
        ahead[i] += _STEP
        total += change / _STEP * _finite(_predicted(fitter, held_out, ahead, None) - unseen)
    return held_out.differences_of(total)


def _shown(fitter: Fitter, work: tuple[Floats, list[Trial]]) -> list[Floats]:
    deviations, trials = work
    return [fitter.predicted(deviations, trial.form.tables(trial.w)) for trial in trials]


def _predicted(fitter: Fitter, held_out: HeldOut, deviations: Floats, trial: Trial | None) -> Floats:
    effects = trial.form.tables(trial.w) if trial else {}
    return held_out.problem.predicted(fitter.nuisances.point(deviations, effects))


def _finite(values: Floats) -> Floats:
    return np.where(np.isfinite(values), values, 0.0)
