"""Starts for the refit of a load wave whose breakaways mislead: every run gets the phase that suits this run best.

Slips come and go as a wave moves, so a refit ends near the phases that it started with. Where a wave turns as fast as slips
follow each other, the breakaways say little about its phase. Each run has its own share of chi2, so eight predictions of all
runs give eight phases for each run, in any combination (docs/method/diagnosis.md).
"""

import math
from typing import NamedTuple

import numpy as np

from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import FAR_KNEE, Fitter
from diagnosis.fits.refits import Start
from diagnosis.hypotheses.starts import Trial, wave_trial
from diagnosis.hypotheses.waves import Wave
from diagnosis.model.per_run import PHASE, of_run
from diagnosis.processes import spread

EFFECT, FORM = "normal-load-fluctuation", "sine"
_PHASES_RAD = 2.0 * math.pi * np.arange(8) / 8.0  # that a run may begin in
_RATIOS = (0.007, 0.02, 0.06)  # amplitudes that are tried, over the mean load: from hardly visible to large
_MOST = 3  # frequencies that get a refit; each more costs one refit, fewer may miss the right frequency


class _TriedWave(NamedTuple):
    """A wave with the best phase for every run."""

    chi2: float  # squares of the whitened differences, under the knee of a far start
    wave: Wave


def starts_by_run(fitter: Fitter, origin: Fit, trials: list[Trial], jobs: int = 1) -> list[Start]:
    """Starts of a load wave on the rig of `origin`, at the `_MOST` frequencies of the trials with the lowest chi2."""
    waves: dict[float, Wave] = {}
    slowest_Hz = 0.0
    for trial in trials:
        if trial.hypothesis.forms == {EFFECT: FORM}:
            coordinates = {coordinate.name: coordinate for coordinate in trial.hypothesis.coordinates}
            frequency = coordinates["frequency_Hz"]
            slowest_Hz = frequency.low
            waves[frequency.scale] = Wave(1.0 / frequency.scale, 0.0, 0.0, spread=frequency.prior)
    in_phase = spread(jobs, _in_best_phases, (fitter, origin), list(waves.values()))
    best = sorted(in_phase, key=lambda tried: tried.chi2)[:_MOST]
    wave_trials = [wave_trial(EFFECT, FORM, tried.wave, slowest_Hz) for tried in best]
    return [(trial.hypothesis, origin.deviations, trial.w) for trial in wave_trials]


def _in_best_phases(shared: tuple[Fitter, Fit], waves: list[Wave]) -> list[_TriedWave]:
    fitter, origin = shared
    files = [run.file for run in fitter.problem.runs]
    run_of = np.array([files.index(run) for *_, run in fitter.floor.cells])
    tried_waves: list[_TriedWave] = []
    for wave in waves:
        tried = [_table(wave, ratio, phase_rad) for ratio in _RATIOS for phase_rad in _PHASES_RAD.tolist()]
        predicted = fitter.predicted_many([(origin.deviations, table) for table in tried])
        squares = np.array([fitter.whitened(features, FAR_KNEE)[0] ** 2 for features in predicted])
        by_run = np.stack([squares[:, run_of == i].sum(axis=1) for i in range(len(files))], axis=1)
        by_run = by_run.reshape(len(_RATIOS), len(_PHASES_RAD), len(files))
        chi2 = by_run.min(axis=1).sum(axis=1)
        best = int(chi2.argmin())
        first_rad, *others_rad = _PHASES_RAD[by_run[best].argmin(axis=0)].tolist()
        phases_of = {of_run(PHASE, file): phase_rad for file, phase_rad in zip(files[1:], others_rad, strict=True)}
        in_phase = wave._replace(ratio=_RATIOS[best], phase_rad=first_rad, phases_of=phases_of)
        tried_waves.append(_TriedWave(float(chi2[best]), in_phase))
    return tried_waves


def _table(wave: Wave, ratio: float, phase_rad: float) -> dict[str, dict[str, float | str]]:
    shape = {"second_sin": 0.0, "second_cos": 0.0}
    return {EFFECT: {"form": FORM, "ratio": ratio, "frequency_Hz": 1.0 / wave.period, PHASE: phase_rad, **shape}}
