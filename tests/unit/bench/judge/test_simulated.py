"""The method "simulated": training rigs, witnesses, the softmax that weighs them, and the answer."""

import numpy as np
import pytest
from scipy.special import softmax

from bench.judge.simulated.answer import named_by, with_second
from bench.judge.simulated.campaigns import drawn_campaign
from bench.judge.simulated.inputs import NAMES, table_of, whole_of
from bench.judge.simulated.rigs import drawn_rig
from bench.judge.simulated.second import beside
from bench.judge.simulated.softmax import trained
from bench.judge.simulated.training import model_of
from bench.judge.simulated.witnesses import Witnesses
from diagnosis.synthetic.folder import paper_rig

LAG, DELAY, DRIFT = "force-sensor-lag", "force-sensor-delay", "friction-drift"
LAGGING: Witnesses = {
    "line spring force-sensor-lag": 50.0, "line spring force-sensor-delay": 40.0, "line breakaway friction-drift": 30.0,
    "relation spring force-sensor-lag": 900.0, "relation spring force-sensor-delay": 880.0, "relation spring loose-clamp": 2.0,
    "chosen spring force-sensor-lag": 900.0, "pattern spring the-extension": -3.0, "left spring chosen": 0.1,
    "left spring bursts": 0.0, "fit rig chi2": 2000.0, "fit rig compared": 500.0, "fit rig force-sensor-lag": 800.0,
    "fit rig force-sensor-delay": 700.0, "fit rig friction-drift": 5.0, "beside force-sensor-lag friction-drift": 90.0,
    "beside force-sensor-lag force-sensor-delay": 3.0, "moved rig surface": 0.1,
}  # fmt: skip


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


def test_a_withheld_effect_says_nothing() -> None:
    row = table_of(LAGGING, LAG)[NAMES.index(LAG)]
    assert np.array_equal(row, table_of({})[NAMES.index(LAG)])
    assert whole_of(LAGGING, LAG)[1] > whole_of(LAGGING)[1]  # less is explained
    assert np.isfinite(whole_of({})).all()


def test_a_second_effect_is_judged_by_what_the_first_leaves() -> None:
    left = beside(LAGGING, LAG)
    assert left is not None
    assert not any(key.endswith(f" {LAG}") for key in left)
    assert left["fit rig chi2"] == 400.0
    assert left[f"fit rig {DRIFT}"] == 90.0
    assert f"relation spring {DELAY}" not in left  # the spring relation speaks of the lag
    assert left[f"line breakaway {DRIFT}"] == 30.0
    assert beside(LAGGING, DRIFT) is None


def test_the_softmax_finds_the_weights_of_its_rigs() -> None:
    random = np.random.default_rng(1)
    tables, wholes = random.standard_normal((4000, 3, 2)), random.standard_normal((4000, 1))
    scores = np.concatenate([tables @ [2.0, 0.0], wholes, 0.0 * wholes], axis=1)
    drawn = (softmax(scores, axis=1).cumsum(axis=1) > random.random((4000, 1))).argmax(axis=1)
    model = trained(tables, wholes, np.eye(5)[drawn], np.ones(4000))
    assert np.abs(model.probabilities(tables, wholes) - softmax(scores, axis=1)).mean() < 0.03
    assert model.shared[0] > 10.0 * abs(model.shared[1])


def test_rigs_count_as_they_are_weighted() -> None:
    model = trained(np.zeros((2, 1, 1)), np.zeros((2, 1)), np.eye(3)[:2], np.array([1.0, 4.0]))
    one, none, outside = model.probabilities(np.zeros((1, 1, 1)), np.zeros((1, 1)))[0]
    assert none > 2.0 * one > 50.0 * outside


def test_a_model_of_few_rigs_names_what_they_had() -> None:
    quiet: Witnesses = {
        "fit rig chi2": 100.0,
        "fit rig compared": 500.0,
        f"fit rig {LAG}": 2.0,
        f"fit rig {DRIFT}": 1.0,
    }
    drifting = LAGGING | {f"beside {LAG} {DRIFT}": 2.0, "line breakaway friction-drift": -2.0}
    examples: list[tuple[Witnesses, list[str], str]] = [
        (quiet, [], ""),
        (drifting, [LAG], ""),
        (LAGGING, [LAG, DRIFT], ""),
    ]
    model = model_of(examples * 20)
    answers = [with_second(named_by(model.first, witnesses), witnesses, model) for witnesses, *_ in examples]
    assert [max(answer, key=answer.__getitem__) for answer in answers] == [
        "none", LAG, f"{LAG} + {DRIFT}" if LAG < DRIFT else f"{DRIFT} + {LAG}"
    ]  # fmt: skip
    for answer in answers:
        assert sum(answer.values()) == pytest.approx(1.0)
        assert answer["outside"] < 0.5
