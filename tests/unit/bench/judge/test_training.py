"""Rigs to train the judge on, and the numbers that follow from their ledgers."""

import numpy as np

from bench.judge.campaigns import drawn_campaign
from bench.judge.rigs import drawn_rig
from bench.judge.training import Example, from_json, numbers_of
from bridge.results import strict_json
from diagnosis.judge.ledger import Ledger
from diagnosis.result import LedgerRow
from diagnosis.synthetic.folder import paper_rig
from plant.effects.library import EFFECTS

NAMES = tuple(EFFECTS)


def test_half_of_the_campaigns_are_the_papers() -> None:
    campaigns = [drawn_campaign(np.random.default_rng(seed)) for seed in range(40)]
    paper = paper_rig().contact.static_force_N
    assert 12 < sum(campaign.described.contact.static_force_N == paper for campaign in campaigns) < 28
    assert all(0.0 < campaign.travel_m < campaign.described.sensors.position_range_m for campaign in campaigns)


def test_a_rig_follows_from_its_seed() -> None:
    first, again = drawn_rig(4), drawn_rig(4)
    assert first is not None
    assert again is not None
    assert first.effects == again.effects
    assert set(first.effects) <= set(NAMES)
    for one, other in zip(first.evidence.runs, again.evidence.runs, strict=True):
        assert np.array_equal(one.columns["drive_force_N"], other.columns["drive_force_N"])
    assert sum(run.holdout for run in first.evidence.runs) == 1


def example(random: np.random.Generator, effect: str) -> Example:
    """A rig with an effect, or without for an empty name, and evidence of 12 for it with a scatter of 6."""
    rows = [LedgerRow((), "features", "fit", 0.0, left=0.0 if effect == "" else 1.5)]
    for name in NAMES[:5]:
        right = name == effect
        rows.append(
            LedgerRow((name,), "features", "fit", random.normal(12.0 if right else -2.0, 6.0), left=float(not right))
        )
        rows.append(LedgerRow((name,), "features", "kept runs", 0.0, left=0.0 if right else 1.0))
    return Example(Ledger(tuple(rows), NAMES[:5], 0.0, foreign=False), frozenset((effect,) if effect else ()))


def test_the_numbers_say_how_much_evidence_is_worth() -> None:
    random = np.random.default_rng(1)
    effects = [str(random.choice(["", *NAMES[:5]])) for _ in range(300)]
    weight, _, single, _ = numbers_of([example(random, effect) for effect in effects]).explanations
    assert 0.25 < weight < 0.6  # 14 apart with a scatter of 6: 0.39
    assert single < 0.0  # five effects together are as frequent as a fifth of them without a prior
    scattered = [example(random, str(random.permutation(NAMES[:5])[0])) for _ in range(300)]
    assert numbers_of(scattered).explanations[0] > 0.0


def test_a_remainder_in_the_kept_runs_is_a_reason_for_something_else() -> None:
    random = np.random.default_rng(2)
    numbers = numbers_of([example(random, name) for name in NAMES[:5] * 20])
    least, _, kept = numbers.something_else
    assert least < 0.0 < kept


def test_a_ledger_survives_its_json() -> None:
    ledger = example(np.random.default_rng(3), NAMES[0]).ledger
    assert from_json(strict_json(ledger)) == ledger
