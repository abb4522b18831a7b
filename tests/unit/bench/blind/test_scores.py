"""Scores by hand, on made-up answers and results."""

import math
import tomllib

import numpy as np
import pytest

from bench.blind.calibration import calibration_error, error_of_perfect, reliability
from bench.blind.intervals import Score, bootstrapped, mean, rate, ratio
from bench.blind.locating import f1
from bench.blind.outcomes import opened
from bench.blind.pooling import lowest_bic
from bench.blind.rivals import answered
from bench.blind.scoring import score
from bench.blind.table import ScoreRow, table
from bridge.config import validate
from bridge.results import strict_json
from diagnosis.synthetic.folder import paper_rig
from plant.config import RigConfig
from plant.effects.library import EFFECTS
from tests import made_up
from tests.blind.generators import Plan
from tests.blind.making import size
from tests.blind.plant_cases import Plant, drawn
from tests.blind.plant_sizes import EFFECT_SIZES, possible
from tests.blind.stand_ins import Bump, StandIn, case
from tests.blind.strata import counts, draw
from tests.blind.wrong_number import describe_wrong


@pytest.mark.parametrize(
    ("verdict", "share", "outside"),
    [
        ("unexplained", None, True),
        ("partly", 0.3, True),
        ("partly", None, True),
        ("partly", 0.7, False),
        ("effect", 0.3, True),
        ("effect", None, False),
        ("no-gap", None, False),
    ],
)
def test_what_closes_less_than_half_of_the_gap_counts_as_outside(verdict, share, outside):
    effects = ["drive-damping"] * (verdict in {"partly", "effect"})
    verdict_table = {"verdict": verdict, "effects": effects, "gap": {"shrinkage": share}}
    assert (
        opened("a", {"effects": [], "verdict": "unexplained", "stratum": "outside"}, verdict_table).told_outside
        is outside
    )


def described(wrong: float, found: float | None) -> dict:
    """A wrong drive stiffness, which is 10000 N/m, and the value that the result gives for it."""
    numbers = [] if found is None else [{"name": "drive_stiffness_N_per_m", "found": found}]
    number = {"name": "drive_stiffness_N_per_m", "described": wrong, "true": 10000.0}
    return {"number": number, "numbers": numbers, "verdict": "described"}


