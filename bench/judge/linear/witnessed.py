"""All that the judge needs of one evidence: the fits, their remainders in fitted and kept runs, and the relations."""

from collections.abc import Sequence
from typing import NamedTuple

from bench.judge.linear.evidence import NOISE, cost_of_freedom, of_remainder
from bench.judge.linear.explanations import moved_by, nothing_again, pairs_of, singles_of
from bench.judge.linear.kept import left_of_kept
from bench.judge.linear.rig import fitted_rig
from bench.judge.linear.witnesses import beyond_library, evidence_of, shown, speaking
from diagnosis.evidence.run import Evidence
from diagnosis.evidence.split import excerpt
from diagnosis.fits.fit import Fit
from diagnosis.fits.refits import best_of_each
from diagnosis.gap.prepare import prepare
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import cannot_show, trials
from diagnosis.model.per_run import is_phase
from diagnosis.model.rig import Roughness
from diagnosis.relations.answer import Answered, Relations
from diagnosis.relations.decide import decision_of, ruled_out

# Pairs are tried where the best single effect leaves more than this many times a right explanation's remainder,
_MUCH_LEFT = 2.0
# and has a relation that shows it, or leaves less than this share of the remainder without effects.
_CLOSES = 0.8


class Row(NamedTuple):
    """An explanation, with the number of each witness."""

    names: frozenset[str]  # effects; empty: the rig as described, within its tolerances
    left: float  # chi2 of the fitted runs
    kept: float  # chi2 of the kept runs, predicted
    freedom: float  # logarithm of the volume that the data leave of the prior
    relations: float  # log evidence of the relations against no effect
    refitted: bool = True  # False: only promised by the columns of the rig without effects


class Ledger(NamedTuple):
    """The rows of one evidence; the first is the rig without effects."""

    rows: tuple[Row, ...]
    features: int  # compared on the fitted runs
    kept_features: int  # compared on the kept runs
    beyond: float  # share of the content of a relation that nothing in the library takes
    foreign: bool  # whether a run has a vibration that no effect makes
    surface: Roughness
    moved: dict[str, float] = {}  # numbers of the rig without effects, in tolerances


def ledger_of(full: Evidence, relations: Relations) -> Ledger:
    """Fit and predict. Raises Fault BAD_EVIDENCE where the rig as described shows none of the measured features."""
    evidence = excerpt(full)
    runs = prepare(evidence)
    decision = decision_of(relations, evidence.rig)
    answered = speaking(relations.answered, evidence.rig)
    problem = Problem(evidence.rig, [run for run in runs if not run.holdout])
    rig = fitted_rig(problem)
    hidden = {*cannot_show(evidence.rig, runs, evidence.assumed), *ruled_out(relations, decision)}
    tried = [trial for trial in trials(problem) if not hidden & set(trial.hypothesis.effects)]
    seen = shown(answered)
    moved = moved_by(rig, tried)
    promises = moved.promised(rig.fitter, rig.fit, paired=True)
    singles = singles_of(rig, promises, seen)
    nothing = nothing_again(rig, singles)
    features = len(nothing.residual)
    fits: list[Fit] = [nothing, *singles]
    for lead in sorted(singles, key=lambda fit: -_worth(fit, answered))[:1]:
        founded = lead.chi2 < _CLOSES * nothing.chi2 or evidence_of(answered, frozenset(lead.effects)) > 0.0
        if founded and lead.chi2 > _MUCH_LEFT * NOISE * features:
            fits += pairs_of(rig, moved, promises.pairs, lead, seen)
    best = min(fits, key=lambda fit: fit.chi2)
    kept, of_kept = left_of_kept(rig, runs, best, fits)
    noise = max(best.chi2 / features, NOISE)
    rows = tuple(
        Row(
            frozenset(fit.effects),
            fit.chi2,
            left if _foretells(fit) else min(left, kept[0]),
            cost_of_freedom(fit, noise),
            evidence_of(answered, frozenset(fit.effects)),
        )
        for fit, left in zip(fits, kept, strict=True)
    )
    known = {row.names for row in rows}
    rows += tuple(
        Row(names, max(start.chi2, 0.0), kept[0], rows[0].freedom, evidence_of(answered, names), refitted=False)
        for start in best_of_each([*promises.singles, *promises.pairs])
        if (names := frozenset(start.hypothesis.effects)) not in known
    )
    foreign = any(run.foreign for run in evidence.runs)
    beyond = beyond_library(relations.answered, decision.outside)
    numbers = dict(zip(rig.fitter.nuisances.names, nothing.deviations.tolist(), strict=True))
    return Ledger(rows, features, of_kept, beyond, foreign, rig.surface, numbers)


def _worth(fit: Fit, relations: Sequence[Answered]) -> float:
    """The evidence of a fit without the kept runs."""
    fitted = of_remainder(fit.chi2, len(fit.residual)) + cost_of_freedom(fit, fit.chi2 / len(fit.residual))
    return fitted + evidence_of(relations, frozenset(fit.effects))


def _foretells(fit: Fit) -> bool:
    """Whether a fit predicts another run: there the phase of a wave is unknown, so a wave alone cannot be refuted."""
    return len(fit.hypothesis.effects) != 1 or not any(is_phase(axis.name) for axis in fit.hypothesis.coordinates)
