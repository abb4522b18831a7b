"""The campaign itself, with functions that stand in for the diagnosis."""

import json

import numpy as np
import pytest

from bridge.config import validate
from diagnosis.evidence import Evidence
from diagnosis.making import paper_rig
from diagnosis.result import Diagnosis
from plant.config import RigConfig
from plant.effects import EFFECTS
from tests.campaign.cases import plan
from tests.campaign.running import CASE, EVIDENCE, FAILED, RESULT, read, run
from tests.campaign.scoring import rate, score
from tests.campaign.sizes import EFFECT_SIZES, draw, possible
from tests.campaign.table import table
from tests.made_up import diagnosis


def stand_in(evidence: Evidence) -> Diagnosis:
    """Says backlash whatever it sees, so that a single case of backlash is right and nothing else."""
    assert {run.file for run in evidence.runs} == {f"run-0{n}.parquet" for n in (1, 2, 3, 4)}
    return diagnosis()


def broken(evidence: Evidence) -> Diagnosis:
    raise ZeroDivisionError("nothing to divide by")


def test_every_size_of_every_effect_is_a_rig(tmp_path):
    assert EFFECT_SIZES.keys() == EFFECTS.keys()
    table = paper_rig().model_dump()
    random = np.random.default_rng(1)
    for name in EFFECT_SIZES:
        forms = set()
        for _ in range(60):
            drawn = draw(random, name, vibrated=True)
            forms.add(drawn.numbers.get("form", ""))
            validate(RigConfig, table | {"effects": {name: drawn.numbers}}, name)
        assert forms == EFFECTS[name].forms.keys()
    assert "piezo-sag" not in possible("spring", vibrated=False)
    assert "drive-backlash" not in possible("force", vibrated=False)


def test_a_longer_campaign_begins_with_the_shorter_one():
    short = plan("slow", ["drive-backlash", "drive-damping"], 2, 1, 1, 1)
    long = plan("slow", ["drive-backlash", "drive-damping"], 5, 3, 4, 1)
    assert set(map(str, short)) <= set(map(str, long))
    assert len({case.folder for case in long}) == len(long) == 17
    other = plan("ladder", ["drive-backlash", "drive-damping"], 2, 1, 1, 1)
    assert not {case.folder for case in short} & {case.folder for case in other}


def test_cases_are_made_diagnosed_scored_and_not_done_twice(tmp_path):
    planned = plan("ladder", ["drive-backlash", "drive-damping"], 1, 1, 1, 1)
    ended = list(run(tmp_path, planned, 1, stand_in))
    assert {case.folder for case, _ in ended} == {case.folder for case in planned}
    assert not list(tmp_path.glob("**/*.parquet"))
    for case in planned:
        folder = tmp_path / case.folder
        assert (folder / EVIDENCE / "manifest.toml").is_file()
        assert json.loads((folder / CASE).read_text())["seed"] == case.seed
    assert not list(run(tmp_path, planned, 1, broken))
    scores = score(read(tmp_path))
    assert scores["effects"]["drive-backlash"]["top_1"]["rate"] == 1.0
    assert scores["effects"]["drive-damping"]["top_1"]["rate"] == 0.0
    assert scores["no_gap"]["false_alarms"]["rate"] == 1.0
    assert scores["pairs"]["set_f1"] == pytest.approx(2 / 3)
    assert scores["confusions"] == [["drive-damping", "drive-backlash", 1]]
    assert "drive-damping -> drive-backlash" in table(json.loads(json.dumps(scores)))


def test_a_case_that_fails_keeps_its_data_and_is_done_again(tmp_path):
    planned = plan("ladder", ["drive-backlash"], 1, 0, 0, 1)
    [(case, said)] = run(tmp_path, planned, 1, broken)
    folder = tmp_path / case.folder
    assert said.startswith("FAILED")
    assert "ZeroDivisionError" in (folder / FAILED).read_text()
    assert len(list((folder / EVIDENCE).glob("*.parquet"))) == 4
    assert read(tmp_path) == []
    list(run(tmp_path, planned, 1, stand_in))
    assert (folder / RESULT).is_file()
    assert not (folder / FAILED).exists()


def case(kind, effects, verdict="effect", named=(), groups=(), **more):
    candidates = [{"effect": name, "probability": 0.5 - 0.1 * i} for i, name in enumerate([*named, "none"])]
    result = {"verdict": verdict, "effects": list(named), "not_distinguishable": groups, "candidates": candidates}
    result |= {"gap": {"shrinkage": 0.8}, "elapsed_s": 1.0}
    drawn = [{"name": name, "size_share": 0.5} for name in effects]
    return {"kind": kind, "effects": drawn, "result": result, "folder": "x"} | more


def test_scores_by_hand():
    cases = [
        case("single", ["drive-damping"], named=["drive-damping"], detectability=3.0),
        case("single", ["drive-damping"], named=["drive-backlash"], groups=[["drive-backlash", "drive-damping"]]),
        case("single", ["drive-damping"], "no-gap"),
        case("single", ["drive-damping"], "unexplained"),
        case("none", [], "no-gap"),
        case("pair", ["drive-damping", "coulomb-level"], named=["coulomb-level", "drive-damping"]),
    ]
    scores = score(cases)
    all_effects = scores["all_effects"]
    rates = {key: all_effects[key]["rate"] for key in ("alarm", "top_1", "top_3", "in_group", "wrong")}
    assert rates == {"alarm": 0.75, "top_1": 0.25, "top_3": 0.25, "in_group": 0.5, "wrong": 0.0}
    assert all_effects["group_size"] == 1.5
    assert list(scores["by_detectability"]) == ["2 to 4"]
    assert scores["no_gap"]["false_alarms"]["rate"] == 0.0
    assert scores["pairs"]["exact"]["rate"] == scores["pairs"]["set_f1"] == 1.0


def test_wilson():
    # the textbook's 0 of 10 and 8 of 10
    assert rate([False] * 10) == pytest.approx({"rate": 0.0, "low": 0.0, "high": 0.2775, "n": 10}, abs=1e-3)
    assert rate([True] * 8 + [False] * 2) == pytest.approx(
        {"rate": 0.8, "low": 0.4902, "high": 0.9433, "n": 10}, abs=1e-3
    )
    assert rate([]) is None
