"""The whole way from an evidence to a diagnosis.

Search the relations between channels, fit the baseline, look for a gap, find the effects, check them on held-out runs and against
the relations, put the answer together.
"""

import time
from collections.abc import Sequence

from diagnosis.evidence.folder import Evidence, Run
from diagnosis.fits.retuning import retuned_rig
from diagnosis.gap.prepare import prepare
from diagnosis.gap.problem import PIEZO_EFFECTS, Problem
from diagnosis.hypotheses.trials import trials
from diagnosis.processes import one_thread
from diagnosis.relations.answer import relations_of
from diagnosis.relations.decide import decision_of
from diagnosis.report.assemble import assembled
from diagnosis.report.relations_block import in_a_line, with_relations
from diagnosis.result import Diagnosis
from diagnosis.verdict.by_relations import Closed, in_view_of
from diagnosis.verdict.confirmation import borne_out
from diagnosis.verdict.judge import Verdict, although_outside
from diagnosis.verdict.selection import Contest, Progress


def diagnose(evidence: Evidence, progress: Progress, jobs: int = 1) -> Diagnosis:
    """Diagnose one evidence. The answer does not depend on `jobs`.

    Raises Fault BAD_EVIDENCE when nothing can be compared.

    Args:
        evidence: the rig as described and the measured runs.
        progress: called with a text on the state of the work, and the share that is done (0 to 1).
        jobs: processes.

    """
    with one_thread():
        return _diagnosed(evidence, progress, jobs)


def _diagnosed(evidence: Evidence, progress: Progress, jobs: int) -> Diagnosis:
    began = time.monotonic()
    runs = prepare(evidence)
    relations = relations_of(evidence.rig, runs)
    decision = decision_of(relations)
    if told := in_a_line(decision):
        progress(told, 0.02)
    problem = Problem(evidence.rig, [run for run in runs if not run.holdout])
    tried = trials(problem)
    contest = Contest(retuned_rig(evidence, problem, progress, jobs), tried, jobs)
    contest.decide(progress)
    held_out = [run for run in runs if run.holdout]
    outcome = borne_out(contest, Problem(evidence.rig, held_out) if held_out else None, jobs)
    nearest = outcome.gone or outcome.verdict.runner_up
    closes = (
        outcome.held_out.closed_by(nearest).shrinkage if outcome.held_out is not None and nearest is not None else None
    )
    verdict = in_view_of(outcome.verdict, decision, [*contest.singles, *contest.pairs], Closed(nearest, closes))
    verdict = with_vibration_findings(verdict, evidence.runs)
    outcome = outcome._replace(verdict=verdict, best=verdict.named or contest.rig.fit)
    progress(f"verdict: {outcome.verdict.kind}", 0.8)
    done = assembled(evidence, runs, contest, outcome, tried, began, jobs)
    return with_relations(done, evidence.rig, runs, relations, decision)


def with_vibration_findings(verdict: Verdict, runs: Sequence[Run]) -> Verdict:
    """The verdict in view of vibration that no model makes: in the force signal, or of the base at other frequencies.

    With such a vibration, "no gap" becomes "unexplained"; with a base at other frequencies, so does an effect of the piezo alone.

    Args:
        verdict: from the features, which do not show such vibration.
        runs: all runs of the evidence.

    """
    if any(run.distortion for run in runs):
        return although_outside(verdict, PIEZO_EFFECTS)
    return although_outside(verdict) if any(run.pick_up for run in runs) else verdict