def test_scores_by_hand():
    cases = [
        case("one-effect", ["drive-damping"], {"drive-damping": 0.9, "none": 0.1}, name="right"),
        case(
            "one-effect",
            ["drive-damping"],
            {"force-sensor-delay": 0.85, "drive-damping": 0.15},
            groups=[["force-sensor-delay", "drive-damping"]],
        ),
        case("one-effect", ["drive-damping"], {"none": 0.9, "drive-damping": 0.1}, detectability=0.5),
        case("one-effect", ["coulomb-level"], {"drive-backlash": 0.6, "unexplained": 0.4}),
        case("no-gap", [], {"none": 0.9, "drive-damping": 0.1}),
        case("no-gap", [], {"drive-damping": 0.9, "none": 0.1}),
        case("outside", ["loose-screw"], {"unexplained": 0.7, "none": 0.3}),
        case("outside", ["loose-screw"], {"none": 0.95, "unexplained": 0.05}, detectability=1.0),
        case("two-effects", ["drive-damping", "coulomb-level"], {"drive-damping": 0.5, "none": 0.5}),
        case("wrong-number", ["drive-stiffness"], {"drive-stiffness": 0.9, "none": 0.1}, **described(11700.0, 10010.0)),
        case("wrong-number", ["drive-stiffness"], {"drive-stiffness": 0.9, "none": 0.1}, **described(11700.0, 10300.0)),
        case("wrong-number", ["drive-stiffness"], {"drive-backlash": 0.9, "none": 0.1}, **described(11700.0, None)),
        opened("broken", case("one-effect", ["drive-damping"], {"none": 1.0}).answer, {"fault": "X", "line": "y"}),
    ]
    scores = score(cases, {"right": 0.85})
    visible = scores.visible
    assert (visible.top_1.value, visible.top_1.n) == (0.25, 4)
    assert visible.top_3.value == 0.5
    assert visible.in_group.value == 0.5
    assert visible.group_size.value == pytest.approx(4 / 3)
    assert visible.wrong.value == 0.25
    assert scores.singles.alarm.value == 0.6
    assert list(scores.by_detectability) == ["0 to 1", "2 to 4"]
    assert scores.by_backbone["lugre"].top_1.n == 4
    assert scores.false_alarms.value == 0.5
    assert scores.outside_caught.value == 0.5
    assert (scores.number_named.value, scores.number_right.value) == (2 / 3, 1 / 3)
    # the delay of the second case and the backlash of the last wrong number
    assert (scores.sure_of_wrong_name.value, scores.sure_of_wrong_name.n) == (2 / 11, 11)
    assert scores.pair_f1.value == pytest.approx(2 / 3)
    assert scores.shrinkage_of_oracle.value == pytest.approx(0.8 / 0.85)
    assert scores.interval_coverage.value == 1.0
    assert scores.faults == 1
    assert (scores.cpu_median_s.value, scores.cpu_95_s.value) == (10.0, 10.0)
    assert ("coulomb-level", "drive-backlash", 1) in scores.confusions
    rival = score([answered(case, {"drive-damping": 0.6, "none": 0.4}) for case in cases], {})
    text = table({"diagnosis": scores, "BIC": rival}, {"plant": scores, "workshop": rival}, sealed=True)
    assert text.startswith("13 cases (sealed set, opened once): right effect first in 25 %")
    assert "coulomb-level -> drive-backlash" in text
    marked = [line.split("  ")[0] for line in text.splitlines() if "missed" in line]
    assert "first, 2 limits or more" in marked
    by_set = text[text.index("by set") :].splitlines()
    assert by_set[0].split()[2:] == ["plant", "workshop"]
    assert by_set[1].split()[-6:] == ["0.25", "of", "4", "0.75", "of", "4"]
    assert "group size, 2 limits or more" not in marked
    assert strict_json({"diagnosis": scores})["diagnosis"]["visible"]["top_1"]["n"] == 4


@pytest.mark.parametrize(
    ("bar", "reached", "missed"),
    [(">= 0.85", 0.85, 0.8499), ("<= 0.05", 0.05, 0.0501), ("0.85-0.95", 0.9, 0.951), ("0.85-0.95", 0.85, 0.84)],
)
def test_a_bar_is_not_reached_by_rounding(bar: str, reached: float, missed: float):
    def row(value: float) -> ScoreRow:
        return ScoreRow("of anything", bar, (Score(value, value, value, 20), None))

    assert not row(reached).missed
    assert row(missed).missed


def test_probabilities_are_judged():
    pairs = [(0.8, i < 8) for i in range(10)] + [(0.5, i < 1) for i in range(10)]
    # one bin is right, in the other 50 % means 10 %
    assert calibration_error(pairs).value == pytest.approx(0.2)
    assert np.array([(bin_.probability, bin_.right.value) for bin_ in reliability(pairs)]) == pytest.approx(
        np.array([(0.5, 0.1), (0.8, 0.8)])
    )
    # resampling adds chance error, so plain bootstrap quantiles would not contain the value; they are mirrored
    estimate = calibration_error([(0.9, i % 10 != 0) for i in range(100)])
    assert (estimate.value, estimate.low) == (pytest.approx(0.0), 0.0)
    assert estimate.value <= estimate.high < 0.01
    assert calibration_error([]) is None


def test_equal_probabilities_are_binned_in_the_order_of_the_cases():
    assert calibration_error([(0.8, i % 5 != 0) for i in range(40)]).value == pytest.approx(0.0)


def test_the_calibration_error_of_a_perfect_forecast_is_estimated():
    """The number of heads of 10 fair coins deviates by 1.23 in the mean; a certain forecast never deviates."""
    assert error_of_perfect([(0.5, True)] * 10).value == pytest.approx(0.123, abs=0.01)
    assert error_of_perfect([(1.0, False)] * 10).value == 0.0
    assert error_of_perfect([]) is None


