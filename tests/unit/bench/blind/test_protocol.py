"""The blind protocol with fake generator and diagnosis: sealed, diagnosed without the answers, opened once."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.app import app
from bench.blind import sealing
from bench.judge import methods
from bridge.faults import FAULTS
from cockpit.entry import main
from diagnosis import diagnose_many as many
from diagnosis.version import tool_version
from tests import made_up
from tests.blind import making, strata
from tests.blind.__main__ import app as making_app
from tests.blind.sizes import read_sizes
from tests.blind.stand_ins import StandIn, StandInBench
from tests.patience import PATIENCE_S

CASES = 8


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch):
    monkeypatch.setattr(making, "generator", lambda _name: StandIn())
    monkeypatch.setattr(making, "Bench", StandInBench)
    monkeypatch.setattr(many, "real_diagnose", made_up.quick)


def blind(*arguments):
    return CliRunner().invoke(app, ["blind", *map(str, arguments)])


def make(folder: Path, **other):
    options = {"cases": CASES, "seed": 20011, "out": folder / "set", "key": folder / "key.json", "jobs": 1} | other
    arguments = [str(part) for name, value in options.items() for part in (f"--{name}", value)]
    return CliRunner().invoke(making_app, ["make", *arguments])


@pytest.fixture
def made(tmp_path):
    result = make(tmp_path)
    assert result.exit_code == 0, result.output
    return tmp_path


@pytest.fixture
def done(made):
    result = blind("run", made / "set", "--jobs", 1)
    assert result.exit_code == 0, result.output
    return made


def answers(folder: Path) -> dict:
    return {name: case["answer"] for name, case in json.loads((folder / "key.json").read_text())["cases"].items()}


def score(folder: Path, *options):
    return blind("score", folder / "set", "--key", folder / "key.json", *options)


@pytest.mark.slow
def test_nothing_in_the_set_reveals_the_answers(made):
    files = sorted(path for path in (made / "set").rglob("*") if path.is_file())
    key = json.loads((made / "key.json").read_text())["cases"]
    everything = b"".join(path.read_bytes() for path in files)
    telling = ["drive-backlash", "force-sensor-gain", "loose-screw", "no-gap", "stratum", "20011", "bump", 'effect"']
    telling += [case["nonce"] for case in key.values()]
    for word in telling:
        assert word.encode() not in everything, word
    assert len({path.stat().st_mtime for path in (made / "set").rglob("*")}) == 1
    assert len({path.stat().st_mode for path in files}) == 1
    assert {path.name for path in (made / "set").iterdir()} == {*key, "set.json"}
    for name in key:
        assert {path.name for path in (made / "set" / name).iterdir()} == {"manifest.toml", "run-01.csv"}
    hashes = json.loads((made / "set" / "set.json").read_text())["cases"]
    assert list(hashes) == sorted(hashes)
    assert all(row.keys() == {"answer_sha256", "evidence_sha256"} for row in hashes.values())
    assert {path.name for path in made.iterdir()} == {"set", "key.json", "key.sizes.toml"}


def test_the_key_holds_every_kind_of_case(made):
    by_name = answers(made)
    assert {case["stratum"] for case in by_name.values()} == set(strata.SHARES)
    wrong = next(case for case in by_name.values() if case["stratum"] == "wrong-number")
    assert (wrong["verdict"], wrong["effects"][0]["name"]) == ("described", "coulomb-level")
    assert (wrong["number"]["name"], wrong["number"]["true"]) == ("coulomb_force_N", 14.2)
    single = next(case for case in by_name.values() if case["stratum"] == "one-effect")
    [effect] = single["effects"]
    assert effect["detectability"] == pytest.approx(min(effect["target"], 4.0 * 1.5), rel=0.25)
    assert single["cells"][0] == ["drive_force_N", "slip", "run-01.csv", 3.0]
    assert next(case for case in by_name.values() if case["stratum"] == "no-gap")["effects"] == []
    outside = next(case for case in by_name.values() if case["stratum"] == "outside")
    assert (outside["verdict"], outside["effects"][0]["name"]) == ("unexplained", "loose-screw")


@pytest.mark.slow
def test_the_same_seed_makes_the_same_evidence_under_other_names(made, tmp_path):
    assert make(tmp_path, out=tmp_path / "again", key=tmp_path / "again.json").exit_code == 0
    first, again = sealing.read_set(made / "set"), sealing.read_set(tmp_path / "again")
    assert not first.keys() & again.keys()
    assert sorted(case.evidence_sha256 for case in first.values()) == sorted(
        case.evidence_sha256 for case in again.values()
    )
    assert {case.answer_sha256 for case in first.values()}.isdisjoint(case.answer_sha256 for case in again.values())


@pytest.mark.slow
def test_bad_arguments_make_nothing(made, tmp_path):
    for other, word in (
        ({"out": tmp_path / "other", "key": tmp_path / "other" / "key.json"}, "must be outside"),
        ({}, "never overwritten"),
        ({"out": tmp_path / "other"}, "never overwritten"),
        ({"out": tmp_path / "other", "key": tmp_path / "k", "cases": 3}, "--cases 3"),
        ({"out": tmp_path / "other", "key": tmp_path / "key.json" / "k"}, "--key"),
    ):
        result = make(tmp_path, **other)
        assert result.exit_code in {2, 5}
        assert word in result.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"set", "key.json", "key.sizes.toml"}
    assert make(tmp_path, out=tmp_path / "other", key=tmp_path / "k", generator="nobody").exit_code == 2
    result = blind("run", tmp_path / "nothing")
    assert result.exit_code == 2
    assert f"{tmp_path / 'nothing' / 'set.json'}: cannot be read" in result.stderr
    result = blind("score", made / "set", "--key", made / "set" / "set.json")
    assert result.exit_code == 2
    assert "must be 'blind-key/1'" in result.stderr


def test_a_generator_that_breaks_leaves_nothing(tmp_path, monkeypatch):
    def broken(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(StandIn, "make", broken)
    assert make(tmp_path).exit_code == FAULTS["INTERRUPTED"].exit_status
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_making_is_taken_up_again(made, tmp_path, monkeypatch):
    options = {"out": tmp_path / "again", "key": tmp_path / "again.json"}
    part = tmp_path / ".again-in-the-making"
    whole = making._one

    def made_three(source, case, folder, known):
        if len(list(folder.parent.iterdir())) == 3:
            (folder / "half").mkdir(parents=True)
            raise KeyboardInterrupt
        return whole(source, case, folder, known)

    monkeypatch.setattr(making, "_one", made_three)
    assert make(tmp_path, **options).exit_code == FAULTS["INTERRUPTED"].exit_status
    kept = {path.stem for path in (part / "answers").iterdir()}
    assert len(kept) == 3
    assert len({path.name for path in (part / "set").iterdir()} - kept) == 1
    result = make(tmp_path, **options, cases=CASES + 1)
    assert result.exit_code == 2
    assert f"{part}: holds the beginnings of" in result.stderr
    again = []
    monkeypatch.setattr(making, "_one", lambda *case: again.append(case[2].name) or whole(*case))

    def no_space(*_arguments, **_options):
        raise OSError(28, "No space left on device")

    # the last step fails: the made cases are kept, and no key exists without its set
    for step in ("write_set", "write_key", "write_sizes"):
        with monkeypatch.context() as broken:
            broken.setattr(making, step, no_space)
            assert make(tmp_path, **options).exit_code == FAULTS["LOG_WRITE"].exit_status
        assert not (tmp_path / "again.json").exists()
    assert make(tmp_path, **options).exit_code == 0
    assert len(again) == CASES - 3
    assert not part.exists()
    first, second = (sealing.read_set(tmp_path / name) for name in ("set", "again"))
    assert second.keys() == kept | set(again)
    assert sorted(case.evidence_sha256 for case in first.values()) == sorted(
        case.evidence_sha256 for case in second.values()
    )
    assert sealing.opened_answers(tmp_path / "again", tmp_path / "again.json")


@pytest.mark.slow
def test_known_sizes_make_the_same_set_without_sizing(made, tmp_path, monkeypatch):
    def sized_again(*_arguments):
        raise AssertionError("was sized again")

    monkeypatch.setattr(making, "known_sizes", lambda _name, _seed: read_sizes(made / "key.sizes.toml"))
    monkeypatch.setattr(making, "size", sized_again)
    result = make(tmp_path, out=tmp_path / "same", key=tmp_path / "same.json")
    assert result.exit_code == 0, result.output
    first, second = (sealing.read_set(folder) for folder in (made / "set", tmp_path / "same"))
    assert sorted(case.evidence_sha256 for case in first.values()) == sorted(
        case.evidence_sha256 for case in second.values()
    )
    assert (tmp_path / "same.sizes.toml").read_bytes() == (made / "key.sizes.toml").read_bytes()
    # the sizes reveal the answers except for the names, so the scores are development data
    assert blind("run", tmp_path / "same", "--jobs", 1).exit_code == 0
    assert "DEVELOPMENT DATA" in blind("score", tmp_path / "same", "--key", tmp_path / "same.json").stdout


def test_that_a_set_was_published_is_sealed_too(made, tmp_path):
    key_table = json.loads((made / "key.json").read_text())
    assert {secret["answer"]["published"] for secret in key_table["cases"].values()} == {False}
    next(iter(key_table["cases"].values()))["answer"]["published"] = True
    (tmp_path / "other.json").write_text(json.dumps(key_table))
    assert blind("score", made / "set", "--key", tmp_path / "other.json").exit_code == FAULTS["SEAL_BROKEN"].exit_status


@pytest.mark.slow
def test_a_run_is_taken_up_again(made):
    names = sorted(answers(made))
    results = made / "set" / "results"
    results.mkdir()
    mine = {"format": "mine", "tool": tool_version()}
    (results / f"{names[0]}.json").write_text(json.dumps(mine))
    assert blind("run", made / "set", "--jobs", 1).exit_code == 0
    assert sorted(path.stem for path in results.iterdir()) == names
    assert json.loads((results / f"{names[0]}.json").read_text()) == mine
    result = json.loads((results / f"{names[1]}.json").read_text())
    assert (result["format"], result["tool"]) == ("diagnosis/3", mine["tool"])
    (results / f"{names[0]}.json").write_text(json.dumps(mine | {"tool": "0.9+of-yesterday"}))
    (results / f"{names[1]}.json").unlink()
    refused = blind("run", made / "set", "--jobs", 1)
    assert refused.exit_code == FAULTS["BAD_SET"].exit_status
    assert f"{names[0]}.json: was made by version 0.9+of-yesterday" in refused.stderr
    assert not (results / f"{names[1]}.json").exists()


@pytest.mark.slow
def test_a_killed_run_keeps_finished_cases(made):
    """Killed politely after its first results: whole files only, and the rest is done later."""
    code = "from tests.unit.bench.blind.test_protocol import slow_run; slow_run()"
    child = subprocess.Popen([sys.executable, "-c", code, str(made / "set")], stderr=subprocess.DEVNULL)
    results = made / "set" / "results"
    while not results.is_dir() or not any(path.suffix == ".json" for path in results.iterdir()):
        assert child.poll() is None
        time.sleep(0.05)
    child.send_signal(signal.SIGTERM)
    assert child.wait(timeout=PATIENCE_S) == FAULTS["INTERRUPTED"].exit_status
    existing = list(results.iterdir())
    assert 0 < len(existing) < CASES
    assert all(json.loads(path.read_text())["verdict"] == "effect" for path in existing)
    before = {path: path.stat().st_mtime_ns for path in existing}
    assert blind("run", made / "set", "--jobs", 1).exit_code == 0
    assert len(list(results.iterdir())) == CASES
    assert {path: path.stat().st_mtime_ns for path in existing} == before


def slow_run() -> None:
    """In another process: the command with a diagnosis whose second case never ends."""
    many.real_diagnose = slow
    sys.argv = ["bench", "blind", "run", sys.argv[1], "--jobs", "1"]
    main(app)


def slow(evidence, progress, jobs, budget_s=None):
    if any(Path(sys.argv[3], "results").glob("*.json")):
        time.sleep(PATIENCE_S)
    return made_up.quick(evidence, progress, jobs)


@pytest.mark.slow
def test_a_case_that_fails_counts_as_wrong(made, monkeypatch):
    monkeypatch.setattr(many, "real_diagnose", refusing)
    assert blind("run", made / "set", "--jobs", 1).exit_code == 0
    result = score(made, "--json", made / "scores.json")
    assert result.exit_code == 0, result.output
    assert f"{CASES} cases ended in a fault and count as wrong" in result.stdout
    tool = json.loads((made / "scores.json").read_text())["methods"]["diagnosis"]
    assert tool["singles"]["top_1"]["value"] == 0.0
    assert tool["false_alarms"]["value"] == 1.0


def refusing(evidence, progress, jobs, budget_s=None):
    raise ZeroDivisionError("nothing to divide by")


@pytest.mark.slow
def test_a_set_is_scored_once(done):
    result = score(done, "--json", done / "scores.json", "--report", done / "report.html")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith(f"{CASES} cases (sealed set, opened once)")
    scores = json.loads((done / "scores.json").read_text())
    assert scores["sealed"] is True
    existing = {name: [effect["name"] for effect in answer["effects"]] for name, answer in answers(done).items()}
    assert {row["case"]: [effect["name"] for effect in row["effects"]] for row in scores["cases"]} == existing
    right = [
        row["first"][0]["effect"] == existing[row["case"]][0] for row in scores["cases"] if row["kind"] == "one-effect"
    ]
    assert sum(right) / len(right) == scores["methods"]["diagnosis"]["singles"]["top_1"]["value"]
    page = (done / "report.html").read_text()
    assert "Does 80 % mean 80 %?" in page
    assert "http" not in page
    opened = json.loads((done / "set" / "opened.json").read_text())
    assert opened.keys() == {"format", "opened_UTC", "results_sha256", "tool"}
    # the same results again are the same score
    assert "sealed set" in score(done).stdout
    path = next((done / "set" / "results").iterdir())
    path.unlink()
    assert blind("run", done / "set", "--jobs", 1).exit_code == 0
    path.write_text(path.read_text().replace('"cpu_s": ', '"cpu_s": 1'))
    again = score(done, "--json", done / "scores.json")
    assert "DEVELOPMENT DATA" in again.stdout
    assert json.loads((done / "scores.json").read_text())["sealed"] is False
    assert json.loads((done / "set" / "opened.json").read_text()) == opened


@pytest.mark.slow
def test_several_sets_are_scored_as_one_and_none_is_opened_without_all_results(tmp_path):
    keys, sets = tmp_path / "keys", tmp_path / "sets"
    keys.mkdir()
    for seed, name in enumerate(("plant", "workshop")):
        assert make(tmp_path, seed=seed, out=sets / name, key=keys / f"{name}.key").exit_code == 0
    assert blind("run", sets / "plant", "--jobs", 1).exit_code == 0
    assert blind("score", sets, "--key", keys).exit_code == FAULTS["BAD_SET"].exit_status
    assert not (sets / "plant" / "opened.json").exists()
    assert blind("run", sets, "--jobs", 1).exit_code == 0
    result = blind("score", sets, "--key", keys, "--json", tmp_path / "scores.json")
    assert result.stdout.startswith(f"{2 * CASES} cases (sealed set, opened once)")
    scores = json.loads((tmp_path / "scores.json").read_text())
    assert {name: one["cases"] for name, one in scores["by_set"].items()} == {"plant": CASES, "workshop": CASES}
    assert all((sets / name / "opened.json").exists() for name in scores["by_set"])


@pytest.mark.slow
def test_rivals_see_the_evidence_alone_and_are_asked_once(done, monkeypatch):
    asked = []

    def answer(folder, _budget_s):
        asked.append(folder.name)
        return {"drive-backlash": 0.9, "none": 0.1, "cpu_s": 4.0}

    monkeypatch.setattr(methods, "methods", lambda: {"lines": methods.Method(answer, ("bench/judge/lines.py",))})
    assert blind("run", done / "set", "--rival", "lines", "--jobs", 1).exit_code == 0
    assert sorted(asked) == sorted(answers(done))
    assert "no such method" in score(done, "--rival", "trees").stderr
    assert not (done / "set" / "opened.json").exists()
    assert score(done, "--rival", "lines", "--json", done / "scores.json").exit_code == 0
    assert len(asked) == CASES
    scores = json.loads((done / "scores.json").read_text())["methods"]["lines"]
    assert (scores["false_alarms"]["value"], scores["cpu_median_s"]["value"]) == (1.0, 4.0)


@pytest.mark.slow
def test_a_damaged_result_is_reported_before_opening(done):
    name = sorted(answers(done))[3]
    path = done / "set" / "results" / f"{name}.json"
    path.write_text(path.read_text()[:50])
    result = score(done)
    assert result.exit_code == FAULTS["BAD_SET"].exit_status
    assert f"{path}: is not a result of a diagnosis; delete it" in result.stderr
    assert not (done / "set" / "opened.json").exists()


@pytest.mark.slow
def test_missing_results_stay_sealed(done):
    name = sorted(answers(done))[3]
    (done / "set" / "results" / f"{name}.json").unlink()
    result = score(done)
    assert result.exit_code == FAULTS["BAD_SET"].exit_status
    assert f"1 of {CASES} cases have no result: {name}" in result.stderr
    assert not (done / "set" / "opened.json").exists()
    assert score(done, "--partial").stdout.startswith(f"{CASES - 1} cases (sealed set")
    assert blind("run", done / "set", "--jobs", 1).exit_code == 0
    assert "DEVELOPMENT DATA" in score(done).stdout


@pytest.mark.slow
def test_changed_answers_and_evidence_are_refused(done):
    key, name = done / "key.json", sorted(answers(done))[0]
    whole = key.read_text()

    def refused(word: str) -> None:
        result = score(done)
        assert result.exit_code == FAULTS["SEAL_BROKEN"].exit_status
        assert word in result.stderr
        assert name in result.stderr
        assert not (done / "set" / "opened.json").exists()

    table = json.loads(whole)
    table["cases"][name]["answer"]["verdict"] = "effect and more"
    key.write_text(json.dumps(table))
    refused("the answer was changed after it was sealed")
    table = json.loads(whole)
    table["cases"][name]["nonce"] = "00" * 16
    key.write_text(json.dumps(table))
    refused("the answer was changed after it was sealed")
    table = json.loads(whole)
    del table["cases"][name]
    key.write_text(json.dumps(table))
    refused("is missing")
    key.write_text(whole)
    with (done / "set" / name / "run-01.csv").open("a") as file:
        file.write("1.0,15.0\n")
    refused("the evidence was changed after it was sealed")


@pytest.mark.slow
def test_an_output_that_cannot_be_written_is_refused_before_opening(done):
    for option in (f"--json={done}", f"--report={done}"):
        result = score(done, option)
        assert result.exit_code == 2
        assert "must be" in result.stderr
    if os.getuid() != 0:
        (done / "locked").mkdir(mode=0o555)
        assert score(done, "--report", done / "locked" / "r.html").exit_code == FAULTS["LOG_WRITE"].exit_status
    assert not (done / "set" / "opened.json").exists()
