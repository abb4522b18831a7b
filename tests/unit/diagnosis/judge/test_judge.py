"""The answer to a ledger."""

import math
from typing import Any

import pytest

from diagnosis.hypotheses.hypothesis import MASS
from diagnosis.judge.judge import NONE, judge
from diagnosis.judge.ledger import Ledger
from diagnosis.result import LedgerRow

LAG, GAIN, DRIFT = "force-sensor-lag", "force-sensor-gain", "friction-drift"


def row(names: str, source: Any, evidence: float, left: float | None = None) -> LedgerRow:
    return LedgerRow(tuple(sorted(names.split())), "features", source, evidence, left=left)


def ledger(*rows: LedgerRow, beyond: float = 0.0, foreign: bool = False) -> Ledger:
    return Ledger(rows, (LAG, GAIN, DRIFT), beyond, foreign)


NOTHING = row("", "fit", 0.0, 0.0)


def test_without_evidence_there_is_no_effect() -> None:
    answer = judge(ledger(NOTHING))
    assert answer.names == frozenset()
    assert next(iter(answer.effects)) == NONE
    assert set(answer.effects) == {NONE, LAG, GAIN, DRIFT}
    assert sum(answer.effects.values()) == pytest.approx(1.0)
    assert answer.complete > 0.8


def test_the_evidence_of_all_witnesses_is_one_sum() -> None:
    fits = (NOTHING, row(LAG, "fit", 20.0, 0.0), row(GAIN, "fit", 24.0, 0.1))
    assert judge(ledger(*fits)).names == {GAIN}
    answer = judge(ledger(*fits, row(LAG, "relation", 15.0), row(GAIN, "kept runs", -8.0)))
    assert answer.names == {LAG}
    assert answer.effects[LAG] > 1.5 * answer.effects[GAIN]


def test_two_effects_share_the_probability_of_their_explanation() -> None:
    answer = judge(ledger(NOTHING, row(LAG, "fit", 20.0, 1.0), row(f"{LAG} {DRIFT}", "fit", 300.0, 0.0)))
    assert answer.names == {LAG, DRIFT}
    assert answer.explanations[answer.names] > 0.6
    assert answer.effects[DRIFT] == pytest.approx(0.5 * answer.explanations[answer.names], abs=0.02)


def test_a_wrong_mass_is_an_explanation_without_an_effect() -> None:
    possible = (LAG, GAIN, DRIFT, MASS)
    rows = NOTHING, row(MASS, "fit", 80.0, 0.0), row(GAIN, "fit", 20.0, 1.0), row(f"{GAIN} {MASS}", "fit", 80.0, 0.0)
    answer = judge(Ledger(rows, possible, 0.0, foreign=False))
    assert answer.names == {MASS}
    assert MASS not in answer.effects
    assert answer.effects[NONE] > 0.6
    assert sum(answer.effects.values()) == pytest.approx(1.0)


def test_a_second_effect_has_to_earn_its_prior() -> None:
    answer = judge(ledger(NOTHING, row(LAG, "fit", 20.0, 0.0), row(f"{LAG} {DRIFT}", "fit", 20.5, 0.0)))
    assert answer.names == {LAG}


def test_a_promise_is_worth_less_than_a_fit() -> None:
    answer = judge(ledger(NOTHING, row(LAG, "fit", 20.0, 0.0), row(GAIN, "simulation", 20.0)))
    assert answer.effects[LAG] > 1.5 * answer.effects[GAIN]


@pytest.mark.parametrize(
    "rest",
    [
        ledger(row("", "fit", 0.0, 4.0), row("", "kept runs", 0.0, 4.0)),
        ledger(NOTHING, beyond=0.9),
        ledger(NOTHING, foreign=True),
    ],
)
def test_a_remainder_or_a_pattern_that_no_effect_makes_is_something_else(rest: Ledger) -> None:
    answer = judge(rest)
    assert answer.complete < 0.5
    assert answer.names == judge(ledger(NOTHING)).names  # the first question is another one


def test_a_share_without_evidence_decides_nothing() -> None:
    friction = LedgerRow(("inertia",), "sliding friction", "friction", math.nan, 0.9, (0.8, 1.0), 0.1, True)
    assert judge(ledger(NOTHING, friction)) == judge(ledger(NOTHING))
