"""Shortening of long records before simulation: the hundredth slip adds little to a fit and costs as much as the first."""

from bridge.log.finding import Finding
from diagnosis.evidence.run import Evidence, MeasuredRun
from diagnosis.evidence.split import cut

# Total simulated time of the fitted and of the held-out runs. Less: few slips. More: minutes of work.
_FITTED_S, _HELD_OUT_S = 60.0, 30.0
_SHORTEST_S = 5.0  # shortest simulated time of a run


def excerpt(evidence: Evidence) -> Evidence:
    """The evidence with every run shortened by the same share if their sum is too long, and a finding about it."""
    allowed = {
        holdout: most_s / max(sum(_seconds(run) for run in evidence.runs if run.holdout == holdout), most_s)
        for holdout, most_s in ((False, _FITTED_S), (True, _HELD_OUT_S))
    }
    if min(allowed.values()) == 1.0:
        return evidence
    runs = tuple(
        run if allowed[run.holdout] == 1.0 else cut(run, 0.0, max(_seconds(run) * allowed[run.holdout], _SHORTEST_S))
        for run in evidence.runs
    )
    kept_s, total_s = (sum(_seconds(run) for run in group) for group in (runs, evidence.runs))
    text = f"{kept_s:.3g} of {total_s:.4g} s are simulated, from the start of every run; relations and shares use all of it"
    return evidence._replace(runs=runs, findings=(*evidence.findings, Finding("excerpt", "fits", text)))


def _seconds(run: MeasuredRun) -> float:
    return float(run.t_s[-1] - run.t_s[0])
