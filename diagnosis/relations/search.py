"""Exact search: the evidence of every single cause, pair and triple of a relation, from its products alone."""

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np

from diagnosis.relations.products import BandNoise, Products, model_columns, places_of, spreads_of, weighted
from diagnosis.relations.relation import Floats, Term

_TRIED_TOGETHER = 40  # terms of which all pairs are tried


class Reduced(NamedTuple):
    """Products of the terms that are searched, freed of the nuisances and scaled by the spreads of their coefficients.

    A last column of zeros means "no column", so that sets of different numbers of columns are one array.
    """

    terms: tuple[Term, ...]
    places: tuple[slice, ...]
    inner: Floats  # [columns + 1, columns + 1]
    towards: Floats  # [columns + 1]
    spreads: Floats  # [columns + 1]


class Found(NamedTuple):
    """A set of terms with its log evidence against the nuisances alone, and the sizes of its columns."""

    terms: tuple[Term, ...]
    evidence: float
    sizes: tuple[Floats, ...]  # of each term, [columns of the term]
    deviations: tuple[Floats, ...]  # standard deviations of the sizes

    @property
    def causes(self) -> tuple[str, ...]:
        """Names, in the order of the terms."""
        return tuple(term.cause for term in self.terms)


NOTHING = Found((), 0.0, (), ())


def reduced(products: Products, runs: list[int], noise: BandNoise, terms: tuple[Term, ...]) -> Reduced:
    """The products over `runs` of `terms`, freed of the nuisances of the relation."""
    whole = weighted(products, runs, noise)
    columns, spreads = products.columns(terms), spreads_of(terms)
    nuisance, nuisance_spreads = model_columns(products, ())
    prior = np.diag(1.0 / nuisance_spreads**2)
    left = np.append(columns, whole.shape[0] - 1)
    across = whole[nuisance[:, None], left]
    free = whole[left[:, None], left]
    if len(nuisance):
        inner = whole[nuisance[:, None], nuisance] + prior
        scale = 1.0 / np.sqrt(np.diag(inner))
        free = free - across.T @ (
            scale[:, None] * np.linalg.solve(inner * np.outer(scale, scale), scale[:, None] * across)
        )
    count = len(columns)
    inner, towards = np.zeros((count + 1, count + 1)), np.zeros(count + 1)
    inner[:count, :count] = free[:count, :count] * np.outer(spreads, spreads)
    towards[:count] = free[:count, -1] * spreads
    return Reduced(terms, places_of(terms), inner, towards, np.append(spreads, 1.0))


def evidences(data: Reduced, sets: list[tuple[int, ...]]) -> Floats:
    """Log evidence of each set of terms, [sets]; minus infinity where a coefficient has a sign that its mechanism forbids."""
    if not sets:
        return np.zeros(0)
    widest = max(place.stop - place.start for place in data.places)
    none = len(data.towards) - 1
    padded = np.full((len(data.terms), widest), none)
    for number, place in enumerate(data.places):
        padded[number, : place.stop - place.start] = np.arange(place.start, place.stop)
    chosen = padded[np.array(sets)].reshape(len(sets), -1)
    inner = data.inner[chosen[:, :, None], chosen[:, None, :]] + np.eye(chosen.shape[1])
    towards = data.towards[chosen]
    size = np.linalg.solve(inner, towards[:, :, None])[:, :, 0]
    _, volume = np.linalg.slogdet(inner)
    gained = 0.5 * np.einsum("si,si->s", size, towards) - 0.5 * volume
    signs = np.array([term.sign for term in data.terms])
    wanted = np.repeat(signs[np.array(sets)], widest, axis=1)
    return np.where((wanted * size < 0.0).any(axis=1), -np.inf, gained)


def found_of(data: Reduced, chosen: tuple[int, ...]) -> Found:
    """One set with its sizes."""
    columns = np.concatenate([np.arange(data.places[i].start, data.places[i].stop) for i in chosen])
    inverse = np.linalg.inv(data.inner[columns[:, None], columns] + np.eye(len(columns)))
    size = inverse @ data.towards[columns] * data.spreads[columns]
    deviation = np.sqrt(np.diag(inverse)) * data.spreads[columns]
    ends = np.cumsum([data.places[i].stop - data.places[i].start for i in chosen])[:-1]
    return Found(
        tuple(data.terms[i] for i in chosen),
        float(evidences(data, [chosen])[0]),
        tuple(np.split(size, ends)),
        tuple(np.split(deviation, ends)),
    )


class Ranking(NamedTuple):
    """The best term of every cause, and the best set of each size; evidence as log against the nuisances alone."""

    singles: tuple[Found, ...]  # the best form of each cause, the largest evidence first
    best: tuple[Found, ...]  # the best set of one, of two and of three causes


def ranked(data: Reduced) -> Ranking:
    """All single terms, all pairs of the best 40, and the best pair with any third, of different causes each."""
    if not data.terms:
        return Ranking((), ())
    alone = evidences(data, [(i,) for i in range(len(data.terms))])
    order = [int(i) for i in np.argsort(-alone)]
    singles: dict[str, int] = {}
    for i in order:
        singles.setdefault(data.terms[i].cause, i)
    best: list[tuple[int, ...]] = [(order[0],)]
    leading = list(dict.fromkeys([*singles.values(), *order]))[:_TRIED_TOGETHER]
    for sets in (combinations(leading, 2), ((*best[-1], i) for i in order)):
        differ = [subset for subset in sets if len({data.terms[i].cause for i in subset}) == len(subset)]
        if differ:
            best.append(differ[int(evidences(data, differ).argmax())])
    return Ranking(
        tuple(found_of(data, (i,)) for i in singles.values()), tuple(found_of(data, subset) for subset in best)
    )


def without_each(data: Reduced, chosen: Found) -> tuple[float, ...]:
    """Log evidence by which a set is worse without each of its terms."""
    numbers = [next(i for i, term in enumerate(data.terms) if term is chosen_term) for chosen_term in chosen.terms]
    lost: list[float] = []
    for number in numbers:
        others = tuple(other for other in numbers if other != number)
        without = float(evidences(data, [others])[0]) if others else 0.0
        lost.append(chosen.evidence - max(without, 0.0) if math.isfinite(without) else chosen.evidence)
    return tuple(lost)


def chosen_of(ranking: Ranking, cost: float) -> Found:
    """The set whose evidence pays `cost` for each cause; nothing where none does."""
    best, value = NOTHING, 0.0
    for candidate in ranking.best:
        evidence = candidate.evidence - cost * len(candidate.terms)
        if evidence > value and math.isfinite(evidence):
            best, value = candidate, evidence
    return best
