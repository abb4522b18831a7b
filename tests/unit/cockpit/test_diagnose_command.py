"""Output and files of `stickslip diagnose` for one folder and for many, with a fake diagnosis."""

import json
import os
import signal
import sys
from pathlib import Path
from typing import ClassVar

import pytest
from typer.testing import CliRunner

from bridge.faults import FAULTS
from bridge.results import strict_json
from cockpit.cli import app
from cockpit.fleet import work
from diagnosis import diagnose_many as many
from diagnosis.deadline import OutOfTimeError
from tests import made_up


@pytest.fixture(autouse=True)
def stand_in(monkeypatch):
    monkeypatch.setattr(many, "real_diagnose", made_up.quick)
    monkeypatch.setattr(work, "tool_version", lambda: "1.0+abc")  # reads the whole package, for a second


def diagnose(*arguments):
    return CliRunner().invoke(app, ["diagnose", *map(str, arguments)])


def folders(at: Path, *names: str) -> Path:
    for name in names:
        made_up.evidence_folder(at / name)
    return at


def pages(at: Path) -> set[str]:
    return {name for name in files(at) if name.endswith(".html")}


def files(at: Path) -> set[str]:
    return {str(path.relative_to(at)) for path in at.rglob("*") if path.is_file()}


def test_one_folder_prints_six_lines_the_verdict_first(tmp_path):
    result = diagnose(folders(tmp_path, "rig") / "rig")
    assert result.exit_code == 0
    assert tuple(result.stdout.splitlines()) == made_up.diagnosis().summary
    assert "off by 6 noise floors" in result.stderr


def test_all_prints_candidates_relations_and_data_below_the_answer(tmp_path):
    lines = diagnose(folders(tmp_path, "rig") / "rig", "--all").stdout.splitlines()
    assert tuple(lines[:6]) == made_up.diagnosis().summary
    assert lines[6] == "candidates drive-backlash                   95 %   gap 81 µm (90 %: 76 to 86)"
    after = next(i for i, line in enumerate(lines) if line.startswith("gap "))
    assert lines[after : after + 4] == [
        "gap        6.2 as described",
        "           1.08 with drive-backlash, 98 % closed",
        "           3.1 with drive-hardening, 57 % closed",
        "           5.9 with baseline, 0 % closed",
    ]
    assert lines[after + 4 : after + 11] == [
        "relations  spring relation: 0.8 N as described, 0.3 N refitted, noise 12 mN",
        "             drive-backlash 73 % (90 %: 61 % to 92 %); chance alone shows up to 12 %",
        "             noise 25 %",
        "             unexplained 2 % (90 %: 0 % to 5 %)",
        "           base: left out: run-01.parquet has no base_accel_mps2",
        "numbers    mass 1.497 kg, described 1.5 kg",
        "           drive stiffness 11.01 kN/m, described 11.7 kN/m",
    ]
    assert lines[-3:] == [
        "next       Play shows as a stretch without force at each reversal; hardening does not.",
        "data       run-01.parquet: base_accel_mps2: missing: what the piezo delivers cannot be seen",
        "           run-02.parquet: drive_force_N: 12 samples at 20 N were left out",
    ]


def test_one_folder_writes_json_report_and_rig(tmp_path, monkeypatch):
    rigs = []

    class Apply:
        RIG_BEGINS = "#"
        NO_RIG: ClassVar = {}

        @staticmethod
        def refuse_force_drive(evidence):
            assert evidence.rig.drive == "spring"

        @staticmethod
        def write_rig(diagnosis, evidence, path):
            rigs.append((diagnosis.effects, evidence.folder.name, path.name))

    monkeypatch.setitem(sys.modules, "diagnosis.report.rig_file", Apply)
    folders(tmp_path, "rig")
    out = tmp_path / "new" / "folder"
    options = ("--json", out / "a.json", "--report", out / "a.html", "--apply", out / "a.toml", "--jobs", 3)
    result = diagnose(tmp_path / "rig", *options)
    assert result.exit_code == 0, result.output
    assert files(out) == {"a.json", "a.html"}
    written = json.loads((out / "a.json").read_text())
    assert written["format"] == "diagnosis/3"
    assert written["elapsed_s"] == 3.0  # the fake diagnosis puts the number of jobs here
    assert rigs == [(("drive-backlash",), "rig", "a.toml")]
    assert "Diagnosis of rig" in (out / "a.html").read_text()


def test_json_on_stdout_is_nothing_but_json(tmp_path):
    result = diagnose(folders(tmp_path, "rig") / "rig", "--json", "-")
    assert json.loads(result.stdout, parse_constant=pytest.fail)["effects"] == ["drive-backlash"]
    interval = json.loads(result.stdout)["candidates"][2]["parameters"]["damping_Ns_per_m"]["interval_90"]
    assert interval == [None, None]


