"""A relation in frequency: inner products of all its columns by run and band, and the noise of each band by REML.

Every piece is turned by a cosine transform (DCT-II, orthonormal). There noise of any stationary spectrum is nearly independent,
so noise and its correlation are one variance a band. All that follows (evidence, sizes, shares) needs the products alone.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.fft import dct, idct
from scipy.linalg import cho_factor, cho_solve

from bridge.arrays import Indices
from diagnosis.relations.relation import Floats, Relation, Term

# Ratio of the edges of a band. Smaller: few rows a band, and its variance is uncertain. Larger: it is not white in itself.
_BAND_RATIO = 1.5
_HUM_HZ, _HUM_HALF_HZ = (50.0, 60.0), 1.0  # lines of the mains and their multiples, left out
_ROUNDS = 8  # of the fixed point of REML; it moves by less than 1 % from there
_FEWEST = 6.0  # degrees of freedom that a band needs; below, it has the variance of its neighbour


class Products(NamedTuple):
    """Inner products; the last column is the residual of the rig as described."""

    relation: Relation
    terms: tuple[Term, ...]  # nuisances, effects, patterns
    places: tuple[slice, ...]  # columns of each term
    values: Floats  # [runs, bands, columns, columns]
    rows: Floats  # [runs, bands]: number of frequencies
    lengths: Floats  # [runs]: number of rows in time

    def columns(self, terms: Sequence[Term]) -> Indices:
        """Indices of the columns of these terms."""
        places = {id(term): place for term, place in zip(self.terms, self.places, strict=True)}
        columns = (np.arange(places[id(term)].start, places[id(term)].stop) for term in terms)
        return np.concatenate([np.zeros(0, np.int64), *columns])


def products_of(relation: Relation) -> Products:
    """The products of a relation. About 0.2 s for 200 columns over four runs of 10 s."""
    terms = (*relation.nuisances, *relation.effects, *relation.patterns)
    places = places_of(terms)
    width = places[-1].stop + 1 if places else 1
    edges = band_edges_Hz(relation)
    bands = len(edges) - 1
    values = np.zeros((len(relation.left), bands, width, width))
    rows = np.zeros((len(relation.left), bands))
    lengths = np.array([sum(last - first for first, last in piece) for piece in relation.pieces], np.float64)
    for number in range(len(relation.left)):
        for first, last in relation.pieces[number]:
            band = band_of_rows(relation, last - first, edges)
            turned = turned_piece(relation, terms, number, (first, last), len(band))
            for band_number in np.unique(band[band >= 0]):
                block = turned[band == band_number]
                values[number, band_number] += block.T @ block
                rows[number, band_number] += len(block)
    return Products(relation, terms, places, values, rows, lengths)


def places_of(terms: Sequence[Term]) -> tuple[slice, ...]:
    """The columns of each term, where the terms follow one another."""
    edges = np.cumsum([0, *(term.values[0].shape[1] for term in terms)]).tolist()
    return tuple(slice(first, last) for first, last in pairwise(edges))


def spreads_of(terms: Sequence[Term]) -> Floats:
    """Standard deviations of the coefficients of these terms before the data, [columns]."""
    return np.concatenate([np.zeros(0), *(np.full(term.values[0].shape[1], term.spread) for term in terms)])


def model_columns(products: Products, terms: tuple[Term, ...]) -> tuple[Indices, Floats]:
    """Indices and spreads of the columns of the nuisances and of `terms`."""
    all_terms = (*products.relation.nuisances, *terms)
    return products.columns(all_terms), spreads_of(all_terms)


def square_left(inner: Floats, size: Floats) -> float:
    """Sum of squares that these sizes leave."""
    with_left = np.append(-size, 1.0)
    return float(with_left @ inner @ with_left)


def band_edges_Hz(relation: Relation) -> Floats:
    """Edges of the bands, [bands + 1]; the lowest holds the lowest frequency of the longest piece."""
    longest_s = max((last - first for pieces in relation.pieces for first, last in pieces), default=2) * relation.row_s
    lowest_Hz, highest_Hz = 1.5 / longest_s, min(relation.highest_Hz, 0.5 / relation.row_s)
    count = max(round(math.log(highest_Hz / lowest_Hz) / math.log(_BAND_RATIO)), 1) if highest_Hz > lowest_Hz else 1
    return np.concatenate(([0.0], np.geomspace(lowest_Hz, max(highest_Hz, 1.01 * lowest_Hz), count + 1)))


def band_of_rows(relation: Relation, length: int, edges: Floats) -> np.ndarray:
    """Band of each frequency that is used of a piece of `length` rows; -1 where it is left out."""
    frequency_Hz = np.arange(length) * (0.5 / (length * relation.row_s))
    used = int(np.searchsorted(frequency_Hz, edges[-1], side="right"))
    frequency_Hz = frequency_Hz[:used]
    band = np.clip(np.searchsorted(edges, frequency_Hz, side="right") - 1, 0, len(edges) - 2)
    if not relation.keeps_mean:
        band[:1] = -1
    if relation.row_s < 0.01:
        for mains_Hz in _HUM_HZ:
            away_Hz = np.abs(frequency_Hz - mains_Hz * np.maximum(np.round(frequency_Hz / mains_Hz), 1.0))
            band[away_Hz < _HUM_HALF_HZ] = -1
    return band


def turned_piece(relation: Relation, terms: tuple[Term, ...], run: int, piece: tuple[int, int], used: int) -> Floats:
    """The lowest `used` frequencies of a piece of all columns, [used, columns]; the last column is the residual."""
    rows = slice(*piece)
    columns = np.concatenate([*(term.values[run][rows].T for term in terms), relation.left[run][None, rows]])
    return np.asarray(dct(columns, axis=1, norm="ortho", overwrite_x=True))[:, :used].T


class BandNoise(NamedTuple):
    """Variance of a row in each band, [bands]."""

    variance: Floats

    def square(self, products: Products, runs: list[int]) -> float:
        """Sum of squares over `runs` that noise alone has."""
        return float(self.variance @ products.rows[runs].sum(axis=0))


def in_time(
    relation: Relation,
    terms: tuple[Term, ...],
    run: int,
    piece: tuple[int, int],
    weights: Floats | None,
    mix: Floats | None = None,
) -> Floats:
    """Rows of a piece in time without the frequencies that are left out, [rows, columns + 1], or `mix`ed, [rows, mixtures].

    Args:
        relation, terms: as in `turned_piece`.
        run, piece: of the relation.
        weights: factor of each band, [bands]; None: 1.
        mix: sums of the columns, [columns + 1, mixtures].

    """
    length = piece[1] - piece[0]
    edges = band_edges_Hz(relation)
    band = band_of_rows(relation, length, edges)
    turned = turned_piece(relation, terms, run, piece, len(band))
    factors = np.append(np.ones(len(edges) - 1) if weights is None else weights, 0.0)
    turned = (turned if mix is None else turned @ mix) * factors[band, None]
    return np.asarray(idct(turned, axis=0, n=length, norm="ortho"))


def weighted(products: Products, runs: list[int], noise: BandNoise) -> Floats:
    """The products over `runs` in units of the noise, [columns, columns]."""
    over = products.values[runs].sum(axis=0)
    return np.tensordot(1.0 / noise.variance, over, axes=1)


def sizes_of(products: Products, runs: list[int], noise: BandNoise, terms: tuple[Term, ...]) -> Floats:
    """Coefficients of the nuisances and of `terms`, fitted to `runs`."""
    columns, spreads = model_columns(products, terms)
    whole = weighted(products, runs, noise)
    inner = whole[columns[:, None], columns] * np.outer(spreads, spreads) + np.eye(len(columns))
    return spreads * np.linalg.solve(inner, whole[columns, -1] * spreads)


def noise_of(products: Products, runs: list[int], columns: np.ndarray, spreads: Floats) -> BandNoise:
    """Noise by REML: the variance that a band has after these columns, less the freedom that they take in it.

    Args:
        products: of the relation.
        runs: indices of the runs.
        columns: indices of the columns that the model has.
        spreads: standard deviation of each of their coefficients before the data; infinite where it is free.

    """
    over = products.values[runs].sum(axis=0)
    rows = products.rows[runs].sum(axis=0)
    inner = over[:, columns][:, :, columns]
    towards = over[:, columns, -1]
    square = over[:, -1, -1]
    least = products.relation.resolution**2
    variance = np.maximum(square / np.maximum(rows, 1.0), least)
    for _ in range(_ROUNDS):
        whole = np.tensordot(1.0 / variance, inner, axes=1) + np.diag(1.0 / spreads**2)
        scale = 1.0 / np.sqrt(np.diag(whole) + 1e-300)
        factor = cho_factor(whole * np.outer(scale, scale) + 1e-12 * np.eye(len(scale)))
        inverse = cho_solve(factor, np.eye(len(scale))) * np.outer(scale, scale)
        size = inverse @ (towards.T @ (1.0 / variance))
        rest = square - 2.0 * towards @ size + np.einsum("bij,i,j->b", inner, size, size)
        freedom = rows - np.einsum("bij,ij->b", inner, inverse) / variance
        variance = np.maximum(_filled(rest, freedom), least)
    return BandNoise(variance)


def _filled(rest: Floats, freedom: Floats) -> Floats:
    """Variance of each band; a band of too few rows takes its nearest neighbour's."""
    enough = np.flatnonzero(freedom >= _FEWEST)
    if len(enough) == 0:
        return np.full(len(rest), max(float(rest.sum()), 0.0) / max(float(freedom.sum()), 1.0))
    nearest = enough[np.abs(np.arange(len(rest))[:, None] - enough).argmin(axis=1)]
    return np.maximum(rest, 0.0)[nearest] / freedom[nearest]
