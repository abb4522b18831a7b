"""Patterns outside the library: free functions of one variable, with a variance by marginal likelihood, and bursts."""

import math
from typing import NamedTuple

import numpy as np

from diagnosis.relations.products import BandNoise, Products, in_time, model_columns, weighted
from diagnosis.relations.relation import Floats
from diagnosis.relations.search import Found

_WINDOW_S = 0.1  # of a local variance
_SPREADS = np.geomspace(1e-3, 1e2, 26)  # of a free function, relative to the noise of a row


class Pattern(NamedTuple):
    """A free function that the relation shows in addition to the chosen causes."""

    what: str  # the variable
    evidence: float  # natural logarithm, against the chosen causes alone
    rms: float  # of the function over the rows, in the relation's unit


def patterns_of(products: Products, runs: list[int], noise: BandNoise, chosen: Found) -> tuple[Pattern, ...]:
    """Every pattern of the relation in addition to the chosen causes, fitted to `runs`; the largest evidence first."""
    whole, plain = weighted(products, runs, noise), products.values[runs].sum(axis=(0, 1))
    rows = float(products.lengths[runs].sum())
    model, spreads = model_columns(products, chosen.terms)
    patterns: list[Pattern] = []
    for term in products.relation.patterns:
        columns = products.columns((term,))
        evidence, size = _likeliest(_freed(whole, model, spreads, columns))
        # a part that the nuisances could take as well is not the pattern's
        across = plain[model[:, None], columns]
        taken = np.linalg.lstsq(plain[model[:, None], model], across)[0] if len(model) else across
        square = float(size @ (plain[columns[:, None], columns] - across.T @ taken) @ size) / max(rows, 1.0)
        patterns.append(Pattern(term.cause, evidence, math.sqrt(max(square, 0.0))))
    return tuple(sorted(patterns, key=lambda pattern: -pattern.evidence))


def _freed(whole: Floats, model: np.ndarray, spreads: Floats, columns: np.ndarray) -> Floats:
    """The products of `columns` and of the rest, less the part that the columns of the model take."""
    everything = np.append(columns, whole.shape[0] - 1)
    free = whole[everything[:, None], everything]
    if len(model) == 0:
        return free
    inner = whole[model[:, None], model] + np.diag(1.0 / spreads**2)
    scale = 1.0 / np.sqrt(np.diag(inner))
    across = scale[:, None] * whole[model[:, None], everything]
    return free - across.T @ np.linalg.solve(inner * np.outer(scale, scale), across)


def _likeliest(free: Floats) -> tuple[float, Floats]:
    """Log evidence of a free function, and its coefficients, with the spread that makes them likeliest."""
    inner, towards = free[:-1, :-1], free[:-1, -1]
    values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    values = np.maximum(values, 0.0)
    along = vectors.T @ towards
    # size of a coefficient that is one noise of a row
    typical = math.sqrt(len(towards) / max(float(values.sum()), 1e-300))
    sizes = typical * _SPREADS[:, None]
    gained = (0.5 * along**2 * sizes**2 / (1.0 + values * sizes**2) - 0.5 * np.log1p(values * sizes**2)).sum(axis=1)
    best = int(gained.argmax())
    size = vectors @ (along / (values + 1.0 / float(sizes[best, 0]) ** 2))
    return float(gained[best]) - math.log(len(_SPREADS)), size


def bursts_of(products: Products, runs: list[int], noise: BandNoise, sizes: Floats) -> float:
    """Mean over median of the local variance of the residual of `sizes`: 1 for even noise, more if a few windows hold it."""
    relation = products.relation
    length = max(round(_WINDOW_S / relation.row_s), 2)
    left, weights = np.append(-sizes, 1.0)[:, None], 1.0 / np.sqrt(noise.variance)
    local = [np.ones(1)]
    for run in runs:
        for piece in relation.pieces[run]:
            rows = in_time(relation, products.terms, run, piece, weights, left)[:, 0]
            local.append((rows[: len(rows) // length * length].reshape(-1, length) ** 2).mean(axis=1))
    values = np.concatenate(local)
    return float(values.mean() / max(float(np.median(values)), 1e-30))
