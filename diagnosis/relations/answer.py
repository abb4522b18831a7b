"""All relations of an evidence: residual, causes and unexplained patterns of each."""

import math
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from diagnosis.evidence.manifest import RigTable
from diagnosis.gap.prepare import Prepared
from diagnosis.relations.base import base_relation
from diagnosis.relations.drive import drive_relation
from diagnosis.relations.exciter import exciter_relation
from diagnosis.relations.motion import motion_relation
from diagnosis.relations.outside import Pattern, bursts_of, patterns_of
from diagnosis.relations.products import (
    BandNoise,
    Products,
    in_time,
    model_columns,
    noise_of,
    products_of,
    sizes_of,
    spreads_of,
    square_left,
)
from diagnosis.relations.relation import Floats, Missing, Relation, thinned
from diagnosis.relations.search import NOTHING, Found, Ranking, chosen_of, ranked, reduced, without_each
from diagnosis.relations.shares import Shares, shares_of
from diagnosis.relations.spring import spring_relation

_FREE = 30.0  # spread of a pattern's coefficients, in rms of the residual: as good as free
_SAME_SIZE = 0.1  # relative scatter of a size between runs that a formula close to the rig's makes


class Trace(NamedTuple):
    """One run of a relation in time, for a picture: the residual without and with the chosen causes, [rows]."""

    run: int
    t_s: Floats
    without: Floats
    with_causes: Floats


class Answered(NamedTuple):
    """One relation, searched. Sizes are rms of a row on the fitted runs, in the relation's unit."""

    name: str
    unit: str
    noise: float  # of the freest model
    described: float  # that the rig as described leaves
    refitted: float  # that the rig without effects leaves, refitted
    left: float  # with the chosen causes
    chosen: Found
    agreement: tuple[float, ...]  # of each chosen cause: chance of sizes in the runs as far apart, if they are one size
    lost: tuple[float, ...]  # of each chosen cause: log evidence by which the set is worse without it
    tried: int  # columns of effects
    ranking: Ranking
    patterns: tuple[Pattern, ...]
    bursts: float  # mean over median of the local variance of the residual
    shares: Shares | None
    trace: Trace


class Relations(NamedTuple):
    """The relations of an evidence, and those that its channels do not allow."""

    answered: tuple[Answered, ...]
    missing: tuple[Missing, ...]


def relations_of(rig: RigTable, runs: list[Prepared]) -> Relations:
    """Search every relation that the channels allow; fitted to the runs that are not held out."""
    built = (
        spring_relation(rig, runs),
        motion_relation(rig, runs),
        drive_relation(rig, runs),
        exciter_relation(runs),
        base_relation(rig, runs),
    )
    fitted = [i for i, run in enumerate(runs) if not run.holdout]
    return Relations(
        tuple(answered_of(thinned(relation), fitted) for relation in built if isinstance(relation, Relation)),
        tuple(relation for relation in built if isinstance(relation, Missing)),
    )


def answered_of(relation: Relation, fitted: list[int]) -> Answered:
    """One relation, searched on the runs `fitted` (indices) and judged on the others."""
    products = products_of(relation)
    held_out = [i for i in range(len(relation.left)) if i not in fitted and relation.pieces[i]]
    fitted = [i for i in fitted if relation.pieces[i]]
    rows = float(products.lengths[fitted].sum())
    bare = products.values[fitted].sum(axis=(0, 1))
    width = bare.shape[0] - 1
    described = _rms(bare, np.zeros(width), rows)
    spreads = spreads_of(products.terms)
    as_free = _FREE * max(described, relation.resolution)
    free = noise_of(products, fitted, np.arange(width), np.where(np.isfinite(spreads), spreads, as_free))
    chosen, noise = NOTHING, noise_of(products, fitted, *model_columns(products, ()))
    ranking, lost = Ranking((), ()), ()
    if relation.effects:
        # the search has the noise of the freest model; its choice is then judged by the noise that the choice leaves
        cost = math.log(len(relation.effects) + 1)
        chosen = chosen_of(ranked(reduced(products, fitted, free, relation.effects)), cost)
        noise = noise_of(products, fitted, *model_columns(products, chosen.terms))
        data = reduced(products, fitted, noise, relation.effects)
        ranking = ranked(data)
        chosen = chosen_of(ranking, cost)
        lost = without_each(data, chosen)
    size = sizes_of(products, fitted, noise, chosen.terms)
    without, every = np.zeros(width), np.zeros(width)
    without[model_columns(products, ())[0]] = sizes_of(products, fitted, noise, ())
    every[model_columns(products, chosen.terms)[0]] = size
    return Answered(
        name=relation.name,
        unit=relation.unit,
        noise=math.sqrt(free.square(products, fitted) / rows),
        described=described,
        refitted=_rms(bare, without, rows),
        left=_rms(bare, every, rows),
        chosen=chosen,
        agreement=tuple(_agreement(products, fitted, noise, chosen, number) for number in range(len(chosen.terms))),
        lost=lost,
        tried=len(relation.effects),
        ranking=ranking,
        patterns=patterns_of(products, fitted, noise, chosen),
        bursts=bursts_of(products, fitted, free, every),
        shares=shares_of(products, fitted, held_out, noise, chosen),
        trace=_trace(products, (held_out or fitted)[0], without, every),
    )


def _rms(bare: Floats, size: Floats, rows: float) -> float:
    return math.sqrt(max(square_left(bare, size), 0.0) / rows)


def _agreement(products: Products, runs: list[int], noise: BandNoise, chosen: Found, number: int) -> float:
    """Chance that the sizes of one chosen cause in each run alone differ as much as they do where they are one size."""
    columns, _ = model_columns(products, chosen.terms)
    size = sizes_of(products, runs, noise, chosen.terms)
    first = len(size) - sum(len(size) for size in chosen.sizes[number:])
    term_columns = slice(first, first + len(chosen.sizes[number]))
    others = size.copy()
    others[term_columns] = 0.0
    mine = size - others
    intervals: list[tuple[float, float]] = []
    for run in runs:
        over = np.tensordot(1.0 / noise.variance, products.values[run], axes=1)
        inner = over[columns[:, None], columns]
        information = float(mine @ inner @ mine)
        towards = float(mine @ (over[columns, -1] - inner @ others))
        if information > 0.0:
            intervals.append((towards / information, 1.0 / information))
    if len(intervals) < 2:
        return 1.0
    value, variance = np.array(intervals).T
    weight = 1.0 / (variance + _SAME_SIZE**2)
    mean = float(weight @ value / weight.sum())
    return float(chi2.sf(float(weight @ (value - mean) ** 2), len(value) - 1))


def _trace(products: Products, run: int, without: Floats, with_causes: Floats) -> Trace:
    relation = products.relation
    piece = max(relation.pieces[run], key=lambda piece: piece[1] - piece[0])
    left = np.stack([np.append(-sizes, 1.0) for sizes in (without, with_causes)], axis=1)
    rows = in_time(relation, products.terms, run, piece, None, left)
    return Trace(run, (np.arange(*piece) + 0.5) * relation.row_s, rows[:, 0], rows[:, 1])
