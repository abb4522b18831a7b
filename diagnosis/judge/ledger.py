"""The ledger: the log evidence of every witness for every explanation, against no effect."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

from diagnosis.fits.evidence import cost_of_freedom, of_remainder
from diagnosis.fits.explanations import Search
from diagnosis.fits.fit import NOISE, Fit
from diagnosis.judge.relations import SAME_SIZE, evidence_in
from diagnosis.latent.answer import LatentSignal
from diagnosis.model.per_run import is_phase
from diagnosis.relations.answer import Answered
from diagnosis.result import LedgerRow

Names = frozenset[str]
_FEATURES = "features"
_BEST = 4  # single effects by fits, and by relations, whose pairs are explanations in addition to the promised pairs


class Ledger(NamedTuple):
    """The rows of all witnesses."""

    rows: tuple[LedgerRow, ...]
    possible: tuple[str, ...]  # effects that the runs can show
    beyond: float  # share of the content of a relation that nothing in the library takes, 0 to 1
    foreign: bool  # whether a run has a vibration that no effect makes


def explanations_of(possible: Sequence[str], search: Search | None, answered: Sequence[Answered]) -> list[Names]:
    """Every effect, the pairs of fits and promises, and pairs of the effects that lead in fits or relations."""
    singles = [frozenset((name,)) for name in possible]
    by_relation: dict[str, float] = {}
    for each in answered:
        for cause, lost in zip(each.chosen.causes, each.lost, strict=True):
            by_relation[cause] = max(lost, by_relation.get(cause, 0.0))
    leading = set(sorted(by_relation, key=lambda name: -by_relation[name])[:_BEST])
    pairs: set[Names] = set()
    if search is not None:
        alone = {names: left for names, left in search.left.items() if len(names) == 1}
        leading |= {name for names in sorted(alone, key=lambda names: alone[names])[:_BEST] for name in names}
        pairs = {names for names in search.left if len(names) == 2}
    pairs |= {frozenset(pair) for pair in combinations(leading & set(possible), 2)}
    return [*singles, *sorted(pairs, key=sorted)]


def by_relations(explanations: Sequence[Names], answered: Sequence[Answered]) -> Iterator[LedgerRow]:
    """The rows of all relations; a chosen cause has its share of the held-out runs, and whether its size agrees."""
    for each in answered:
        shares = {} if each.shares is None else {share.cause: share for share in each.shares.causes}
        agree = dict(zip(each.chosen.causes, (chance > SAME_SIZE for chance in each.agreement), strict=True))
        for names in explanations:
            if evidence := evidence_in(each, names):
                (cause, *more) = causes = tuple(sorted(names))
                share = None if more else shares.get(cause)
                numbers = (None, None, None) if share is None else (share.share, share.interval_90, share.null_90)
                yield LedgerRow(causes, each.name, "relation", evidence, *numbers, None if more else agree.get(cause))


def by_latent(latent: Sequence[LatentSignal]) -> Iterator[LedgerRow]:
    """The rows of the latent friction: shares, without evidence for a formula."""
    for signal in latent:
        for share in signal.shares:
            if share.null_90 is not None:
                numbers = share.share, share.interval_90, share.null_90
                yield LedgerRow((share.what,), signal.signal, "friction", math.nan, *numbers, share.agrees)


def by_fits(explanations: Sequence[Names], search: Search, kept: Sequence[float], features: int) -> Iterator[LedgerRow]:
    """The rows of fits and of kept runs.

    Args:
        explanations: sets of effects.
        search: all fits.
        kept: chi2 of the kept runs under each fit, in the order of the fits; empty without kept runs.
        features: compared on the kept runs.

    """
    none, left, compared = search.rig.fit, search.left, len(search.rig.fit.residual)
    noise = max(min(fit.chi2 for fit in search.fits) / compared, NOISE)
    fits = {frozenset(fit.effects): fit for fit in search.fits}
    of_kept = dict(zip(fits, kept, strict=False))
    fits = {names: fit for names, fit in fits.items() if fit.chi2 <= none.chi2}  # a worse one proves nothing
    for names in (frozenset[str](), *explanations):
        # a pair without a fit or a promise is worth as much as the better of its effects
        alone = [part for name in names if (part := frozenset((name,))) in left]
        known = names if names in left else min(alone, key=lambda part: left[part], default=frozenset[str]())
        fit = fits.get(known, none)
        gained = of_remainder(left[known], compared) - of_remainder(none.chi2, compared)
        freedom = cost_of_freedom(fit, noise) - cost_of_freedom(none, noise)
        causes, fitted = tuple(sorted(names)), names in fits
        remainder = _excess(left[known], compared) if fitted else None
        yield LedgerRow(causes, _FEATURES, "fit" if fitted else "simulation", gained + freedom, left=remainder)
        if known in fits and known in of_kept:
            chi2 = of_kept[known] if _foretells(fit) else min(of_kept[known], kept[0])
            gained = of_remainder(chi2, features) - of_remainder(kept[0], features)
            remainder = _excess(chi2, features) if fitted else None
            yield LedgerRow(causes, _FEATURES, "kept runs", gained, left=remainder)


def _excess(chi2: float, features: int) -> float:
    return math.log(max(chi2, 1e-9) / (NOISE * features))


def _foretells(fit: Fit) -> bool:
    """Whether a fit predicts another run: there the phase of a wave is unknown, so a wave alone cannot be refuted."""
    return len(fit.hypothesis.effects) != 1 or not any(is_phase(axis.name) for axis in fit.hypothesis.coordinates)
