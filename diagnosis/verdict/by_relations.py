"""A verdict of the contest in view of the relations, which decide what they can."""

from collections.abc import Sequence

from diagnosis.fits.fit import Fit
from diagnosis.fits.random_friction import is_random
from diagnosis.relations.decide import SHOWN_BY, Decided, Decision
from diagnosis.verdict.judge import Verdict
from diagnosis.verdict.probabilities import swapped

# Share of a relation on the held-out runs from which a known cause counts although something outside the library acts as well.
_MOST = 0.5
_LEAST_CLOSED = 0.5  # share of the held-out gap that two effects must close to stay named where they leave much
# Effects that act in one relation alone: beside a cause that this relation names they are not there.
_SEEN = SHOWN_BY | dict.fromkeys(("piezo-roll-off", "piezo-resonance", "piezo-sag"), "exciter")


def with_relations_verdict(
    verdict: Verdict, decision: Decision, fits: Sequence[Fit], nearest: Fit | None, closes: float | None
) -> Verdict:
    """The verdict of the contest, corrected by the relations.

    Args:
        verdict: of the contest, after the held-out runs.
        decision: what the relations decide.
        fits: the best fit of each single effect and of each pair.
        nearest: the best explanation of a contest that ended unexplained.
        closes: share of the held-out gap that it closes.

    """
    known = [cause for cause in decision.decided if cause.known]
    if decision.outside:
        held = [cause for cause in known if cause.share is not None and cause.share.share > _MOST]
        if held and decision.outside[0].relation == held[0].relation:
            return _named(verdict, "partly", held[:2], fits)
        return _unexplained(verdict)
    if known:
        return _with_known(verdict, known, fits)
    if verdict.kind == "unexplained" and nearest is not None and closes is not None and closes >= _LEAST_CLOSED:
        hypothesis = nearest.hypothesis
        is_pair = len(hypothesis.effects) > 1 and not is_random(hypothesis)
        if is_pair and not set(hypothesis.effects) & set(verdict.refuted):
            return verdict._replace(kind="partly", named=nearest)
    return verdict


def _with_known(verdict: Verdict, known: list[Decided], fits: Sequence[Fit]) -> Verdict:
    """The verdict where relations name effects of the library and leave nothing outside."""
    names = list(dict.fromkeys(cause.cause for cause in known))
    alike = {other for cause in known for other in cause.alike}
    if verdict.kind in ("effect", "partly") and verdict.named is not None:
        named = verdict.named.hypothesis.effects
        if set(names) <= set(named) or (len(names) == 1 and alike & set(named)):
            return verdict
        seen = {effect for effect, relation in _SEEN.items() if relation in {cause.relation for cause in known}}
        kept = [name for name in named if name not in seen and name not in names]
        if not kept:
            return _named(verdict, "effect", known[:2], fits)
        both = (names[0], kept[0])
        return _with_names(verdict, "effect", both, fits)
    return _named(verdict, "partly" if verdict.kind == "unexplained" else "effect", known[:2], fits)


def _named(verdict: Verdict, kind: str, causes: list[Decided], fits: Sequence[Fit]) -> Verdict:
    return _with_names(verdict, kind, tuple(dict.fromkeys(cause.cause for cause in causes)), fits)


def _with_names(verdict: Verdict, kind: str, names: tuple[str, ...], fits: Sequence[Fit]) -> Verdict:
    fit_of_names = next((fit for fit in fits if set(fit.hypothesis.effects) == set(names)), None)
    probabilities = swapped(verdict.probabilities, next(iter(verdict.probabilities)), names[0])
    # a name without a fit has no size that a rig file could take, and no gap that it closes
    return verdict._replace(
        kind="effect" if kind == "effect" and fit_of_names is not None else "partly",
        named=fit_of_names,
        by_relations=() if fit_of_names is not None else names,
        probabilities=probabilities,
        refuted=(),
    )


def _unexplained(verdict: Verdict) -> Verdict:
    probabilities = swapped(verdict.probabilities, next(iter(verdict.probabilities)), "unexplained")
    return verdict._replace(
        kind="unexplained", named=None, runner_up=verdict.named or verdict.runner_up, probabilities=probabilities
    )
