"""The bench of methods: which answers count as right, that kept answers are not asked for again, and the parts of the rivals."""

import json
from pathlib import Path

import numpy as np
import pytest

from bench.blind.sealing import evidence_hash
from bench.judge import methods, refits
from bench.judge.cases import Case, read_cases
from bench.judge.columns import Block
from bench.judge.features import turning_points
from bench.judge.lines import evidences
from bench.judge.methods import Given, Method, ask
from bench.judge.scoring import Outcome, by_method, case_table, figures
from bridge.faults import Fault
from tests import made_up

DAMPING, LAG = "drive-damping", "frictional-lag"


def case(kind: str, *effects: str, name: str = "a", limits: float | None = None, number: str | None = None) -> Case:
    return Case(name, "plant", kind, frozenset(effects), limits, number, "0" * 64, {}, Path())


def outcome(one: Case, fault: str = "", cpu_s: float = 1.0, **probabilities: float) -> Outcome:
    named = {name.replace("_", "-").replace("--and--", " + "): value for name, value in probabilities.items()}
    return Outcome(one, Given("m", one.name, named, cpu_s, fault))


KINDS = [
    case("single", DAMPING, name="single", limits=3.0),
    case("single", LAG, name="faint", limits=1.0),
    case("pair", DAMPING, LAG, name="pair"),
    case("none", name="none"),
    case("outside", "loose-screw", name="outside"),
    case("number", "coulomb-level", name="level", number="coulomb_force_N"),
    case("number", name="mass", number="mass_kg"),
    case("measured", DAMPING, LAG, name="log"),
    case("measured", name="noisy"),
]


def truth(one: Case) -> dict[str, float]:
    if one.kind == "outside":
        return {"none": 0.1, "outside": 0.9}
    return {" + ".join(sorted(one.effects)) or one.number or "none": 1.0, "outside": 0.0}


def test_the_truth_scores_one() -> None:
    row = figures("m", [Outcome(one, Given("m", one.name, truth(one), 2.0)) for one in KINDS])
    assert row.first == row.in_three == (1, 1)  # the faint effect does not count
    assert row.pair_f1 == 1.0
    assert row.alarms == (0, 1)
    assert row.outside == (1, 1)
    assert row.called_outside == (0, 3)
    assert row.numbers == row.measured == (2, 2)
    assert row.sure_of_wrong == (0, 7)
    assert row.calibration == pytest.approx(0.025)  # 0.1 of one case in four
    assert row.cpu_median_s == 2.0


def test_an_answer_that_always_names_the_same_scores_by_chance() -> None:
    row = figures("m", [Outcome(one, Given("m", one.name, {LAG: 0.9, "none": 0.1}, 2.0)) for one in KINDS])
    assert row.first == (0, 1)
    assert row.alarms == (1, 1)
    assert row.outside == (0, 1)
    assert row.pair_f1 == pytest.approx(2 / 3, abs=1e-3)
    assert row.sure_of_wrong == (5, 7)


def test_outside_is_a_second_question() -> None:
    one = outcome(KINDS[0], drive_damping=0.9, none=0.1, outside=0.95)
    assert one.right
    assert "out 0.95" in one.words
    assert not outcome(KINDS[3], none=1.0, outside=0.95).right
    assert outcome(KINDS[4], drive_damping=0.4, frictional_lag=0.4).right  # no name has half
    assert not outcome(KINDS[4], drive_damping=0.6).right


def test_a_case_without_an_answer_is_left_out_and_shown() -> None:
    broken = outcome(KINDS[0], fault="BAD_EVIDENCE: run-01: no force")
    assert by_method([broken])[0].answered == 0
    assert "? BAD_EVIDENCE" in case_table([broken])[1]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for number in range(4):
        evidence = tmp_path / "plant" / f"plant-{number}"
        made_up.evidence_folder(evidence)
        answer = {"case": evidence.name, "set": "plant", "kind": "none", "effects": [], "limits": None, "number": None}
        answer |= {"kept": {}, "sha256": evidence_hash(evidence)}
        evidence.with_suffix(".json").write_text(json.dumps(answer))
    return tmp_path


def test_the_halves_are_fixed_and_share_no_case(folder: Path) -> None:
    halves = [{one.name for one in read_cases(folder, half=half)} for half in "ab"]
    assert halves == [{"plant-1", "plant-3"}, {"plant-0", "plant-2"}]
    with pytest.raises(Fault, match=r"holds no case of foreign; `python -m tests.blind develop"):
        read_cases(folder, ["foreign"])


def test_a_kept_answer_is_not_asked_for_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def answer(evidence: Path, _budget_s: float | None) -> dict[str, float]:
        asked.append(evidence.name)
        if evidence.name == "plant-1":
            raise Fault("BAD_EVIDENCE", "run-01: no force")
        return {"none": 1.0}

    monkeypatch.setattr(methods, "methods", lambda: {"stub": Method(answer, ("bench/judge/cases.py",))})
    methods.version.cache_clear()
    cases = read_cases(folder)
    first = list(ask(folder, ["stub"], cases, 1, None))
    again = list(ask(folder, ["stub"], cases, 1, None))
    methods.version.cache_clear()
    assert sorted(asked) == sorted(one.name for one in cases)
    assert sorted(first) == sorted(again)
    assert [one.fault for one in first if one.case == "plant-1"] == ["BAD_EVIDENCE: run-01: no force"]


def test_bic_takes_the_smaller_model_of_two_that_leave_as_much() -> None:
    answer = refits.by_bic({"none": (60.0, 0), DAMPING: (40.0, 1), LAG: (40.0, 3)}, 100)
    assert max(answer, key=answer.__getitem__) == DAMPING
    assert sum(answer.values()) == pytest.approx(1.0)


def test_fits_that_nobody_kept_are_no_answer(folder: Path) -> None:
    assert refits.bic(folder / "plant" / "plant-0", None) is None


def test_the_evidence_of_a_line_is_that_of_its_column() -> None:
    random = np.random.default_rng(1)
    x = random.standard_normal((2000, 3))
    y = 0.3 * x[:, 1] + random.standard_normal(2000)
    columns = [("right", x[:, 1:2], 1), ("wrong sign", -x[:, 1:2], 1), ("other", x[:, 2:3], 0)]
    block = Block("b", y, x[:, :1], np.array([np.inf]), columns, {}, {"z": x[:, 2]})
    by_effect, free = evidences(block)
    assert by_effect["right"] > 50.0
    assert "wrong sign" not in by_effect
    assert by_effect["other"] < 1.0
    assert free < 1.0


def test_turning_points_are_those_around_a_slip() -> None:
    saw = np.concatenate([np.linspace(0.0, 1.0, 100), np.linspace(0.9, 0.0, 10)] * 3)
    highs, lows = turning_points(saw, 0.4)
    assert len(highs) == 3
    assert saw[highs].min() > 0.95
    assert saw[lows].max() < 0.05
