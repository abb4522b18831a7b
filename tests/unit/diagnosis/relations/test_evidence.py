"""The products give the exact evidence, and the noise of each band is that which was drawn."""

import math
from itertools import combinations

import numpy as np
import pytest

from diagnosis.relations.products import BandNoise, noise_of, products_of
from diagnosis.relations.relation import Relation, term
from diagnosis.relations.search import evidences, ranked, reduced
from diagnosis.relations.shares import model_columns

ROWS = 400


def made(noise: float = 1.0, seed: int = 3) -> Relation:
    random = np.random.default_rng(seed)
    columns = [np.cumsum(random.standard_normal(ROWS)) for _ in range(4)]
    left = 0.4 * columns[1] - 0.2 * columns[2] + noise * random.standard_normal(ROWS)
    return Relation(
        "made", "N", 1e-3, 500.0, (left,), (((0, ROWS),),),
        nuisances=(term("slow", "", [columns[0]], 0.5),),
        effects=tuple(term(f"cause {i}", "", [columns[i]], 0.3) for i in range(1, 4)),
        patterns=(), resolution=1e-6, keeps_mean=True,
    )  # fmt: skip


def test_the_evidence_of_a_set_is_the_marginal_likelihood_of_all_samples():
    relation = made()
    products = products_of(relation)
    noise = BandNoise(np.ones(products.values.shape[1]))
    data = reduced(products, [0], noise, relation.effects)

    # the lines of the mains are left out: here they are projected out of the dense covariance too
    used = products.rows.sum()
    assert ROWS - used < 20

    def dense(chosen: tuple[int, ...]) -> float:
        from scipy.fft import dct

        from diagnosis.relations.products import band_edges_Hz, band_of_rows

        keep = band_of_rows(relation, ROWS, band_edges_Hz(relation)) >= 0
        covariance = np.eye(int(keep.sum()))
        for column in (*relation.nuisances, *(relation.effects[i] for i in chosen)):
            turned = np.asarray(dct(column.values[0], axis=0, norm="ortho"))[: len(keep)][keep] * column.spread
            covariance += turned @ turned.T
        left = np.asarray(dct(relation.left[0], norm="ortho"))[: len(keep)][keep]
        return -0.5 * float(left @ np.linalg.solve(covariance, left)) - 0.5 * float(np.linalg.slogdet(covariance)[1])

    sets = [(i,) for i in range(3)] + list(combinations(range(3), 2)) + [(0, 1, 2)]
    for chosen in sets:
        assert evidences(data, [chosen])[0] == pytest.approx(dense(chosen) - dense(()), rel=1e-6, abs=1e-6)
    assert ranked(data).best[1].causes == ("cause 1", "cause 2")


def test_a_coefficient_of_a_forbidden_sign_has_no_evidence():
    relation = made()
    forbidden = relation.effects[0]._replace(sign=-1)
    relation = relation._replace(effects=(forbidden, *relation.effects[1:]))
    products = products_of(relation)
    data = reduced(products, [0], BandNoise(np.ones(products.values.shape[1])), relation.effects)
    assert evidences(data, [(0,)])[0] == -math.inf


def test_the_noise_of_each_band_is_recovered_although_many_columns_were_fitted():
    random = np.random.default_rng(5)
    white = 2.0 * random.standard_normal(20000)
    columns = [random.standard_normal(20000) for _ in range(60)]
    relation = Relation(
        "made", "N", 1e-2, 50.0, (white,), (((0, 20000),),), nuisances=(),
        effects=tuple(term(f"cause {i}", "", [one], 1.0) for i, one in enumerate(columns)), patterns=(), resolution=1e-6,
    )  # fmt: skip
    products = products_of(relation)
    noise = noise_of(products, [0], *model_columns(products, relation.effects))
    wide = products.rows[0] > 300
    assert np.sqrt(noise.variance[wide]) == pytest.approx(2.0, rel=0.1)
