"""From fits and a verdict to a diagnosis; and a diagnosis from relations and latent friction alone, where no fit ends in time."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import numpy as np

from bridge.arrays import Floats
from bridge.log.finding import Finding
from diagnosis.deadline import OutOfTimeError
from diagnosis.evidence.folder import Evidence, MeasuredRun
from diagnosis.evidence.foreign_vibration import PICK_UP
from diagnosis.experiments.proposal import SINE, UNCOUPLE, next_experiment
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import SHORTEST_S
from diagnosis.fits.fit import Fit
from diagnosis.fits.random_friction import is_random
from diagnosis.gap.measure import DEFINITION, Floor, cell_names, cell_squares, differences
from diagnosis.gap.prepare import Prepared
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.hypothesis import Coordinate
from diagnosis.hypotheses.starts import Trial
from diagnosis.model.per_run import is_phase
from diagnosis.pictures.choice import pictures
from diagnosis.report.outcome import verdict_of, wrong_numbers
from diagnosis.result import PARAMETERS, Candidate, Cell, Diagnosis, Estimate, Experiment, Gap, Shrinkage
from diagnosis.verdict.blend import flexible_differences
from diagnosis.verdict.confirmation import Confirmation
from diagnosis.verdict.held_out import HeldOut
from diagnosis.verdict.judge import Verdict, refittable
from diagnosis.verdict.lookalikes import imitators
from diagnosis.verdict.selection import Contest
from plant.effects.library import EFFECTS

HOLD = Experiment(
    f"Hold each speed and each vibration for {SHORTEST_S:g} s or more in some runs.",
    "No simulated fit compares a command that changes all the time.",
    None,
)
LONGER = Experiment("Diagnose the same runs with a longer --budget.", "No effect was fitted in this time.", None)
R = TypeVar("R")
_NO_SUCH_VIBRATION = Experiment(UNCOUPLE, "No effect of the library makes such a vibration of the force signal.", None)
_NO_SINE = Experiment(SINE, "Every effect of the library shakes the base with a sine.", None)
# Largest share of a run with changing speed or vibration without a finding. Smaller: ordinary ramps of drive and piezo cause the
# finding. Larger: most of a run may be left out of the comparison without a finding.
_MUCH_CHANGING = 0.2


def comparable(runs: list[Prepared]) -> bool:
    """Whether any fitted run has a segment that simulated fits can compare."""
    return any(run.commands.segments for run in runs if not run.holdout)


def unfitted() -> Verdict:
    """The verdict before any result: all explanations have the same probability."""
    names = ("unexplained", *EFFECTS, "none")
    return Verdict("unexplained", None, dict.fromkeys(names, 1.0 / len(names)), None, (), 1.0)


def without_fits(verdict: Verdict, runs: Sequence[MeasuredRun], following: Experiment, began: float) -> Diagnosis:
    """The diagnosis of a verdict without any fit, still without relations, shares and sentences."""
    return Diagnosis(
        verdict=verdict.kind,
        effects=verdict.names,
        summary=(),
        candidates=tuple(Candidate(name, math.nan) for name in dict.fromkeys((*verdict.names, *EFFECTS, "none"))),
        complete=math.nan,
        not_distinguishable=(),
        where=(),
        gap=Gap(DEFINITION, tuple(run.file for run in runs if run.holdout)),
        next_experiment=following,
        rig=(),
        findings=(),
        pictures=(),
        compared_features=0,
        elapsed_s=round(time.monotonic() - began, 2),
    )


def assembled(
    evidence: Evidence,
    runs: list[Prepared],
    contest: Contest,
    outcome: Confirmation,
    tried: list[Trial],
    began: float,
    jobs: int,
    outside: bool,
) -> Diagnosis:
    """The diagnosis of an evidence, still without its relations and without sentences.

    Args:
        evidence, runs: the evidence, and all its prepared runs, including held-out runs.
        contest: all fits, and the verdict over them.
        outcome: the final verdict, after the held-out runs.
        tried: the library's trials.
        began: `time.monotonic()` at the start of the diagnosis.
        jobs: processes.
        outside: whether the relations show something that no effect of the library causes.

    """
    fitter, baseline = contest.rig.fitter, contest.rig.fit
    verdict, best, _, held_out = outcome
    nuisances = fitter.nuisances
    cells = _in_time(
        lambda: _cells(
            fitter.floor, differences(fitter.floor, fitter.problem, fitter.predicted(baseline.deviations, {}))
        ),
        [],
    )
    judged = Gap(DEFINITION)
    if held_out is not None:
        gap = held_out
        cells += _in_time(
            lambda: _cells(gap.floor, gap.differences(baseline.deviations, baseline.hypothesis, baseline.w)), []
        )
        judged = _in_time(lambda: _judged(contest, outcome, gap, tried, jobs), judged)
    cells += _vibrating(evidence)
    total = sum(cell.share for cell in cells)
    where = sorted((cell._replace(share=cell.share / total) for cell in cells), key=lambda cell: -cell.share)
    singles = {fit.hypothesis.effects[0]: fit for fit in reversed(contest.singles)}
    by_effect = dict(singles)
    if verdict.named is not None:
        by_effect |= dict.fromkeys(verdict.named.hypothesis.effects, verdict.named)
    elif verdict.ranked and is_random(verdict.ranked[0].fit.hypothesis):
        by_effect[verdict.ranked[0].fit.hypothesis.effects[0]] = verdict.ranked[0].fit
    alone = {name: round(fit.chi2, 2) for name, fit in ({"none": baseline} | singles).items()}
    numbers = _in_time(lambda: tuple(wrong_numbers(nuisances, best, held_out)), ())
    kind, effects = verdict_of(verdict.kind, verdict.names, numbers, judged, outside)
    complete = math.nan if kind == "not-finished" else 1.0 - verdict.probabilities["unexplained"]
    candidates = tuple(
        _candidate(name, probability / complete, by_effect.get(name))._replace(chi2=alone.get(name))
        for name, probability in verdict.probabilities.items()
        if name != "unexplained"
    )
    named = nuisances.point(best.deviations, best.effects) if verdict.named else None
    followed = [ranked for ranked in verdict.ranked if not is_random(ranked.fit.hypothesis)]
    alike = _in_time(lambda: imitators(fitter, followed, verdict.scale), ()) if refittable(verdict) else ()
    leaders = [fit for fit in (verdict.named or baseline, verdict.runner_up) if fit is not None]
    if verdict.outside:
        picked_up = any(vibration.kind == PICK_UP for run in evidence.runs for vibration in run.foreign)
        following = _NO_SUCH_VIBRATION if picked_up else _NO_SINE
    else:
        following = _in_time(lambda: next_experiment(fitter.problem, nuisances, leaders), LONGER)
    shown = Problem(evidence.rig, runs)
    shown.until_s = fitter.problem.until_s
    described, refitted = (nuisances.point(at, {}) for at in (np.zeros(len(nuisances)), baseline.deviations))
    return Diagnosis(
        verdict=kind,
        effects=effects,
        summary=(),
        candidates=candidates,
        complete=complete,
        not_distinguishable=(alike,) if alike else (),
        where=tuple(where),
        gap=judged,
        next_experiment=following,
        rig=nuisances.parameters(best.deviations),
        findings=(*evidence.findings, *_changing(runs)),
        pictures=_in_time(lambda: pictures(shown, described, refitted, named, effects), ()),
        compared_features=len(baseline.residual),
        elapsed_s=round(time.monotonic() - began, 2),
        numbers=numbers,
    )


def _in_time(work: Callable[[], R], otherwise: R) -> R:
    """The result of `work`; `otherwise` when the time budget is used up."""
    try:
        return work()
    except OutOfTimeError:
        return otherwise


def compared_fits(verdict: Verdict, gone: Fit | None) -> list[Fit]:
    """The fits whose gap is reported on the held-out runs: the named fit, or the refuted one (`gone`), then the runner-up."""
    first, second = verdict.named or gone, verdict.runner_up
    if first is None or second is None:
        return [fit for fit in (first, second) if fit is not None]
    again = first.hypothesis.effects == second.hypothesis.effects and not is_random(first.hypothesis)
    return [first] if again else [first, second]


def _judged(contest: Contest, outcome: Confirmation, held_out: HeldOut, tried: list[Trial], jobs: int) -> Gap:
    verdict, best, gone, _ = outcome
    fitter, baseline = contest.rig.fitter, contest.rig.fit
    closed = held_out.closed_by(best)
    compared = [
        Shrinkage(" and ".join(fit.hypothesis.effects), *held_out.closed_by(fit))
        for fit in compared_fits(verdict, gone)
    ]
    compared.append(Shrinkage(PARAMETERS, *held_out.closed_by(baseline)))
    blend = _in_time(lambda: flexible_differences(fitter, baseline, tried, held_out, jobs), None)
    if blend is not None:
        compared.append(Shrinkage("flexible residual", *held_out.closed_by_differences(blend)))
    named = verdict.named is not None
    return Gap(
        definition=DEFINITION,
        files=tuple(run.file for run in held_out.problem.runs),
        nominal=held_out.nominal,
        retuned=held_out.retuned,
        with_effect=closed.gap,
        shrinkage=closed.shrinkage if named else None,
        interval_90=closed.interval_90 if named else None,
        compared=tuple(compared),
        refuted=verdict.refuted,
    )


def _changing(runs: list[Prepared]) -> Iterator[Finding]:
    """A finding for every run in which speed or vibration change too much of the time to be compared."""
    for run in runs:
        seconds, length_s = run.commands.changing_s, len(run.commands.drive) * BLOCK_S
        if seconds > _MUCH_CHANGING * length_s:
            text = f"in {seconds:.3g} of {length_s:.3g} s speed or vibration change within {SHORTEST_S:g} s: not compared there"
            yield Finding("changing", f"{run.file}: commands", f"{text}; hold each command longer")


def _cells(floor: Floor, z: Floats) -> list[Cell]:
    """Cells with their squared differences above the floor; if no cell is above the floor, with their squared differences."""
    squares = cell_squares(floor, z)
    above = np.maximum(squares - floor.level**2, 0.0)
    shares = above if above.sum() > 0.0 else squares
    return [
        Cell(signal, regime, band_Hz, run, float(share))
        for (signal, regime, band_Hz, run), share in zip(cell_names(floor), shares, strict=True)
        if share > 0.0
    ]


def _vibrating(evidence: Evidence) -> list[Cell]:
    """Cells for vibrations that no model makes; their unit is the reported limit, as the floor is the unit of other cells."""
    return [
        Cell(vibration.column, "steady", vibration.band_Hz, run.file, vibration.limits**2 - 1.0)
        for run in evidence.runs
        for vibration in run.foreign
    ]


def _candidate(name: str, probability: float, fit: Fit | None) -> Candidate:
    if fit is None:
        return Candidate(name, probability)
    nuisances = len(fit.deviations)
    deviation = np.sqrt(np.diag(fit.covariance()))[nuisances:]
    parameters = {
        coordinate.name: estimate_of(coordinate, float(w), float(spread))
        for coordinate, w, spread in zip(fit.hypothesis.coordinates, fit.w, deviation, strict=True)
        if coordinate.effect == name
    }
    return Candidate(name, probability, fit.hypothesis.forms[name], parameters)


def estimate_of(coordinate: Coordinate, w: float, deviation: float) -> Estimate:
    """A parameter with its 90 % interval, from the value of its coordinate and that value's standard deviation."""
    value, half = coordinate.value(w), 1.645 * deviation
    if is_phase(coordinate.name):  # at most half a turn to either side, without wrapping at pi
        half = min(half * coordinate.scale, math.pi)
        return Estimate(value, (value - half, value + half))
    low, high = sorted((coordinate.value(w - half), coordinate.value(w + half)))
    return Estimate(value, (low, high))
