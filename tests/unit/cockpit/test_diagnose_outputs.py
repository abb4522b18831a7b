"""Files that `stickslip diagnose` writes, and its answer where they cannot be written, with a fake diagnosis."""

import json
import os

import pytest

from bridge.faults import FAULTS
from bridge.files import write_whole
from diagnosis import diagnose_many as many
from tests import made_up
from tests.unit.cockpit.test_diagnose_command import diagnose, folders, pages, stand_in  # noqa: F401


def test_the_answer_is_printed_whatever_cannot_be_written(tmp_path):
    """A folder appears at the place of the JSON during the diagnosis: report and text are still written."""

    def in_the_way(evidence, progress, jobs, budget_s=None):
        (tmp_path / "a.json").mkdir()
        return made_up.quick(evidence, progress, jobs)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(many, "real_diagnose", in_the_way)
        result = diagnose(
            folders(tmp_path, "rig") / "rig", "--json", tmp_path / "a.json", "--report", tmp_path / "a.html"
        )
    assert result.exit_code == FAULTS["LOG_WRITE"].exit_status
    assert f"LOG_WRITE: {tmp_path / 'a.json'}: cannot be written" in result.stderr
    assert result.stdout.startswith("effect: drive-backlash")
    assert f"report     {tmp_path / 'a.html'}" in result.stdout
    assert (tmp_path / "a.html").stat().st_size > 1000


def test_a_link_stays_one_and_a_device_is_written_into(tmp_path):
    (tmp_path / "link.json").symlink_to(tmp_path / "there.json")
    assert diagnose(folders(tmp_path, "rig") / "rig", "--json", tmp_path / "link.json").exit_code == 0
    assert (tmp_path / "link.json").is_symlink()
    assert json.loads((tmp_path / "there.json").read_text())["verdict"] == "effect"
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_whole(tmp_path / "pipe", "all of it")
    assert os.read(reader, 100) == b"all of it"
    os.close(reader)
    assert (tmp_path / "pipe").is_fifo()


@pytest.mark.slow
def test_a_folder_whose_name_is_not_utf_8_is_reported_and_the_others_go_on(tmp_path):
    """Old archives of Windows hold such names; neither the reader of CSV nor a report accepts them."""
    odd = tmp_path / os.fsdecode(b"m\xe4rz")
    made_up.evidence_folder(odd)
    folders(tmp_path, "rig")
    result = diagnose(odd)
    assert result.exit_code == 2
    assert "m\\xe4rz: its name is not UTF-8; rename it" in result.stderr
    result = diagnose(odd, tmp_path / "rig", "--report", tmp_path / "out", "--jobs", 1)
    assert result.exit_code == 2
    assert "rig: effect: drive-backlash" in result.stdout
    assert "m\\xe4rz: BAD_EVIDENCE: " in result.stdout


def test_one_folder_given_twice_is_one(tmp_path):
    rig = folders(tmp_path, "rig") / "rig"
    for _ in range(2):  # a second call replaces the output of the first
        assert diagnose(rig, rig, "--apply", tmp_path / "found.toml").exit_code == 0
    assert (tmp_path / "found.toml").is_file()


@pytest.mark.slow
def test_a_report_that_cannot_be_written_ends_no_other(tmp_path):
    """A folder at the place of one report: the others, the JSON and the text are written; the exit status is a fault."""
    folders(tmp_path / "all", "a", "b", "c")
    out = tmp_path / "out"
    (out / "b.html").mkdir(parents=True)
    (out / "b.html" / "full").touch()
    result = diagnose(tmp_path / "all", "--json", "-", "--report", out, "--jobs", 1)
    assert result.exit_code == FAULTS["LOG_WRITE"].exit_status
    assert f"LOG_WRITE: {out / 'b.html'}: cannot be written" in result.stderr
    assert pages(out) == {"a.html", "c.html", "index.html"}
    assert (out / "b.html/full").is_file()
    assert [one["evidence"] for one in json.loads(result.stdout)["results"]] == ["a", "b", "c"]


def test_json_on_stdout_stays_one_whatever_else_cannot_be_written(tmp_path, monkeypatch):
    def in_the_way(evidence, progress, jobs, budget_s=None):
        (tmp_path / "a.html").mkdir()
        return made_up.quick(evidence, progress, jobs)

    monkeypatch.setattr(many, "real_diagnose", in_the_way)
    result = diagnose(folders(tmp_path, "rig") / "rig", "--json", "-", "--report", tmp_path / "a.html")
    assert result.exit_code == FAULTS["LOG_WRITE"].exit_status
    assert json.loads(result.stdout)["effects"] == ["drive-backlash"]
    assert "LOG_WRITE" in result.stderr


@pytest.mark.slow
def test_every_report_has_a_unique_name_that_a_disk_accepts(tmp_path):
    long = "ä" * 120
    folders(tmp_path, "a_b/rig", "a/b/rig", f"c/{long}", f"d/{long}")
    given = [tmp_path / "a_b/rig", tmp_path / "a/b/rig", tmp_path / "c" / long, tmp_path / "d" / long]
    result = diagnose(*given, "--report", tmp_path / "out", "--jobs", 1)
    assert result.exit_code == 0
    assert len(pages(tmp_path / "out")) == 4 + 1
