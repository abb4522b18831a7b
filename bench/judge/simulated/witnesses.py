"""Log evidence for and against each effect, by names that every campaign has.

Four witnesses judge each effect against none: straight lines (`line`), waves (`wave`), the relations of the channel chain
(`relation`, and `chosen` for the best set), and the simulated rig refitted to the runs (`fit`, and a second effect added to the
best). `moved` is how far the numbers of the rig moved.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from bench.judge.columns import blocks
from bench.judge.lines import evidences
from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import scales_of
from diagnosis.fits.batch import together
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import FitStage, Fitter
from diagnosis.fits.retuning import ROUGHNESS
from diagnosis.fits.screening import Column, Directions, best_pairs
from diagnosis.gap.measure import KNEE, floor_of, replicates
from diagnosis.gap.prepare import Prepared
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import CATALOGUE, cannot_show
from diagnosis.hypotheses.hypothesis import NOTHING, sizes
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.hypotheses.starts import Trial, TrialRequest
from diagnosis.hypotheses.waves import drive_series, fitted, friction_series
from diagnosis.relations.answer import relations_of

Witnesses = dict[str, float]  # "witness place effect" -> log evidence, or another number of the place
# Replicates, 0.04 s each, for the scatter of the surface and for the floors. Fewer: floors are chance. More: time
_FIRST_REPLICATES, _REPLICATES = 8, 16
# Scatter of a surface that floors are made with. Narrower: rough surfaces look like effects. Smoother: floors are the sensors'.
_SURFACES = 2e-3, 0.1
_STAGE = FitStage(6, 1, KNEE)  # 40 predictions. More: time. Fewer: the numbers are off, and effects look smaller
_FURTHEST = 8.0  # times the size of a trial. Larger: beyond where the rig is linear. Smaller: large effects look small
_LEAST_POWER = 1e-6  # of a direction, in chi2: less changes nothing
_PERIODS = 600  # of a wave, from a fiftieth of the span to all of it. Fewer: short waves are missed between two periods
_HIGHEST = 1e5  # of a log evidence


class Baseline(NamedTuple):
    """The rig without effects, its numbers refitted to the runs, and the effects to try."""

    fitter: Fitter
    fit: Fit
    rougher: float  # logarithm of the scatter of breakaways and re-sticks, over a surface of 0.3 %
    trials: list[Trial]


def witnesses_of(rig: RigTable, runs: list[Prepared], baseline: Baseline | None) -> Witnesses:
    """All witnesses of the runs: 1.5 s of CPU, and 2 s for the effects in the simulated rig."""
    of_waves = ((f"wave {place} {name}", value) for place, name, value in waves(rig, runs))
    evidence = [*_of_lines(rig, runs), *of_waves, *_of_relations(rig, runs)]
    if baseline is not None:
        evidence += [*_of_rig(baseline), *_of_trials(baseline.fitter, baseline.fit, baseline.trials)]
    return {name: min(max(value, -_HIGHEST), _HIGHEST) for name, value in evidence if not math.isnan(value)}


def baseline_of(rig: RigTable, runs: list[Prepared]) -> Baseline | None:
    """The refitted rig, 2 s of CPU; None where the rig as described shows none of the measured features."""
    problem, nuisances = Problem(rig, runs), Nuisances(rig)
    described = np.zeros(len(nuisances))
    point = nuisances.point(described, {})
    rougher = _rougher(problem, replicates(problem, point, ROUGHNESS, _FIRST_REPLICATES, 1))
    ratio = min(max(ROUGHNESS.ratio * math.exp(rougher), _SURFACES[0]), _SURFACES[1])
    floor = floor_of(problem, point, replicates(problem, point, ROUGHNESS._replace(ratio=ratio), _REPLICATES, 2))
    if not floor.compared.any():
        return None
    fitter = Fitter(problem, floor, nuisances)
    fit = together(fitter.predicted_many, [fitter.fitting(NOTHING, described, np.zeros(0), _STAGE)])[0]
    return Baseline(fitter, fit, rougher, _trials(problem))


def _of_lines(rig: RigTable, runs: list[Prepared]) -> Iterator[tuple[str, float]]:
    for block in blocks(rig, runs):
        yield from ((f"line {block.name} {effect}", value) for effect, value in evidences(block)[0].items())


def waves(rig: RigTable, runs: list[Prepared]) -> Iterator[tuple[str, str, float]]:
    """Place, effect and log evidence of waves of breakaways and of the drive's speed, closer than the straight lines have."""
    if rig.drive == "force":
        return
    scales = scales_of(rig)
    for what, over, name in (
        ("friction", "position", "position-dependent-friction"),
        ("friction", "time", "normal-load-fluctuation"),
        ("speed", "position", "drive-speed-ripple"),
        ("speed", "time", "drive-speed-ripple"),
    ):
        series = friction_series(runs, scales, over) if what == "friction" else drive_series(runs, over)
        series = [part for part in series if len(part.at) > 3]
        if not series:
            continue
        periods = max(float(np.ptp(part.at)) for part in series) * np.geomspace(0.02, 1.0, _PERIODS)
        count = sum(len(part.at) if part.of_slips else len(part.at) / 10 for part in series)
        total = sum(part.weight**2 * float(np.var(part.value)) * len(part.value) for part in series)
        power = [fitted(series, periods)[0]]
        if over == "time":  # a load has another phase in every run
            by_run = [[part for part in series if part.run == run.file] for run in runs]
            power.append(np.sum([fitted(parts, periods)[0] for parts in by_run if parts], axis=0))
        for number, values in enumerate(power):
            explained = min(float(values.max()) / max(total, 1e-300), 1.0 - 1e-6)
            columns = 2 if number == 0 else 2 * len(runs)
            evidence = -0.5 * count * math.log1p(-explained) - 0.5 * columns * math.log(count)
            yield f"{what}{number}", name, evidence - math.log(_PERIODS / 10)


