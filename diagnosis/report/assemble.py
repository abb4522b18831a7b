"""From the witnesses and the answer of the judge to a diagnosis."""

import math
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np

from bridge.arrays import Floats
from bridge.log.finding import Finding
from diagnosis.deadline import OutOfTimeError
from diagnosis.evidence.folder import Evidence
from diagnosis.evidence.foreign_vibration import PICK_UP
from diagnosis.experiments.proposal import SINE, UNCOUPLE, next_experiment
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import SHORTEST_S
from diagnosis.fits.estimates import estimates_of
from diagnosis.fits.explanations import Search
from diagnosis.fits.fit import Fit
from diagnosis.fits.held_out import HeldOut
from diagnosis.gap.measure import DEFINITION, Floor, cell_names, cell_squares, differences
from diagnosis.gap.prepare import Prepared
from diagnosis.gap.problem import Problem
from diagnosis.judge.judge import NONE, Judged
from diagnosis.judge.ledger import Ledger
from diagnosis.judge.outcome import Model, verdict_of, wrong_numbers
from diagnosis.judge.witnesses import NO_FIT, Witnesses
from diagnosis.latent.answer import named_by
from diagnosis.pictures.choice import pictures
from diagnosis.result import PARAMETERS, Candidate, Cell, Diagnosis, Experiment, Gap, Shrinkage
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
# Share of the probability of the named effect from which a rival is listed with it. Of 32 single effects of the bench the list
# holds the truth in 28, with 2.1 names on average; with a third 25 and 1.6, with an eighth 30 and 3.3.
_RIVAL = 0.2


def assembled(seen: Witnesses, ledger: Ledger, judged: Judged) -> Diagnosis:
    """The diagnosis, still without relations, shares and sentences."""
    if seen.search is None:
        return _without_fits(seen, ledger, judged)
    search, evidence = seen.search, seen.evidence
    fitter, baseline = search.rig.fitter, search.rig.fit
    named = _in_time(lambda: search.of(judged.names), None) if judged.names else None
    best = named or baseline
    gap, cells = Gap(DEFINITION), list[Cell]()
    cells += _in_time(lambda: _cells_of(fitter.floor, fitter.problem, fitter.predicted(baseline.deviations, {})), [])
    rival = _in_time(lambda: _rival(search, judged), None)
    if (held_out := seen.held_out) is not None:
        cells += _in_time(lambda: _cells(held_out.floor, held_out.differences(baseline)), [])
        gap = _in_time(lambda: _gap(held_out, baseline, named, rival), gap)
    numbers = _in_time(lambda: tuple(wrong_numbers(fitter.nuisances, best, held_out)), ())
    done = _judged(seen, ledger, judged, Model(named is not None, numbers, gap, _outside(seen)))
    cells += _vibrating(evidence)
    total = sum(cell.share for cell in cells)
    shown = Problem(evidence.rig, seen.runs)
    shown.until_s = seen.until_s
    nuisances = fitter.nuisances
    described, refitted = (nuisances.point(at, {}) for at in (np.zeros(len(nuisances)), baseline.deviations))
    of_named = nuisances.point(best.deviations, best.effects) if named is not None and named.effects else None
    return done._replace(
        candidates=_candidates(judged, search, named),
        not_distinguishable=_alike(judged, done.effects),
        where=tuple(sorted((cell._replace(share=cell.share / total) for cell in cells), key=lambda cell: -cell.share)),
        next_experiment=_next(seen, search, [best, *([] if rival is None else [rival])]),
        rig=nuisances.parameters(best.deviations),
        findings=(*evidence.findings, *_changing(seen.runs)),
        pictures=_in_time(lambda: pictures(shown, described, refitted, of_named, done.effects), ()),
        compared_features=len(baseline.residual),
    )


def _without_fits(seen: Witnesses, ledger: Ledger, judged: Judged) -> Diagnosis:
    """The diagnosis from relations and latent friction alone."""
    gap = Gap(DEFINITION, tuple(run.file for run in seen.evidence.runs if run.holdout))
    done = _judged(seen, ledger, judged, Model(fitted=False, numbers=(), gap=gap, outside=_outside(seen)))
    if done.verdict != "no-gap":
        return done
    # the relations do not see every effect
    candidates = tuple(candidate._replace(probability=math.nan) for candidate in done.candidates)
    return done._replace(verdict="not-finished", candidates=candidates, complete=math.nan)


