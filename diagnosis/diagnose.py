"""The whole way from an evidence to a diagnosis: retune, alarm, name, group, judge on held-out runs, say what to do next."""

import time
from collections.abc import Sequence

from diagnosis.evidence.folder import Evidence, Run
from diagnosis.fits.retuning import retuned_rig
from diagnosis.gap.prepare import prepare
from diagnosis.gap.problem import PIEZO_EFFECTS, Problem
from diagnosis.hypotheses.trials import trials
from diagnosis.processes import one_thread
from diagnosis.report.assemble import assembled
from diagnosis.result import Diagnosis
from diagnosis.verdict.confirmation import borne_out
from diagnosis.verdict.judge import Verdict, although_outside
from diagnosis.verdict.selection import Contest, Progress


def diagnose(evidence: Evidence, progress: Progress, jobs: int = 1) -> Diagnosis:
    """Diagnose one evidence. `progress` is told, in words, what is known and the share of the work that is done.

    The answer does not depend on `jobs`. Raises Fault BAD_EVIDENCE when nothing can be compared.
    """
    with one_thread():
        return _diagnosed(evidence, progress, jobs)


def _diagnosed(evidence: Evidence, progress: Progress, jobs: int) -> Diagnosis:
    began = time.monotonic()
    runs = prepare(evidence)
    problem = Problem(evidence.rig, [run for run in runs if not run.holdout])
    tried = trials(problem)
    contest = Contest(retuned_rig(evidence, problem, progress, jobs), tried, jobs)
    contest.decide(progress)
    unseen = [run for run in runs if run.holdout]
    outcome = borne_out(contest, Problem(evidence.rig, unseen) if unseen else None, jobs)
    verdict = with_what_vibrates(outcome.verdict, evidence.runs)
    outcome = outcome._replace(verdict=verdict, best=verdict.named or contest.rig.fit)
    progress(f"verdict: {outcome.verdict.kind}", 0.8)
    return assembled(evidence, runs, contest, outcome, tried, began, jobs)


def with_what_vibrates(verdict: Verdict, runs: Sequence[Run]) -> Verdict:
    """What becomes of a verdict where runs vibrate as no model does: in the force signal, or at other frequencies."""
    if any(run.distortion for run in runs):
        return although_outside(verdict, PIEZO_EFFECTS)
    return although_outside(verdict) if any(run.pick_up for run in runs) else verdict