def _of_relations(rig: RigTable, runs: list[Prepared]) -> Iterator[tuple[str, float]]:
    for answered in relations_of(rig, runs).answered:
        for single in answered.ranking.singles:
            yield f"relation {answered.name} {single.causes[0]}", single.evidence
        for term, lost in zip(answered.chosen.terms, answered.lost, strict=True):
            yield f"chosen {answered.name} {term.cause}", lost


def _of_rig(baseline: Baseline) -> Iterator[tuple[str, float]]:
    fit = baseline.fit
    yield "fit rig chi2", fit.chi2
    yield "fit rig compared", float(len(fit.residual))
    yield "moved rig surface", baseline.rougher
    names = baseline.fitter.nuisances.names
    yield from ((f"moved rig {name}", value) for name, value in zip(names, fit.deviations.tolist(), strict=True))


def _of_trials(fitter: Fitter, fit: Fit, trials: list[Trial]) -> Iterator[tuple[str, float]]:
    """The gain of each effect alone, and together with the best effect, if the rig were linear in its size."""
    directions = Directions(fit, fitter.most)
    described = fitter.predicted(fit.deviations, {})
    slope = fitter.whitened(described)[1]
    moved = fitter.predicted_many([(fit.deviations, trial.hypothesis.tables(trial.w)) for trial in trials])
    changes = [fitter.column(described, features, slope) for features in moved]
    columns = [Column(trial, change, directions.freed(change)) for trial, change in zip(trials, changes, strict=True)]
    columns = [column for column in columns if float(column.direction @ column.direction) > _LEAST_POWER]
    gains: dict[str, tuple[float, Column]] = {}
    for column in columns:
        low, high = _bounds(column.trial)
        inner, towards = float(column.direction @ column.direction), float(column.direction @ directions.left)
        size = min(max(towards / inner, low), high)
        name = column.trial.hypothesis.effects[0]
        if name not in gains or size * towards - 0.5 * size**2 * inner > gains[name][0]:
            gains[name] = size * towards - 0.5 * size**2 * inner, column
    if not gains:
        return
    yield from ((f"fit rig {name}", gain) for name, (gain, _) in gains.items())
    left = float(directions.left @ directions.left)
    leading = sorted(gains, key=lambda name: -gains[name][0])
    for first in leading[:2]:  # the second, too, where the library shall not have the first
        for name in gains.keys() - {first}:
            both = [gains[first][1], *(column for column in columns if column.trial.hypothesis.effects[0] == name)]
            stacked = np.stack([column.direction for column in both])
            bounds = np.array([_bounds(column.trial) for column in both])
            pairs = best_pairs(both, stacked @ stacked.T, stacked @ directions.left, (bounds[:, 0], bounds[:, 1]), left)
            if pairs:
                yield f"beside {first} {name}", 0.5 * (left - pairs[0][3]) - gains[first][0]


def _bounds(trial: Trial) -> tuple[float, float]:
    """Of a trial's size, in times its own."""
    return (1.0 / _FURTHEST if trial.hypothesis.coordinates[0].logarithmic else -_FURTHEST), _FURTHEST


def _rougher(problem: Problem, drawn: Floats) -> float:
    """Logarithm of the scatter of breakaways and re-sticks, over the replicates `drawn`."""
    mean = np.nan_to_num(drawn).sum(axis=0) / np.maximum(np.isfinite(drawn).sum(axis=0), 1)
    scatter = np.array([label.name == "scatter" for _, label in problem.labels])
    known = scatter & (problem.measured > 0.0) & (mean > 0.0)
    return 0.5 * float(np.median(np.log(problem.measured[known] / mean[known]))) if known.any() else 0.0


def _trials(problem: Problem) -> list[Trial]:
    """The forms whose start does not depend on waves of the data: those have their columns in the straight lines."""
    frequencies = np.concatenate([run.commands.frequency_Hz for run in problem.runs])
    highest_Hz = float(frequencies.max())
    of_rig = sizes(problem.rig, problem.runs, highest_Hz)
    hidden = cannot_show(problem.rig, problem.runs, ())
    return [
        trial
        for name, row in CATALOGUE.items()
        if name not in hidden
        for form, tried in row.forms.items()
        if tried.scale(of_rig)
        for trial in tried.starts(TrialRequest(name, form, tried.scale(of_rig), problem, highest_Hz))
    ]
