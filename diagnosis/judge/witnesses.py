"""All witnesses of an evidence, one after the other: relations, latent friction, fits, kept runs. Time may end at any of them."""

import time
from contextlib import suppress
from typing import NamedTuple

from bridge.log.finding import Finding
from diagnosis.deadline import GRACE_S, EndedError, OutOfTimeError, limited
from diagnosis.evidence.folder import Evidence
from diagnosis.evidence.split import excerpt
from diagnosis.fits.baseline import Progress, baseline_of
from diagnosis.fits.explanations import Search
from diagnosis.fits.held_out import HeldOut
from diagnosis.gap.prepare import Prepared, prepare
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import cannot_show, trials
from diagnosis.hypotheses.hypothesis import MASS
from diagnosis.judge.judge import judge
from diagnosis.judge.ledger import Ledger, by_fits, by_latent, by_relations, explanations_of
from diagnosis.judge.relations import beyond_library, evidence_of, shown, speaking
from diagnosis.latent.answer import LatentSignal, latent_of
from diagnosis.relations.answer import Relations, relations_of
from diagnosis.relations.decide import Decision, decision_of, ruled_out
from plant.effects.library import EFFECTS

_FOR_FITS = 0.7  # share of the budget for the fits; the rest is for held-out runs, the next experiment and pictures
_LEADERS = 3  # explanations that are fitted because they lead by the linear model of the rig. More: 2 s of CPU each
_ENDED_EARLY = "ended early: the best answer so far"
NO_FIT = Finding("budget", "fits", "none was made: names and shares come from relations and friction alone")
CUT_SHORT = Finding("budget", "fits", "ended before every effect was tried: this is the best answer by then")


class Witnesses(NamedTuple):
    """The results of all stages that ended in time."""

    evidence: Evidence  # as the fits see it: long runs are excerpts
    runs: list[Prepared]  # of `evidence`
    relations: Relations = Relations((), ())
    decision: Decision = Decision((), ())
    latent: tuple[LatentSignal, ...] = ()
    comparable: bool = False  # whether any fitted run has a segment that simulated fits can compare
    search: Search | None = None  # None where no fit ended in time, or none is possible
    held_out: HeldOut | None = None  # None without held-out runs, or time for them
    until_s: float = 0.0  # of `time.monotonic`, for the stages after these
    jobs: int = 1

    @property
    def hidden(self) -> tuple[str, ...]:
        """Effects that these runs cannot show."""
        return cannot_show(self.evidence.rig, self.runs, self.evidence.assumed) if self.runs else ()


def before_fits(evidence: Evidence, jobs: int, until_s: float) -> Witnesses:
    """The runs, the relations and the latent friction, as far as they end by `until_s` of `time.monotonic`."""
    seen = Witnesses(evidence, [], until_s=until_s, jobs=jobs)
    with suppress(OutOfTimeError), limited(until_s):
        seen = seen._replace(runs=prepare(evidence))
        relations = relations_of(evidence.rig, seen.runs)
        seen = seen._replace(relations=relations, decision=decision_of(relations, evidence.rig))
        seen = seen._replace(latent=latent_of(evidence.rig, seen.runs))
        seen = seen._replace(comparable=any(run.commands.segments for run in seen.runs if not run.holdout))
    return seen


def with_fits(seen: Witnesses, progress: Progress) -> Witnesses:
    """Add fits and held-out runs, as far as they end in time. Raises Fault BAD_EVIDENCE when nothing can be compared."""
    full, rig = seen.evidence, seen.evidence.rig
    evidence = excerpt(full)
    runs = seen.runs if evidence is full else prepare(evidence)
    problem = Problem(rig, [run for run in runs if not run.holdout], seen.jobs)
    now = time.monotonic()
    problem.until_s = now + _FOR_FITS * (seen.until_s - now)
    hidden = {*cannot_show(rig, runs, evidence.assumed), *ruled_out(seen.relations, seen.decision)}
    answered = speaking(seen.relations.answered, rig)
    tried = [trial for trial in trials(problem) if not hidden & set(trial.hypothesis.effects)]
    try:
        baseline = baseline_of(problem, progress)
    except OutOfTimeError:
        progress(_ENDED_EARLY, 0.2)
        return seen
    search = Search(baseline, tried, lambda names: evidence_of(answered, names))
    seen = seen._replace(evidence=evidence, runs=runs, search=search)
    try:
        search.run(shown(answered), progress)
        for _ in range(_LEADERS):
            if not search.add(judge(ledger_of(seen)).names):
                break
    except OutOfTimeError as error:
        progress(_ENDED_EARLY, 0.75)
        if isinstance(error, EndedError):
            seen = seen._replace(until_s=min(seen.until_s, time.monotonic() + GRACE_S))
        evidence = evidence._replace(findings=(*evidence.findings, CUT_SHORT))
        seen = seen._replace(evidence=evidence)
    problem.until_s = seen.until_s
    held_out = [run for run in runs if run.holdout]
    if held_out:
        progress("the fits are compared with the held-out runs", 0.8)
        kept = Problem(rig, held_out, seen.jobs)
        kept.until_s = seen.until_s
        with suppress(OutOfTimeError):
            best = min(search.fits, key=lambda fit: fit.chi2)
            seen = seen._replace(held_out=HeldOut(kept, search.rig, best))
    return seen


def ledger_of(seen: Witnesses) -> Ledger:
    """The rows of all witnesses."""
    rig, search, held_out = seen.evidence.rig, seen.search, seen.held_out
    possible = tuple(name for name in (*EFFECTS, MASS) if name not in seen.hidden)
    answered = speaking(seen.relations.answered, rig)
    explanations = explanations_of(possible, search, answered)
    rows = [*by_relations(explanations, answered), *by_latent(seen.latent)]
    if search is not None:
        kept, features = list[float](), 0
        if held_out is not None and held_out.floor.compared.any():
            with suppress(OutOfTimeError):
                kept, features = held_out.left(search.fits), int(held_out.floor.compared.sum())
        rows += by_fits(explanations, search, kept, features)
    beyond = beyond_library(seen.relations.answered, seen.decision.outside)
    foreign = any(run.foreign for run in seen.evidence.runs)
    return Ledger(tuple(rows), possible, beyond, foreign)
