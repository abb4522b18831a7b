"""Whether the held-out runs, which no fit has seen, confirm a verdict."""

from typing import NamedTuple

from diagnosis.fits.fit import Fit
from diagnosis.fits.random_friction import is_random
from diagnosis.gap.problem import Problem
from diagnosis.verdict.held_out import MORE_THAN_RIGHT, HeldOut
from diagnosis.verdict.judge import Verdict, doubted, is_of_one_place
from diagnosis.verdict.selection import Contest

# Noise floors that the baseline leaves on the held-out runs: up to here a random effect is not named, as it scatters in every
# run. Too small: chance scatter in the fitted runs is named. Too large: weak random effects are lost.
# Counted: docs/method/diagnosis.md.
_NO_GAP = 1.0


class Confirmation(NamedTuple):
    """The final verdict, after a look at the held-out runs."""

    verdict: Verdict
    best: Fit  # the named fit, or the baseline
    gone: Fit | None  # the fit that had won, if the held-out runs refute it
    held_out: HeldOut | None  # None where the evidence holds out no run


def borne_out(contest: Contest, held_out_problem: Problem | None, jobs: int) -> Confirmation:
    """The verdict of a contest if the held-out runs confirm it, otherwise the verdict that remains.

    Args:
        contest: what was fitted, and the verdict over it.
        held_out_problem: the problem of the held-out runs; None keeps the verdict.
        jobs: processes.

    """
    rig, verdict = contest.rig, contest.verdict
    best = verdict.named or rig.fit
    if held_out_problem is None:
        return Confirmation(verdict, best, None, None)

    def on(fit: Fit) -> HeldOut:
        return HeldOut(held_out_problem, rig.fitter.nuisances, fit, rig.fit, rig.roughness, jobs)

    expected = rig.expected_chi2 / len(rig.fit.residual)
    held_out, gone = on(best), None
    if is_random(best.hypothesis) and held_out.retuned <= _NO_GAP:
        verdict = contest.without_random()
        best = verdict.named or rig.fit
        held_out = on(best)
    if verdict.named is not None and held_out.refutes(best, expected):
        verdict, gone, best = contest.refuted(), best, rig.fit
        elsewhere = contest.elsewhere() if is_of_one_place(gone) else None
        if elsewhere is not None and elsewhere.named is not None:
            judged_there = on(elsewhere.named)
            if not judged_there.refutes(elsewhere.named, expected):
                verdict, gone, best, held_out = elsewhere, None, elsewhere.named, judged_there
    if verdict.named is not None and held_out.left_by(best) > MORE_THAN_RIGHT:
        verdict = doubted(verdict)
    return Confirmation(verdict, best, gone, held_out)
