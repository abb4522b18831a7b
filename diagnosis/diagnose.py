"""All steps from an evidence to a diagnosis: ask the witnesses, judge, put the answer together."""

import math
import time

from diagnosis.evidence.folder import Evidence
from diagnosis.fits.baseline import Progress
from diagnosis.judge.judge import judge
from diagnosis.judge.witnesses import before_fits, ledger_of, with_fits
from diagnosis.report.assemble import assembled
from diagnosis.report.relations_block import with_relations
from diagnosis.result import Diagnosis
from diagnosis.threads import one_thread


def diagnose(evidence: Evidence, progress: Progress, jobs: int = 1, budget_s: float | None = None) -> Diagnosis:
    """Diagnose one evidence. Without a budget the answer does not depend on `jobs`.

    Raises Fault BAD_EVIDENCE when nothing can be compared.

    Args:
        evidence: the rig as described and the measured runs.
        progress: called with a text on the state of the work, and the share that is done (0 to 1).
        jobs: threads.
        budget_s: seconds after which the best answer so far is returned; None: no limit.

    """
    began = time.monotonic()
    with one_thread():
        seen = before_fits(evidence, jobs, math.inf if budget_s is None else began + budget_s)
        if seen.comparable:
            seen = with_fits(seen, progress)
        ledger = ledger_of(seen)
        done = with_relations(assembled(seen, ledger, judge(ledger)), seen)
    progress(f"verdict: {done.verdict}", 1.0)
    return done._replace(elapsed_s=round(time.monotonic() - began, 2))