def test_json_has_no_numbers_that_json_does_not_know():
    assert strict_json({"a": (float("nan"), 1), "b": [float("-inf"), None, "x", True]}) == {
        "a": [None, 1],
        "b": [None, None, "x", True],
    }


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("in its place", "in its place/manifest.toml: is a folder, must be a file; "),
        ("run in its place", "run-01.csv: is a folder, must be a file; "),
        ("long run", "cannot be read: File name too long; "),
    ],
)
def test_evidence_that_cannot_be_looked_at_is_bad_and_ends_no_other(name, why, tmp_path):
    folders(tmp_path, "rig")
    (tmp_path / "in its place" / "manifest.toml").mkdir(parents=True)
    (tmp_path / "run in its place" / "run-01.csv").mkdir(parents=True)
    (tmp_path / "run in its place" / "manifest.toml").write_text(made_up.MANIFEST)
    (tmp_path / "long run").mkdir()
    (tmp_path / "long run" / "manifest.toml").write_text(made_up.MANIFEST.replace("run-01", "x" * 300))
    result = diagnose(tmp_path / name)
    assert result.exit_code == 2
    assert why in result.stderr
    assert result.stderr.startswith("stickslip: BAD_EVIDENCE: ")
    result = diagnose(tmp_path / name, tmp_path / "rig", "--jobs", 1)
    assert result.exit_code == 2
    assert "rig: effect: drive-backlash" in result.stdout
    assert why in result.stdout


@pytest.mark.parametrize(
    ("name", "why"),
    [("absent", "no such folder; "), ("file.txt", "no folder; "), ("x" * 300, "cannot be read: File name too long; ")],
)
def test_missing_evidence_is_reported_before_the_work(name, why, tmp_path, monkeypatch):
    monkeypatch.chdir(folders(tmp_path, "rig", "rig2"))
    Path("file.txt").touch()
    monkeypatch.setattr(many, "real_diagnose", made_up.endless)
    result = diagnose("rig", "rig2", "--jobs", 1, name)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"stickslip: BAD_EVIDENCE: {name}: {why}")


def test_an_option_that_would_be_the_name_of_a_file_is_refused_before_the_work(tmp_path, monkeypatch):
    monkeypatch.chdir(folders(tmp_path, "rig"))
    result = diagnose("rig", "--report", "--jobs", "1")
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert "--report --jobs: takes a file, but --jobs is an option" in result.stderr
    assert diagnose("rig", "--report", tmp_path / "--jobs.html").exit_code == 0
    assert "--jobs.html" in files(tmp_path)


@pytest.mark.parametrize("option", ["--json", "--report", "--apply"])
def test_a_name_too_long_to_be_written_is_reported_before_the_work(option, tmp_path, monkeypatch):
    monkeypatch.setattr(many, "real_diagnose", made_up.endless)
    result = diagnose(folders(tmp_path, "rig") / "rig", option, tmp_path / f"{'x' * 251}.json")
    assert result.exit_code == FAULTS["LOG_WRITE"].exit_status
    assert result.stderr.startswith(
        f"stickslip: LOG_WRITE: {tmp_path / ('x' * 251)}.json: cannot be written: File name too long"
    )


@pytest.mark.parametrize("where", ["absent", "refused"])
def test_bad_evidence_writes_nothing(where, tmp_path):
    folders(tmp_path, "refused")
    before = files(tmp_path)
    options = ("--json", tmp_path / "out" / "a.json", "--report", tmp_path / "out" / "a.html")
    result = diagnose(tmp_path / where, *options)
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1].startswith("stickslip: BAD_EVIDENCE: ")
    assert files(tmp_path) == before
    assert not (tmp_path / "out").exists()


def test_bad_evidence_as_json_on_stdout(tmp_path):
    result = diagnose(tmp_path / "absent", "--json", "-")
    assert result.exit_code == 2
    assert json.loads(result.stdout)["fault"] == "BAD_EVIDENCE"


@pytest.mark.slow
def test_a_folder_of_folders_gives_every_result_in_order(tmp_path):
    folders(tmp_path / "all", "c", "a", "refused", "b-broken")
    (tmp_path / "all" / "no evidence").mkdir()
    out = tmp_path / "out"
    result = diagnose(tmp_path / "all", "--json", out / "a.json", "--report", out / "reports", "--jobs", 1)
    assert result.exit_code == 2
    assert [line.split(":")[0] for line in result.stdout.splitlines()] == [
        "a",
        "b-broken",
        "c",
        "refused",
        f"reports    {out}/reports/index.html",
    ]
    assert "b-broken: DIAGNOSIS_BROKE: ZeroDivisionError: nothing to divide by (made_up.py, line" in result.stdout
    assert "4 of 4: refused: BAD_EVIDENCE: run-01.csv: too short" in result.stderr
    assert pages(out) == {"reports/a.html", "reports/c.html", "reports/index.html"}
    written = json.loads((out / "a.json").read_text())
    assert written["format"] == "diagnoses/3"
    results = {result["evidence"]: result for result in written["results"]}
    assert results["a"]["diagnosis"]["verdict"] == "effect"
    assert results["refused"]["fault"] == {"fault": "BAD_EVIDENCE", "line": "run-01.csv: too short"}


