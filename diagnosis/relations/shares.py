"""Shares of a relation's residual on the held-out runs, from fits to the others, with intervals and shares by chance."""

import math
from typing import NamedTuple

import numpy as np

from diagnosis.relations.products import BandNoise, Products, in_time, model_columns, sizes_of, weighted
from diagnosis.relations.relation import Floats, Relation, Term
from diagnosis.relations.search import Found

_BLOCK_S = 0.5  # of the jackknife: longer than a slip, so that blocks are independent
_ONE_SIDED_90, _TWO_SIDED_90 = 1.282, 1.645


class RelationShare(NamedTuple):
    """Share of the mean square on the held-out runs that one cause explains."""

    cause: str
    form: str
    share: float
    interval_90: tuple[float, float]
    null_90: float  # share that noise alone would give this cause in 9 of 10
    expected: float  # share of the size that was fitted; below the null the held-out runs cannot refute it


class Shares(NamedTuple):
    """Shares of the mean square that the rig without effects, refitted on the other runs, leaves on the held-out runs."""

    causes: tuple[RelationShare, ...]
    noise: float  # share
    unexplained: float  # share
    unexplained_90: tuple[float, float]


def shares_of(
    products: Products, fitted: list[int], held_out: list[int], noise: BandNoise, chosen: Found
) -> Shares | None:
    """The shares, or None where no row was held out."""
    relation = products.relation
    blocks = _blocks(relation, (*relation.nuisances, *chosen.terms), held_out)
    if len(blocks) == 0:
        return None
    steps = [sizes_of(products, fitted, noise, chosen.terms[:count]) for count in range(len(chosen.terms) + 1)]
    width = blocks.shape[1]
    left = np.array([np.concatenate([-size, np.zeros(width - 1 - len(size)), [1.0]]) for size in steps])
    squares = np.einsum("si,bij,sj->sb", left, blocks, left)
    square = float(squares[0].sum())
    causes: list[RelationShare] = []
    for number, term in enumerate(chosen.terms):
        taken, change = squares[number] - squares[number + 1], left[number] - left[number + 1]
        null = _null(products, (fitted, held_out), noise, chosen.terms[: number + 1])
        expected = float(change @ blocks.sum(axis=0) @ change) / square
        share = float(taken.sum()) / square
        causes.append(RelationShare(term.cause, term.form, share, interval_90(taken, squares[0]), null, expected))
    least = noise.square(products, held_out)
    rest = squares[-1] - least / len(blocks)
    low, high = (max(end, 0.0) for end in interval_90(rest, squares[0]))
    return Shares(tuple(causes), min(least / square, 1.0), max(float(rest.sum()) / square, 0.0), (low, high))


def interval_90(parts: Floats, squares: Floats) -> tuple[float, float]:
    """90 % interval of sum(parts) over sum(squares), [pieces] each, by the jackknife over the pieces."""
    without = (parts.sum() - parts) / np.maximum(squares.sum() - squares, 1e-30)
    share = float(parts.sum()) / max(float(squares.sum()), 1e-30)
    half = _TWO_SIDED_90 * math.sqrt((len(parts) - 1) * float(np.var(without)))
    return share - half, share + half


def _blocks(relation: Relation, terms: tuple[Term, ...], runs: list[int]) -> Floats:
    """Inner products of the columns and the residual, for each block of 0.5 s, [blocks, columns + 1, columns + 1]."""
    length = max(round(_BLOCK_S / relation.row_s), 2)
    mask = np.concatenate([np.full(term.values[0].shape[1], term.of_run) for term in terms] + [np.zeros(1, np.bool_)])
    blocks: list[Floats] = []
    for run in runs:
        for piece in relation.pieces[run]:
            rows = in_time(relation, terms, run, piece, None)
            # the other runs do not give the coefficients of the run's own columns
            basis, _ = np.linalg.qr(rows[:, mask & rows.any(axis=0)])
            rows -= basis @ (basis.T @ rows)
            blocks += [block.T @ block for block in np.array_split(rows, max(round(len(rows) / length), 1))]
    return np.array(blocks)


def _null(products: Products, runs: tuple[list[int], list[int]], noise: BandNoise, terms: tuple[Term, ...]) -> float:
    """Share that noise alone, in the fitted and in the held-out runs, gives the last of `terms` in 9 of 10; never below 0."""
    fitted, held_out = runs
    columns, spreads = model_columns(products, terms)
    mine = products.columns(terms[-1:])
    whole = weighted(products, fitted, noise)[columns[:, None], columns] * np.outer(spreads, spreads)
    inverse = np.linalg.inv(whole + np.eye(len(columns)))[-len(mine) :]
    spread = spreads[-len(mine) :]
    covariance = (inverse[:, -len(mine) :] - inverse @ inverse.T) * np.outer(spread, spread)
    inner = products.values[held_out].sum(axis=0)[:, mine][:, :, mine]
    across, square = np.tensordot(noise.variance, inner, axes=1), inner.sum(axis=0)
    most = 2.0 * _ONE_SIDED_90 * math.sqrt(max(float(np.trace(across @ covariance)), 0.0))
    return max(most - float(np.trace(square @ covariance)), 0.0) / noise.square(products, held_out)