def test_places_are_compared_with_the_counterfactual():
    cells = [
        ["drive_force_N", "slip", "run-01.parquet", 9.0],
        ["drive_force_N", "stick", "run-01.parquet", 1.5],
        ["mass_accel_mps2", "slip", "run-02.parquet", 6.0],
        ["mass_accel_mps2", "stick", "run-02.parquet", 2.2],  # a small part of it all
    ]
    where = [
        {"signal": "drive_force_N", "regime": "slip", "band_Hz": [0, 5], "run": "run-01.parquet", "share": 0.03},
        {"signal": "drive_force_N", "regime": "slip", "band_Hz": [5, 50], "run": "run-01.parquet", "share": 0.03},
        {"signal": "base_accel_mps2", "regime": "steady", "band_Hz": [5, 50], "run": "run-01.parquet", "share": 0.9},
        {"signal": "mass_accel_mps2", "regime": "slip", "band_Hz": [5, 50], "run": "run-02", "share": 0.04},
    ]
    one = case("one-effect", ["drive-damping"], {"none": 1.0}, cells=cells, where=where)
    assert f1(one) == pytest.approx(2 * 1 / (2 + 2))
    assert f1(case("one-effect", ["drive-damping"], {"none": 1.0}, where=where)) is None


@pytest.mark.parametrize(
    ("answer", "verdict", "named", "outside"),
    [
        ({"drive-damping": 0.6, "none": 0.4}, "effect", {"drive-damping"}, False),
        ({"drive-damping": 0.4, "none": 0.3, "drive-backlash": 0.3}, "partly", {"drive-damping"}, True),
        ({"drive-damping + drive-backlash": 0.7, "none": 0.3}, "effect", {"drive-damping", "drive-backlash"}, False),
        ({"drive-damping": 0.9, "none": 0.1, "outside": 0.5}, "unexplained", set(), True),
        ({"none": 0.6, "drive-damping": 0.4}, "no-gap", set(), False),
        ({}, "fault", set(), False),
    ],
)
def test_a_rivals_answer_counts_like_a_result(answer, verdict, named, outside):
    one = answered(case("outside", ["loose-screw"], {"none": 1.0}), answer | {"cpu_s": 3.0})
    assert (one.verdict, one.named, one.told_outside) == (verdict, named, outside)
    if answer:
        assert one.diagnosis["cpu_s"] == 3.0


def test_bic_answers_from_the_refits_of_a_kept_result():
    candidates = [
        {"effect": "none", "chi2": 60.0, "parameters": []},
        {"effect": "drive-damping", "chi2": 50.0, "parameters": ["a"]},
        {"effect": "drive-hardening", "chi2": 49.0, "parameters": ["a", "b"]},
        {"effect": "coulomb-level", "chi2": None, "parameters": []},
    ]
    answer = lowest_bic({"candidates": candidates, "compared_features": 100})
    # 54.6 against 60 and 58.2
    weights = [
        math.exp(-0.5 * (value - 50 - math.log(100))) for value in (60, 50 + math.log(100), 49 + 2 * math.log(100))
    ]
    assert answer["none"] == pytest.approx(weights[0] / sum(weights))
    assert answer.keys() == {"none", "drive-damping", "drive-hardening"}
    assert lowest_bic({"candidates": []}) == {}


def test_a_wrong_number_is_far_from_the_true_one_and_the_rig_still_sticks(tmp_path):
    true = {"mass_kg": 1.5, "coulomb_force_N": 14.0, "static_force_N": 16.0}
    changed = set()
    for seed in range(40):
        text = made_up.RIG + "[rig.tolerance]\nmass_kg = 0.005\ncoulomb_force_N = 0.03\nstatic_force_N = 0.03\n"
        (tmp_path / "manifest.toml").write_text(text)
        number = describe_wrong(tmp_path, true, np.random.default_rng(seed))
        after = tomllib.loads((tmp_path / "manifest.toml").read_text())["rig"]
        before = tomllib.loads(text)["rig"]
        assert {key for key in after if after[key] != before[key]} == {number["name"]}
        assert (after[number["name"]], true[number["name"]]) == (number["described"], number["true"])
        distance = math.log(number["described"] / number["true"])
        assert max(5.0 * before["tolerance"][number["name"]], 0.0769) < abs(distance) + 1e-3 < 0.61
        assert after["static_force_N"] >= 1.06 * after["coulomb_force_N"]
        changed.add((number["name"], distance > 0.0))
    assert changed == {
        ("mass_kg", True), ("mass_kg", False), ("coulomb_force_N", False), ("static_force_N", True),
    }  # fmt: skip


