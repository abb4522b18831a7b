"""The witnesses of a made rig with a known effect, and the rows that they add to the ledger."""

import math

import pytest

from diagnosis.judge.judge import judge
from diagnosis.judge.ledger import Ledger
from diagnosis.judge.witnesses import Witnesses, before_fits, ledger_of, with_fits
from tests.prepared import prepared

DAMPING = "drive-damping"


@pytest.fixture(scope="module")
def seen() -> Witnesses:
    evidence, _ = prepared("short", {DAMPING: {"damping_Ns_per_m": 12.0}})
    return with_fits(before_fits(evidence, 1, math.inf), lambda *_: None)


@pytest.fixture(scope="module")
def ledger(seen: Witnesses) -> Ledger:
    return ledger_of(seen)


@pytest.mark.slow
def test_fitted_and_kept_runs_show_the_effect(ledger: Ledger) -> None:
    sources = {row.source for row in ledger.rows if row.causes == (DAMPING,) and row.evidence > 8.0}
    assert {"fit", "kept runs"} <= sources


@pytest.mark.slow
def test_the_judge_names_it_and_nothing_else(ledger: Ledger) -> None:
    answer = judge(ledger)
    assert answer.names == {DAMPING}
    assert answer.complete > 0.5


@pytest.mark.slow
def test_the_rig_without_effects_is_the_reference(ledger: Ledger) -> None:
    none = [row for row in ledger.rows if not row.causes]
    assert {row.source for row in none} == {"fit", "kept runs"}
    assert all(row.evidence == 0.0 for row in none)
    least = min(row.left for row in ledger.rows if row.source == "fit" and row.left is not None)
    assert none[0].left is not None
    assert none[0].left > least


@pytest.mark.slow
def test_the_fit_of_the_named_effect_goes_to_its_end(seen: Witnesses) -> None:
    assert seen.search is not None
    fit = seen.search.of(frozenset((DAMPING,)))
    assert fit is not None
    assert fit.finished
    assert fit.effects[DAMPING]["damping_Ns_per_m"] == pytest.approx(12.0, rel=0.2)
    assert seen.search.of(frozenset(("no such effect",))) is None


@pytest.mark.slow
def test_an_explanation_that_is_only_promised_is_fitted_once(seen: Witnesses) -> None:
    search = seen.search
    assert search is not None
    promised = next(names for names in search.promised if search.fitted(names) is None)
    assert search.add(promised)
    fit = search.fitted(promised)
    assert fit is not None
    assert search.left[promised] == min(fit.chi2, search.rig.fit.chi2)  # an effect may have no size
    assert not search.add(promised)
    assert not search.add(frozenset())
