"""What becomes of a verdict on the runs that no fit has seen."""

from typing import NamedTuple

from diagnosis.fits.fit import Fit
from diagnosis.fits.random_friction import is_random
from diagnosis.gap.problem import Problem
from diagnosis.verdict.held_out import MORE_THAN_RIGHT, HeldOut
from diagnosis.verdict.judge import Verdict, doubted, is_of_one_place
from diagnosis.verdict.selection import Contest

# Floors that the rig without effects leaves. What varies at random scatters in every run: of 15 rigs of 2 limits or more
# two left less, and showed no gap in the fitted runs; of 60 without a gap half, and one of them had been called a rough track.
_NO_GAP = 1.0


class Confirmation(NamedTuple):
    """The last word."""

    verdict: Verdict
    best: Fit  # what is named, or the rig without effects
    gone: Fit | None  # what won, and is refuted
    held_out: HeldOut | None  # the runs kept aside, if there are any


def borne_out(contest: Contest, unseen: Problem | None, jobs: int) -> Confirmation:
    """The verdict of a contest if the runs kept aside bear it out; what else is left if they refute it."""
    rig, verdict = contest.rig, contest.verdict
    best = verdict.named or rig.fit
    if unseen is None:
        return Confirmation(verdict, best, None, None)

    def on(fit: Fit) -> HeldOut:
        return HeldOut(unseen, rig.fitter.nuisances, fit, rig.fit, rig.roughness, jobs)

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
            there = on(elsewhere.named)
            if not there.refutes(elsewhere.named, expected):
                verdict, gone, best, held_out = elsewhere, None, elsewhere.named, there
    if verdict.named is not None and held_out.left_by(best) > MORE_THAN_RIGHT:
        verdict = doubted(verdict)
    return Confirmation(verdict, best, gone, held_out)