def test_intervals():
    # the textbook's 0 of 10 and 8 of 10
    assert rate([False] * 10) == pytest.approx((0.0, 0.0, 0.2775, 10), abs=1e-3)
    assert rate([True] * 8 + [False] * 2) == pytest.approx((0.8, 0.4902, 0.9433, 10), abs=1e-3)
    assert rate([]) is None
    values = np.random.default_rng(1).normal(5.0, 2.0, 200).tolist()
    estimate = mean(values)
    spread = np.std(values) / math.sqrt(200)
    assert (estimate.high - estimate.low) / (2 * 1.96 * spread) == pytest.approx(1.0, abs=0.1)
    assert bootstrapped([], len) is None
    assert ratio([(1.0, 2.0), (1.0, 2.0)]).value == 0.5
    assert math.isnan(ratio([(1.0, 0.0)]).value)


def test_an_effect_is_made_as_strong_as_it_should_be_seen():
    def seen(effect):
        tried.append(effect.strength)
        return 10.0 * effect.strength**2

    for target in (2.0, 4.0, 8.0):
        tried: list[float] = []
        estimate = size(seen, Bump("a"), target, 1.5)
        assert estimate.detectability == pytest.approx(target, rel=0.25)
        assert len(tried) <= 4
    # an effect that cannot be seen gets the largest allowed strength
    assert size(lambda _effect: 0.0, Bump("a"), 2.0, 1.5).strength <= 1.5
    assert size(lambda effect: effect.strength, Bump("a"), 8.0, 1.5).strength == 1.5


def test_a_set_has_every_kind_and_every_effect():
    three = [counts(67, True), counts(67, True), counts(66, False)]
    together = {kind: sum(one[kind] for one in three) for kind in three[0]}
    assert together == {"no-gap": 40, "one-effect": 80, "two-effects": 30, "outside": 30, "wrong-number": 20}
    cases = draw(Plant(), 60, 1)
    single = [case.effects[0].name for case in cases if case.stratum == "one-effect"]
    assert set(single) == set(Plant.library)
    assert {case.tolerances for case in cases if case.stratum == "no-gap"} == {1.0, 1.5}
    stand_in = [case.backbone for case in draw(StandIn(), 300, 1) if case.stratum == "one-effect"]
    assert stand_in.count("other") / len(stand_in) == pytest.approx(1 / 3, abs=0.1)


def test_every_size_of_every_effect_of_the_plant_is_a_rig(tmp_path):
    assert EFFECT_SIZES.keys() == EFFECTS.keys()
    rig = paper_rig().model_dump()
    random = np.random.default_rng(1)
    for name, forms in EFFECT_SIZES.items():
        assert {sizes.form for sizes in forms} == EFFECTS[name].forms.keys()
        for sizes in forms:
            for strength in (0.01, 0.3, 1.0):
                effect = drawn(random, name, sizes).scaled(strength)
                validate(RigConfig, rig | {"effects": {name: effect.numbers}}, name)
    assert "piezo-sag" not in possible("spring", vibrated=False)
    assert "drive-backlash" not in possible("force", vibrated=False)


@pytest.mark.slow
def test_the_plants_cases_differ_by_their_effect_alone(tmp_path):
    source = Plant()
    effect = source.draw(np.random.default_rng(1), "force-sensor-bias").scaled(0.5)
    source.make(tmp_path / "with", Plan((effect,), leave_out=("mass_accel_mps2",)), 3)
    source.make(tmp_path / "without", Plan((), leave_out=("mass_accel_mps2",)), 3)
    for one, other in zip(*(sorted((tmp_path / name).iterdir()) for name in ("with", "without")), strict=True):
        assert (one.read_bytes() == other.read_bytes()) == (one.name == "manifest.toml")
