"""Where the refit of friction that lags starts when it is late by much.

Under vibration the friction takes the speed that the base had a dead time ago. chi2 over the dead time is a comb then, with a
tooth every half period, and a refit stays where it began. Runs without vibration have no comb: friction late by 5.53 ms came to
chi2 958 from all runs at once, to 5.38 ms from the runs without, and to 181 from the best tooth beside that.
"""

import math

import numpy as np

from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.refits import Start, refits
from diagnosis.hypotheses.starts import Trial
from diagnosis.processes import spread

EFFECT = "frictional-lag"
_LATER = (1.0, 3.0, 10.0)  # times the longest lag that the library begins with: up to longer than a slip
_SPAN = (0.85, 1.15)  # times the dead time of the runs without vibration; three of them told it to within 7 %
_PER_HALF_PERIOD = 2.5  # points: from one 33 us beside a tooth at 4.5 kHz a refit still came to it
_TEETH = 2  # of every fit that get a refit


def late_fits(fitter: Fitter, trials: list[Trial], jobs: int = 1) -> list[Fit]:
    """Fits of friction that lags by much, best first; none where every run vibrates, or none does."""
    fits = _refits(fitter, late_starts(fitter, trials, jobs), jobs)
    for fit in [fit for fit in fits if _is_late_in_time(fit)][:1]:  # from the numbers of all runs other teeth stand out
        fits += _refits(fitter, _teeth(fitter, fit, jobs), jobs)
    return sorted(fits, key=lambda fit: fit.chi2)


def late_starts(fitter: Fitter, trials: list[Trial], jobs: int = 1) -> list[Start]:
    """Where they begin: fits to the runs without vibration, and what is to be had of all runs at a dead time beside theirs."""
    runs = fitter.problem.runs
    still = {run.file for run in runs if not run.commands.frequency_Hz.any()}
    if len(still) in {0, len(runs)}:
        return []
    longest = {trial.hypothesis.forms[EFFECT]: trial for trial in trials if trial.hypothesis.effects == (EFFECT,)}
    described = np.zeros(len(fitter.nuisances))
    starts: list[Start] = [
        (trial.hypothesis, described, np.array([trial.w[0] + math.log(later), *trial.w[1:]]))
        for trial in longest.values()
        for later in _LATER
    ]
    result: list[Start] = []
    unvibrated = fitter.of_runs(still)
    if not unvibrated.floor.compared.any():  # a climb without a slip, whose force alone is known
        return []
    # the best of each form: fits of one form from several starts end in one valley, and chi2 of two forms may differ by rounding
    best = {fit.hypothesis.forms[EFFECT]: fit for fit in reversed(_refits(unvibrated, starts, jobs))}
    for fit in best.values():
        result += _teeth(fitter, fit, jobs) if _is_late_in_time(fit) else [(fit.hypothesis, fit.deviations, fit.w)]
    return result


def _refits(fitter: Fitter, starts: list[Start], jobs: int) -> list[Fit]:
    """Best first."""
    return sorted(refits(fitter, starts, jobs), key=lambda fit: fit.chi2)


def _is_late_in_time(fit: Fit) -> bool:
    return fit.hypothesis.coordinates[0].name == "delay_s"


def _teeth(fitter: Fitter, fit: Fit, jobs: int) -> list[Start]:
    """The best dead times about that of a fit, everything else as there."""
    axis = fit.hypothesis.coordinates[0]
    delay_s = axis.value(float(fit.w[0]))
    highest_Hz = max(float(run.commands.frequency_Hz.max()) for run in fitter.problem.runs)
    low_s, high_s = (share * delay_s for share in _SPAN)
    count = max(math.ceil((high_s - low_s) * 2.0 * highest_Hz * _PER_HALF_PERIOD), _TEETH)
    tried = [
        np.array([math.log(lag_s / axis.scale), *fit.w[1:]]) for lag_s in np.linspace(low_s, high_s, count).tolist()
    ]
    points = [(fit.deviations, fit.hypothesis.tables(w)) for w in tried]
    residuals = [fitter.whitened(features)[0] for features in spread(jobs, Fitter.predicted_many, fitter, points)]
    # of the differences alone: the priors hardly change along a dead time
    chi2 = [math.inf, *(float(residual @ residual) for residual in residuals), math.inf]
    teeth = [i for i in range(count) if chi2[i + 1] <= min(chi2[i], chi2[i + 2])]
    best = sorted(teeth, key=lambda i: chi2[i + 1])[:_TEETH]
    return [(fit.hypothesis, fit.deviations, tried[i]) for i in best]
