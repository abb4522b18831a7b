"""Scores kept in a file are computed again from it, alone or pooled with other sets."""

import gzip
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.app import app
from bench.blind.opening import OpenedSet, scored, together
from bench.blind.pooling import kept_scores, read_sets
from bridge.faults import FAULTS
from bridge.results import write_json
from tests.blind.stand_ins import case

CELLS = [["drive_force_N", "slip", "run-01", 9.0], ["mass_accel_mps2", "slip", "run-01", 6.0]]
WHERE = [
    {"signal": "drive_force_N", "regime": "slip", "band_Hz": [low, 5], "run": "run-01", "share": share}
    for low, share in ((0, 0.5), (5, 0.1), (50, 0.2))
]


def opened_set(number: int) -> OpenedSet:
    damped, probabilities = ["drive-damping"], {"drive-damping": 0.8}
    seed = 10 * number
    cases = [
        case("one-effect", damped, probabilities, name=f"a{number}", seed=seed, cells=CELLS, where=WHERE),
        case("no-gap", [], {"none": 0.9}, name=f"b{number}", seed=seed + 1),
        case("outside", ["loose-screw"], {"unexplained": 0.6, "none": 0.4}, name=f"c{number}", seed=seed + 2),
    ]
    rivals = {"BIC": {f"a{number}": {"none": 0.3, "drive-damping": 0.7, "cpu_s": 2.0}}}
    return OpenedSet(cases, sealed=True, tool="1", oracle={f"a{number}": 0.85}, rivals=rivals)


def kept(folder: Path, number: int, **other) -> Path:
    sealed_set = opened_set(number)._replace(**other)
    path = folder / f"{number}.json"
    write_json(path, kept_scores(sealed_set, scored(sealed_set), {}))
    return path


def pooled(*files):
    return together(read_sets(files))


def pool(*files):
    return CliRunner().invoke(app, ["blind", "pool", *map(str, files)])


@pytest.mark.slow
def test_scores_are_the_same_again(tmp_path):
    sealed_set = opened_set(1)
    assert scored(pooled(kept(tmp_path, 1))) == scored(sealed_set)
    without = sealed_set._replace(oracle=None)
    assert scored(pooled(kept(tmp_path, 2, oracle=None))) == scored(
        without._replace(cases=opened_set(2).cases, rivals=opened_set(2).rivals)
    )


@pytest.mark.slow
def test_several_sets_count_as_one(tmp_path):
    files = [kept(tmp_path, number) for number in (1, 2)]
    together, alone = scored(pooled(*files)), scored(opened_set(1))
    assert list(together) == list(alone) == ["diagnosis", "BIC"]
    for name, scores in together.items():
        assert scores.cases == 2 * alone[name].cases
        assert scores.cpu_median_s.value == (2.0 if name == "BIC" else 10.0)
        assert scores.visible.top_1.n == 2
        assert scores.visible.top_1.value == alone[name].visible.top_1.value
    assert together["diagnosis"].shrinkage_of_oracle.value == pytest.approx(0.8 / 0.85)
    result = pool(*files, "--json", tmp_path / "both.json", "--report", tmp_path / "both.html")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("6 cases (sealed set, opened once)")
    assert "1, 2" in (tmp_path / "both.html").read_text()
    assert pool(tmp_path / "both.json").stdout.startswith(result.stdout.split("\n\ndiagnosis, by set")[0])


@pytest.mark.slow
def test_one_opened_set_makes_all_development_data(tmp_path):
    files = [kept(tmp_path, 1), kept(tmp_path, 2, sealed=False)]
    assert "DEVELOPMENT DATA" in pool(*files).stdout


@pytest.mark.slow
def test_a_score_that_one_set_lacks_is_left_out_of_the_pool(tmp_path):
    scores = scored(pooled(kept(tmp_path, 1), kept(tmp_path, 2, oracle=None)))["diagnosis"]
    assert scores.shrinkage_of_oracle is None


@pytest.mark.slow
def test_files_that_cannot_be_pooled_are_refused(tmp_path):
    one = kept(tmp_path, 1)

    def refused(*files: Path) -> str:
        result = pool(*files)
        assert result.exit_code == FAULTS["BAD_SET"].exit_status
        return result.stderr

    again = tmp_path / "again.json"
    again.write_text(one.read_text().replace('"a1"', '"d1"'))  # the same rigs under new case names
    assert f"{again}: case d1 is in {one} too: must be in one; leave one out" in refused(one, again)
    assert "results of the versions 1 and 2: must be of one" in refused(one, kept(tmp_path, 2, tool="2"))
    assert "No such file" in refused(tmp_path / "nothing.json")
    bad = tmp_path / "bad.json"
    bad.write_text("a,b\n")
    assert f"{bad}: is not JSON" in refused(bad)
    cut = tmp_path / "cut.json.gz"
    cut.write_bytes(gzip.compress(b"{}" * 100)[:-9])
    assert "cannot be read: " in refused(cut)
    bad.write_text('{"format": "blind-scores/1"}')
    assert "format = 'blind-scores/1': must be 'blind-scores/3'" in refused(bad)
    table = json.loads(one.read_text())
    del table["cases"][0]["answer"]
    bad.write_text(json.dumps(table))
    assert f"{bad}: cases: 'answer' is missing" in refused(bad)


@pytest.mark.slow
def test_an_input_file_is_not_overwritten(tmp_path):
    one = kept(tmp_path, 1)
    before = one.read_bytes()
    result = pool(one, "--json", one)
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert f"--json {one}: is one of the files to read" in result.stderr
    assert one.read_bytes() == before