def _judged(seen: Witnesses, ledger: Ledger, judged: Judged, model: Model) -> Diagnosis:
    """The part of a diagnosis that needs no fit."""
    kind, effects = verdict_of(judged, model, named_by(seen.latent))
    return Diagnosis(
        verdict=kind,
        effects=effects,
        summary=(),
        candidates=_candidates(judged, None, None),
        complete=judged.complete,
        not_distinguishable=(),
        where=(),
        gap=model.gap,
        next_experiment=LONGER if seen.comparable or not seen.runs else HOLD,
        rig=(),
        findings=(*seen.evidence.findings, NO_FIT),
        pictures=(),
        compared_features=0,
        elapsed_s=0.0,
        numbers=model.numbers,
        ledger=ledger.rows,
        cannot_show=seen.hidden,
    )


def _outside(seen: Witnesses) -> bool:
    return bool(seen.decision.outside) or any(run.foreign for run in seen.evidence.runs)


def _in_time(work: Callable[[], R], otherwise: R) -> R:
    """The result of `work`; `otherwise` when the time budget is used up."""
    try:
        return work()
    except OutOfTimeError:
        return otherwise


def _rival(search: Search, judged: Judged) -> Fit | None:
    """The fit of the most probable explanation that has no effect of the first one; None where none has a fit."""
    first = judged.names
    rivals = (search.of(names) for names in judged.explanations if names != first and not names & first)
    return next((fit for fit in rivals if fit is not None), None)


def _gap(held_out: HeldOut, baseline: Fit, named: Fit | None, rival: Fit | None) -> Gap:
    closed = held_out.closed_by(named or baseline)
    compared = [
        Shrinkage(" and ".join(fit.effects), *held_out.closed_by(fit))
        for fit in (named, rival)
        if fit is not None and fit.effects
    ]
    return Gap(
        definition=DEFINITION,
        files=tuple(run.file for run in held_out.problem.runs),
        nominal=held_out.nominal,
        retuned=held_out.retuned,
        with_effect=closed.gap,
        shrinkage=None if named is None else closed.shrinkage,
        interval_90=None if named is None else closed.interval_90,
        compared=(*compared, Shrinkage(PARAMETERS, *held_out.closed_by(baseline))),
    )


def _next(seen: Witnesses, search: Search, leaders: list[Fit]) -> Experiment:
    """The next experiment; a check by hand where the runs show a vibration that no effect makes."""
    kinds = {vibration.kind for run in seen.evidence.runs for vibration in run.foreign}
    if kinds:
        return _NO_SUCH_VIBRATION if PICK_UP in kinds else _NO_SINE
    fitter = search.rig.fitter
    return _in_time(lambda: next_experiment(fitter.problem, fitter.nuisances, leaders), LONGER)


def _candidates(judged: Judged, search: Search | None, named: Fit | None) -> tuple[Candidate, ...]:
    """Every effect and none, the most probable first, with the parameters of its best fit."""
    fits = [] if search is None else search.fits
    alone = {fit.hypothesis.effects[0]: fit for fit in reversed(fits) if len(fit.effects) == 1}
    chi2 = {name: round(fit.chi2, 2) for name, fit in alone.items()}
    if search is not None:
        chi2[NONE] = round(search.rig.fit.chi2, 2)
    best = alone | ({} if named is None else dict.fromkeys(named.effects, named))
    result: list[Candidate] = []
    excluded = dict.fromkeys((name for name in EFFECTS if name not in judged.effects), 0.0)
    for name, probability in (judged.effects | excluded).items():
        fit = best.get(name)
        if fit is None:
            result.append(Candidate(name, probability, chi2=chi2.get(name)))
        else:
            form, parameters = fit.hypothesis.forms[name], estimates_of(fit)[name]
            result.append(Candidate(name, probability, form, parameters, chi2.get(name)))
    return tuple(result)


def _alike(judged: Judged, effects: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """The named effect with its rivals; empty without any, for two effects, and for a wrong number that does not lead them."""
    if len(effects) != 1 or effects[0] not in judged.names:
        return ()
    least = _RIVAL * judged.effects[effects[0]]
    rivals = (name for name, value in judged.effects.items() if name not in (*effects, NONE) and value >= least > 0.0)
    names = (*effects, *rivals)
    return (names,) if len(names) > 1 else ()


def _changing(runs: list[Prepared]) -> Iterator[Finding]:
    """A finding for every run in which speed or vibration change too much of the time to be compared."""
    for run in runs:
        seconds, length_s = run.commands.changing_s, len(run.commands.drive) * BLOCK_S
        if seconds > _MUCH_CHANGING * length_s:
            text = f"in {seconds:.3g} of {length_s:.3g} s speed or vibration change within {SHORTEST_S:g} s: not compared there"
            yield Finding("changing", f"{run.file}: commands", f"{text}; hold each command longer")


def _cells_of(floor: Floor, problem: Problem, predicted: Floats) -> list[Cell]:
    return _cells(floor, differences(floor, problem, predicted))


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
