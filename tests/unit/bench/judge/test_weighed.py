"""Explanations as rows of numbers, and the weights of their columns."""

import json

import numpy as np
import pytest

from bench.judge.linear.witnessed import Ledger, Row
from bench.judge.weighed.answer import judged
from bench.judge.weighed.columns import Table, table_of
from bench.judge.weighed.seen import Seen, as_table, from_table
from bench.judge.weighed.training import weights_of
from bench.judge.weighed.weights import trained
from diagnosis.fits.retuning import ROUGHNESS

LAG, DRIFT, LEVEL = "frictional-lag", "friction-drift", "coulomb-level"


def seen_with(cause: str) -> Seen:
    """Evidences of a rig with one cause; empty: with none."""
    left = {name: 100.0 if name == cause else 2000.0 for name in (LAG, DRIFT, LEVEL)}
    rows = [Row(frozenset(), 2000.0 if cause else 120.0, 500.0 if cause else 60.0, -3.0, 0.0)]
    for name, chi2 in left.items():
        found = name == cause
        rows.append(
            Row(frozenset((name,)), min(chi2, rows[0].left), 60.0 if found else rows[0].kept, -5.0, 40.0 * found)
        )
    ledger = Ledger(tuple(rows), 300, 150, 0.0, False, ROUGHNESS, {"coulomb_force_N": 2.0 * (cause == LEVEL)})
    lines = {"motion": {name: 30.0 * (name == cause) for name in left}}
    related = {name: 40.0 * (name == cause) for name in left}
    return Seen(tuple(left), ledger, related, lines, {"motion": 1.0}, {}, {}, 0.0, False)


def test_the_evidences_survive_a_file() -> None:
    seen = seen_with(LAG)
    assert from_table(json.loads(json.dumps(as_table(seen)))) == seen


def test_a_library_that_lacks_an_effect_has_no_evidence_of_it() -> None:
    left = seen_with(LAG).without(LAG)
    table = table_of(left)
    assert all(LAG not in names for names in table.names)
    assert table.names[0] == frozenset()
    assert table.whole[0] > table_of(seen_with(LAG)).whole[0]  # more is left unexplained


@pytest.mark.parametrize("cause", [LAG, DRIFT, LEVEL, ""])
def test_the_cause_with_the_evidence_leads(cause: str) -> None:
    weights = weights_of([(seen_with(each), frozenset({each} - {""})) for each in (LAG, DRIFT, LEVEL, "")] * 5)
    answer = judged(seen_with(cause), weights)
    outside = answer.pop("outside")
    assert sum(answer.values()) == pytest.approx(1.0)
    assert max(answer, key=lambda name: answer[name]) == (cause or "none")
    assert judged(seen_with(cause)._replace(beyond=1.0), weights)["outside"] == 1.0
    assert outside < 0.5


def test_the_weights_of_drawn_evidences_are_found() -> None:
    random = np.random.default_rng(1)
    tables = [
        Table([frozenset(), frozenset("a"), frozenset("b")], random.standard_normal((3, 2)), np.zeros(1))
        for _ in range(3000)
    ]
    scores = np.array([table.columns @ [2.0, 0.0] for table in tables])
    odds = np.exp(scores) / np.exp(scores).sum(axis=1, keepdims=True)
    drawn = (odds.cumsum(axis=1) > random.random((3000, 1))).argmax(axis=1)
    wholes = random.standard_normal((3000, 1))
    outside = (random.random(3000) < 1.0 / (1.0 + np.exp(-2.0 * wholes[:, 0]))).astype(np.float64)
    weights = trained(tables, list(np.eye(3)[drawn]), wholes, outside, np.ones(3000))
    assert np.abs([weights.probabilities(table) for table in tables] - odds).mean() < 0.03
    assert weights.beyond(tables[0]._replace(whole=np.ones(1))) == pytest.approx(0.88, abs=0.05)
