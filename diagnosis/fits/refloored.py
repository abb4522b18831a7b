"""Floors again, where a model with an effect is: the rig without it may move otherwise than what was measured.

Floors come from replicates of the rig refitted without effects. Held to its tolerances beside a large effect it ends in another
regime, and scatters there as the measured rig does not: a drive 30 % too soft, its own formula fitted to it, leaves over four
times the expected chi2 on the floors of the described rig, less than 2.5 times on its own (tests/unit/test_second_floor.py).
"""

from typing import NamedTuple

from diagnosis.fits.batch import together
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.refits import best_of_each, refits
from diagnosis.fits.retuning import REPLICATES, Retuned, expected_chi2
from diagnosis.gap.measure import floor_of, replicates

_FITS = 4  # of single effects, and of pairs, that are fitted again: the others were far behind


class Again(NamedTuple):
    """The search's result on the floors of the model that came nearest."""

    retuned: Retuned
    singles: list[Fit]
    pairs: list[Fit]


def on_floor_of(best: Fit, first: Retuned, singles: list[Fit], pairs: list[Fit], jobs: int = 1) -> Again:
    """The rig without effects and the leading effects, fitted again on the floors of `best`; best first.

    Args:
        best: the fit whose replicates make the floors.
        first: what `best` was found on.
        singles, pairs: the fits, best first.
        jobs: processes.

    """
    old = first.fitter
    point = old.nuisances.point(best.deviations, best.effects)
    drawn = replicates(old.problem, point, first.roughness, REPLICATES, 2, jobs)
    fitter = Fitter(old.problem, floor_of(old.problem, point, drawn, old.floor), old.nuisances)
    # first of all: the others start with its derivatives of the nuisances
    (retuned,) = together(fitter.predicted_many, [fitter.retuning(first.fit.deviations)])
    beside = first.fit._replace(deviations=best.deviations)
    starts = [(fit.hypothesis, fit.deviations, fit.w) for fit in (beside, *singles[:_FITS], *pairs[:_FITS])]
    leaders = best_of_each(sorted((retuned, *refits(fitter, starts, jobs)), key=lambda fit: fit.chi2))
    without, single, double = ([fit for fit in leaders if len(fit.hypothesis.effects) == count] for count in range(3))
    nearest = next(fit for fit in leaders if fit.hypothesis.effects)
    expected = expected_chi2(fitter, nearest, first.roughness, jobs)
    return Again(Retuned(fitter, without[0], first.roughness, expected), single, double)
