"""Shares of what a relation shows on the held-out runs, from fits to the others, with intervals and what chance would show."""

from typing import NamedTuple

import numpy as np

from diagnosis.relations.products import (
    BandNoise,
    Products,
    band_edges_Hz,
    band_of_rows,
    model_columns,
    square_left,
    turned_back,
    turned_piece,
    weighted,
)
from diagnosis.relations.relation import Floats, Relation, Term
from diagnosis.relations.search import Found

_BLOCK_S = 0.5  # of the bootstrap: longer than a slip, so that blocks are independent
_DRAWS = 400  # of blocks and sizes, for an interval
_LEVELS = (0.05, 0.95)  # ends of a 90 % interval


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
    steps = [_model(products, fitted, noise, chosen.terms[:count]) for count in range(len(chosen.terms) + 1)]
    width = blocks.shape[1]
    total = blocks.sum(axis=0)
    least = noise.square(products, held_out)
    squares = [square_left(total, _padded(step.size, width)) for step in steps]
    random = np.random.default_rng(1)
    drawn = random.multinomial(len(blocks), np.full(len(blocks), 1.0 / len(blocks)), _DRAWS)
    resampled = np.tensordot(drawn, blocks, axes=1)
    nuisances = len(steps[0].size)
    ways: list[Floats] = []
    for step in steps:
        sizes = step.drawn(random, _DRAWS, len(step.size) - nuisances)
        left = np.hstack([-sizes, np.zeros((_DRAWS, width - 1 - sizes.shape[1])), np.ones((_DRAWS, 1))])
        ways.append(np.einsum("di,dij,dj->d", left, resampled, left))
    causes: list[RelationShare] = []
    for number, term in enumerate(chosen.terms):
        share = (ways[number] - ways[number + 1]) / ways[0]
        low, high = np.quantile(share, _LEVELS)
        null = _null(products, held_out, noise, steps[number + 1], term)
        change = _padded(steps[number + 1].size, width) - _padded(steps[number].size, width)
        causes.append(
            RelationShare(
                term.cause,
                term.form,
                (squares[number] - squares[number + 1]) / squares[0],
                (float(low), float(high)),
                null,
                float(change @ total[:-1, :-1] @ change) / squares[0],
            )
        )
    rest = np.maximum(ways[-1] - least, 0.0) / ways[0]
    low, high = np.quantile(rest, _LEVELS)
    unexplained = max(squares[-1] - least, 0.0) / squares[0]
    return Shares(tuple(causes), min(least / squares[0], 1.0), unexplained, (float(low), float(high)))


class _Model(NamedTuple):
    size: Floats  # of all coefficients, nuisances first
    root: Floats  # of their covariance
    chance: Floats  # root of the covariance of what noise alone gives them

    def drawn(self, random: np.random.Generator, count: int, effects: int) -> Floats:
        """Sizes where the last `effects` are drawn and the nuisances follow, [draws, coefficients]."""
        if effects == 0:
            return np.tile(self.size, (count, 1))
        covariance = self.root @ self.root.T
        block = covariance[-effects:, -effects:]
        moved = random.standard_normal((count, effects)) @ np.linalg.cholesky(block).T
        return self.size + moved @ np.linalg.solve(block, covariance[-effects:])


def _model(products: Products, runs: list[int], noise: BandNoise, terms: tuple[Term, ...]) -> _Model:
    columns, spreads = model_columns(products, terms)
    if len(columns) == 0:
        return _Model(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)))
    whole = weighted(products, runs, noise)
    inner = whole[columns[:, None], columns] * np.outer(spreads, spreads) + np.eye(len(columns))
    values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    size = vectors @ ((vectors.T @ (whole[columns, -1] * spreads)) / values)
    chance = np.sqrt(np.maximum(values - 1.0, 0.0)) / values
    return _Model(size * spreads, spreads[:, None] * vectors / np.sqrt(values), spreads[:, None] * vectors * chance)


def sizes_of(products: Products, runs: list[int], noise: BandNoise, terms: tuple[Term, ...]) -> tuple[Floats, Floats]:
    """Coefficients of the nuisances and of `terms`, and their standard deviations, fitted to `runs`."""
    model = _model(products, runs, noise, terms)
    return model.size, np.sqrt((model.root**2).sum(axis=1))


def _blocks(relation: Relation, terms: tuple[Term, ...], runs: list[int]) -> Floats:
    """Inner products of the columns and what is left, for each block of 0.5 s, [blocks, columns + 1, columns + 1]."""
    edges = band_edges_Hz(relation)
    length = max(round(_BLOCK_S / relation.row_s), 2)
    mask = np.concatenate([np.full(term.values[0].shape[1], term.of_run) for term in terms] + [np.zeros(1, np.bool_)])
    blocks: list[Floats] = []
    for run in runs:
        for piece in relation.pieces[run]:
            band = band_of_rows(relation, piece[1] - piece[0], edges)
            turned = turned_piece(relation, terms, run, piece, len(band)) * (band >= 0)[:, None]
            turned = _without_own(turned, mask)
            rows = turned_back(turned, piece[1] - piece[0])
            cuts = np.arange(0, len(rows), length)
            cuts = cuts[:-1] if len(cuts) > 1 and len(rows) - cuts[-1] < length // 2 else cuts
            blocks += [block.T @ block for block in np.split(rows, cuts[1:])]
    return np.array(blocks)


def _without_own(turned: Floats, mask: np.ndarray) -> Floats:
    """All columns less what the run's own columns take of them: the other runs do not tell their coefficients."""
    basis = turned[:, mask]
    basis = basis[:, np.abs(basis).max(axis=0, initial=0.0) > 0.0]
    if basis.shape[1] == 0:
        return turned
    basis, _ = np.linalg.qr(basis)
    return turned - basis @ (basis.T @ turned)


def _padded(size: Floats, width: int) -> Floats:
    return np.concatenate([size, np.zeros(width - 1 - len(size))])


def _null(products: Products, held_out: list[int], noise: BandNoise, model: _Model, term: Term) -> float:
    """Share that noise alone gives a cause in 9 of 10 draws; never below 0."""
    columns_of_term = products.columns((term,))
    inner = products.values[held_out].sum(axis=0)[:, columns_of_term][:, :, columns_of_term]
    root = model.chance[len(model.size) - len(columns_of_term) :]
    random = np.random.default_rng(2)
    size = random.standard_normal((_DRAWS, root.shape[1])) @ root.T
    plain = inner.sum(axis=0)
    apart = np.tensordot(noise.variance, inner, axes=1)
    square = np.einsum("di,ij,dj->d", size, plain, size)
    across = np.sqrt(np.maximum(np.einsum("di,ij,dj->d", size, apart, size), 0.0)) * random.standard_normal(_DRAWS)
    total = noise.square(products, held_out)
    return max(float(np.quantile((2.0 * across - square) / total, 0.9)), 0.0)
