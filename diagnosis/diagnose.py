"""All steps from an evidence to a diagnosis, in order.

Search the relations between channels, fit the baseline, look for a gap, find the effects, check them on held-out runs and against
the relations, put the answer together.
"""

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

from bridge.log.finding import Finding
from diagnosis.deadline import GRACE_S, EndedError, OutOfTimeError, limited
from diagnosis.evidence.folder import Evidence, MeasuredRun
from diagnosis.evidence.foreign_vibration import DISTORTED
from diagnosis.evidence.split import excerpt
from diagnosis.fits.retuning import retuned_rig
from diagnosis.gap.prepare import Prepared, prepare
from diagnosis.gap.problem import PIEZO_EFFECTS, Problem
from diagnosis.hypotheses.catalogue import cannot_show, trials
from diagnosis.latent.answer import LatentSignal, latent_of
from diagnosis.processes import one_thread
from diagnosis.relations.answer import Relations, relations_of
from diagnosis.relations.decide import Decision, decision_of, ruled_out
from diagnosis.relations.relation import OUTSIDE
from diagnosis.report.assemble import HOLD, LONGER, assembled, comparable, unfitted, without_fits
from diagnosis.report.relations_block import in_a_line, with_relations
from diagnosis.report.words import latent_line
from diagnosis.result import Diagnosis
from diagnosis.verdict.by_latent import with_latent
from diagnosis.verdict.by_relations import with_relations_verdict
from diagnosis.verdict.confirmation import borne_out
from diagnosis.verdict.judge import Verdict, with_outside
from diagnosis.verdict.selection import Contest, Hints, Progress

# share of the time budget for the fits; the rest is for held-out runs, the next experiment and pictures
_FOR_FITS = 0.7
_NO_FIT = Finding("budget", "fits", "none was made: names and shares come from relations and friction alone")
_CUT_SHORT = Finding("budget", "fits", "ended before every effect was tried: this is the best answer by then")
_TIME_IS_UP = "the time is up: the best answer so far"


def diagnose(evidence: Evidence, progress: Progress, jobs: int = 1, budget_s: float | None = None) -> Diagnosis:
    """Diagnose one evidence. Without a budget the answer does not depend on `jobs`.

    Raises Fault BAD_EVIDENCE when nothing can be compared.

    Args:
        evidence: the rig as described and the measured runs.
        progress: called with a text on the state of the work, and the share that is done (0 to 1).
        jobs: processes.
        budget_s: seconds after which the best answer so far is returned; None: no limit.

    """
    with one_thread():
        return _diagnosed(evidence, progress, jobs, math.inf if budget_s is None else budget_s)


class _Seen(NamedTuple):
    """The runs, and the results of the steps before any fit."""

    runs: list[Prepared]
    relations: Relations = Relations((), ())
    decision: Decision = Decision((), ())
    latent: tuple[LatentSignal, ...] = ()


def _diagnosed(evidence: Evidence, progress: Progress, jobs: int, budget_s: float) -> Diagnosis:
    began = time.monotonic()
    seen, done, finished = _Seen([]), None, False
    try:
        with limited(began + budget_s):
            seen = _Seen(prepare(evidence))
            relations = relations_of(evidence.rig, seen.runs)
            seen = seen._replace(relations=relations, decision=decision_of(relations, evidence.rig))
            seen = seen._replace(latent=latent_of(evidence.rig, seen.runs))
        finished = not comparable(seen.runs)
    except OutOfTimeError:
        progress(_TIME_IS_UP, 0.02)
    else:
        for line in (in_a_line(seen.decision), latent_line(seen.latent)):
            if line:
                progress(line, 0.02)
        if not finished:
            done = _by_fits(evidence, seen, progress, jobs, (began, began + budget_s))
    if done is None:
        verdict = with_latent(with_relations_verdict(unfitted(), seen.decision, [], None, None), seen.latent, None)
        verdict = with_vibration_findings(verdict, evidence.runs)
        if verdict.kind == "unexplained" and not (finished or seen.decision.outside or verdict.outside):
            verdict = verdict._replace(kind="not-finished")
        done = without_fits(verdict, evidence.runs, HOLD if finished else LONGER, began)
        done = done._replace(findings=(*evidence.findings, _NO_FIT))
    if seen.runs:
        done = done._replace(cannot_show=cannot_show(evidence.rig, seen.runs, evidence.assumed))
    done = with_relations(done, seen.runs, seen.relations, seen.decision, seen.latent)
    progress(f"verdict: {done.verdict}", 1.0)
    return done