def test_a_broken_program_is_not_reported_as_bad_evidence(tmp_path):
    folders(tmp_path, "a", "broken")
    assert diagnose(tmp_path, "--jobs", 1).exit_code == FAULTS["DIAGNOSIS_BROKE"].exit_status


@pytest.mark.slow
def test_folders_of_the_same_name_keep_apart(tmp_path):
    folders(tmp_path, "one/rig", "two/rig", "two/other")
    sources = many.find_sources([tmp_path / "one", tmp_path / "two", tmp_path / "two" / "rig"])
    assert [source.name for source in sources] == [str(tmp_path / "one/rig"), "other", str(tmp_path / "two/rig")]
    result = diagnose(tmp_path / "one", tmp_path / "two", "--report", tmp_path / "out", "--jobs", 1)
    assert result.exit_code == 0
    assert len(pages(tmp_path / "out")) == 3 + 1


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (["--json", "folder.json"], "CONFIG"),
        (["--report", "rig/run-01.csv/report.html"], "LOG_WRITE"),
        (["rig2", "--apply", "rig.toml"], "CONFIG"),
        (["rig2", "--report", "rig/run-01.csv"], "CONFIG"),
        (["--report", "rig/report.pdf"], "CONFIG"),
        (["--json=rig/run-01.csv"], "CONFIG"),
        (["--apply", "rig/manifest.toml"], "CONFIG"),
        (["--apply", "mine.toml"], "CONFIG"),
        (["--json", "a.json", "--report", "./a.json"], "CONFIG"),
        (["--report", "-"], "CONFIG"),
        (["--apply", "-"], "CONFIG"),
    ],
)
def test_an_output_that_cannot_be_written_is_reported_before_the_work(options, code, tmp_path, monkeypatch):
    folders(tmp_path, "rig", "rig2")
    (tmp_path / "folder.json").mkdir()
    (tmp_path / "mine.toml").write_text("mine = 1\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(many, "real_diagnose", made_up.endless)
    result = diagnose("rig", *options)
    assert result.exit_code == FAULTS[code].exit_status
    assert f"stickslip: {code}: {options[-2] if len(options) > 1 else options[0]}" in result.stderr


@pytest.mark.slow
def test_a_cluster_address_of_another_form_is_one_line(tmp_path):
    result = diagnose(folders(tmp_path, "rig") / "rig", "--cluster", "foo")
    assert result.exit_code == 2
    assert "CONFIG: --cluster foo: must be tcp://HOST:PORT; write for example tcp://127.0.0.1:8786" in result.stderr


def test_a_cluster_without_the_package_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = diagnose(folders(tmp_path, "rig") / "rig", "--cluster", "tcp://127.0.0.1:1")
    assert result.exit_code == 2
    assert "CONFIG: --cluster: needs the package distributed" in result.stderr


def test_interrupted_is_130_and_writes_nothing(tmp_path, monkeypatch):
    def interrupted(evidence, progress, jobs, budget_s=None):
        os.kill(os.getpid(), signal.SIGTERM)
        raise AssertionError("not interrupted")

    monkeypatch.setattr(many, "real_diagnose", interrupted)
    result = diagnose(folders(tmp_path, "rig") / "rig", "--json", tmp_path / "a.json")
    assert result.exit_code == 130
    assert "stopped by SIGTERM" in result.output
    assert not (tmp_path / "a.json").exists()


def test_ctrl_c_prints_the_best_answer_so_far_and_writes_it(tmp_path, monkeypatch):
    def ended(evidence, progress, jobs, budget_s=None):
        with pytest.raises(OutOfTimeError):
            os.kill(os.getpid(), signal.SIGINT)
        return made_up.diagnosis()._replace(verdict="not-finished", effects=(), pictures=())

    monkeypatch.setattr(many, "real_diagnose", ended)
    options = ("--json", tmp_path / "a.json", "--apply", tmp_path / "a.toml")
    result = diagnose(folders(tmp_path, "rig") / "rig", *options)
    assert result.exit_code == 130
    assert "rig file   not written: no cause was tried, so no effect can be applied" in result.stdout
    assert json.loads((tmp_path / "a.json").read_text())["verdict"] == "not-finished"
    assert not (tmp_path / "a.toml").exists()


def test_an_estimate_of_the_time_comes_first(tmp_path):
    result = diagnose(folders(tmp_path, "rig") / "rig", "--jobs", 2, "--budget", "30s")
    assert result.stderr.splitlines()[0] == "the simulated fits of 1 s take about 0 to 1 s, 30 s at most"


@pytest.mark.slow
def test_an_interrupted_fleet_reports_how_to_continue(tmp_path, monkeypatch):
    def interrupted(sources, *_):
        yield many.FolderResult(sources[0], made_up.diagnosis(), None)
        raise KeyboardInterrupt

    monkeypatch.setattr(many, "diagnose_many", interrupted)
    out = tmp_path / "out"
    result = diagnose(folders(tmp_path / "all", "a", "b"), "--report", out)
    assert result.exit_code == 130
    assert f"1 of 2 are in {out}; run the same command again to continue" in result.stderr
    assert json.loads((out / "index.json").read_text())["left"] == ["b"]