def _by_fits(
    full: Evidence, seen: _Seen, progress: Progress, jobs: int, time_s: tuple[float, float]
) -> Diagnosis | None:
    """The diagnosis by simulated fits; `time_s`: instants of its begin and its deadline. None where no fit ends in time."""
    began, until_s = time_s
    evidence = excerpt(full)
    runs = seen.runs if evidence is full else prepare(evidence)
    problem = Problem(evidence.rig, [run for run in runs if not run.holdout])
    problem.until_s = began + _FOR_FITS * (until_s - began)
    hidden = set(cannot_show(evidence.rig, runs, evidence.assumed)) | ruled_out(seen.relations, seen.decision)
    tried = [trial for trial in trials(problem) if not hidden & set(trial.hypothesis.effects)]
    shown = {cause for answered in seen.relations.answered for cause in answered.chosen.causes if cause not in OUTSIDE}
    try:
        contest = Contest(
            retuned_rig(evidence, problem, progress, jobs),
            tried,
            jobs,
            Hints(frozenset(shown), bool(seen.decision.outside)),
        )
    except OutOfTimeError:
        progress(_TIME_IS_UP, 0.2)
        return None
    in_time = True
    try:
        contest.decide(progress)
    except OutOfTimeError as error:
        progress(_TIME_IS_UP, 0.75)
        contest.stop()
        in_time, jobs = False, 1  # the interruption ended the workers; new ones would take seconds
        if isinstance(error, EndedError):
            until_s = min(until_s, time.monotonic() + GRACE_S)
    contest.rig.fitter.problem.until_s = until_s
    held_out = [run for run in runs if run.holdout]
    judged_on = Problem(evidence.rig, held_out) if held_out else None
    if judged_on is not None:
        judged_on.until_s = until_s
    try:
        outcome = borne_out(contest, judged_on, jobs)
    except OutOfTimeError:
        outcome = borne_out(contest, None, jobs)
        in_time = False
    nearest = outcome.gone or outcome.verdict.runner_up
    closes = None
    if outcome.held_out is not None and nearest is not None:
        with suppress(OutOfTimeError):
            closes = outcome.held_out.closed_by(nearest).shrinkage
    verdict = with_relations_verdict(
        outcome.verdict, seen.decision, [*contest.singles, *contest.pairs], nearest, closes
    )
    verdict = with_latent(verdict, seen.latent, outcome.held_out)
    verdict = with_vibration_findings(verdict, evidence.runs)
    outside = bool(seen.decision.outside) or verdict.outside
    if not (in_time or contest.singles or verdict.names or outside):
        verdict = verdict._replace(kind="not-finished")
    outcome = outcome._replace(verdict=verdict, best=verdict.named or contest.rig.fit)
    done = assembled(evidence, runs, contest, outcome, tried, began, jobs, outside)
    return done if in_time else done._replace(findings=(*done.findings, _CUT_SHORT))


def with_vibration_findings(verdict: Verdict, runs: Sequence[MeasuredRun]) -> Verdict:
    """The verdict, corrected for vibration that the model lacks: in the force signal, or of the base at other frequencies.

    With such a vibration, "no gap" becomes "unexplained"; with a base at other frequencies, so does an effect of the piezo alone.

    Args:
        verdict: verdict from the features, which do not show such vibration.
        runs: all runs of the evidence.

    """
    kinds = {vibration.kind for run in runs for vibration in run.foreign}
    return with_outside(verdict, PIEZO_EFFECTS if DISTORTED in kinds else frozenset()) if kinds else verdict
