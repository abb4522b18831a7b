"""The verdict file of a log: written whole or not at all, never on other bytes, never in place of another file."""

import json
from pathlib import Path

import pytest

from bridge.faults import Fault
from bridge.log.check.log_check import check_log
from bridge.log.recover import recover
from bridge.log.runlog import RunLog
from bridge.log.storage.checksums import checksums_in_words, checksums_of
from bridge.log.storage.verdict_file import verdict_path, write_verdict
from cockpit.judge.judged import judge
from cockpit.run.run import keep_aside, run_scenario
from cockpit.run.writable import LOG, check_output
from tests.logs import short_log
from tests.unit.bridge.test_log_files import rotated


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A log with a verdict on it."""
    log = tmp_path / "run.mcap"
    log.write_bytes(short_log())
    write_verdict(log, checksums_of(log).sha256, {"good": True, "headline": "no stick-slip"})
    return log


def changed(path: Path) -> list[str]:
    return [finding.text for finding in check_log(path).findings if finding.kind in {"changed", "verdict"}]


def test_a_verdict_is_on_these_bytes_or_reported(path: Path) -> None:
    assert json.loads(verdict_path(path).read_text())["headline"] == "no stick-slip"
    assert path.read_bytes() == short_log()
    assert (checksums_of(path).verdict, changed(path)) == ("fits", [])
    path.write_bytes(short_log()[:-1])
    assert checksums_of(path).verdict == "differs"
    assert "run.verdict.json belongs to other bytes" in changed(path)[0]
    assert "bytes of the log were changed after it was written or judged" in judge(path).doubts


def test_a_log_without_a_verdict_is_reported(path: Path) -> None:
    verdict_path(path).unlink()
    check = check_log(path)
    assert (check.findings, check.checksums.verdict) == ([], "none")
    assert "no verdict is stored" in checksums_in_words(check.checksums)


@pytest.mark.parametrize("text", ["", "[]", '{"log_sha256": "12"}', '{"good": true}', "{" * 2000])
def test_a_file_without_a_digest_is_a_finding(path: Path, text: str) -> None:
    verdict_path(path).write_text(text)
    assert checksums_of(path).verdict == "unreadable"
    assert changed(path) == ["holds no verdict of a run, or was damaged; remove it"]


def test_a_verdict_inside_a_log_of_version_0_2_is_known(tmp_path: Path) -> None:
    log = RunLog(tmp_path / "old.mcap", lockstep=True)
    log.add_metadata("verdict", {"good": True})
    log.close()
    assert check_log(log.path).checksums.verdict == "inside"


def test_one_verdict_covers_all_files_of_a_log(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rotated(path)
    write_verdict(path, checksums_of(path).sha256, {})
    assert checksums_of(path).verdict == "fits"
    (tmp_path / "run-0002.mcap").unlink()
    assert checksums_of(path).verdict == "differs"


def test_a_new_log_and_a_recovered_log_have_no_verdict_of_the_old_bytes(path: Path, tmp_path: Path) -> None:
    recover(path, path)
    assert checksums_of(path).verdict == "none"
    write_verdict(path, checksums_of(path).sha256, {})
    source = tmp_path / "source.mcap"
    source.write_bytes(short_log())
    recover(source, path)
    assert not verdict_path(path).exists()
    write_verdict(path, checksums_of(path).sha256, {})
    RunLog(path, lockstep=True).close()
    assert not verdict_path(path).exists()


def test_a_log_that_is_kept_aside_keeps_its_verdict(path: Path) -> None:
    keep_aside(path)
    (aside,) = path.parent.glob("run-*.mcap")
    assert checksums_of(aside).verdict == "fits"
    assert sorted(file.name for file in path.parent.iterdir()) == sorted([aside.name, f"{aside.stem}.verdict.json"])


def test_another_file_of_that_name_is_not_lost(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    verdict_path(path).write_text('{"mine": 1}')
    path.write_bytes(short_log())
    for act in (lambda: check_output("--log", path, LOG), lambda: write_verdict(path, "0" * 64, {})):
        with pytest.raises(Fault, match=r"CONFIG: .*run.verdict.json exists and was not written by this command"):
            act()
    assert path.read_bytes() == short_log()
    RunLog(path, lockstep=True).close()
    assert verdict_path(path).read_text() == '{"mine": 1}'


def test_a_run_stores_its_verdict(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    outcome = run_scenario("from-the-start", ["duration_s=0.3"], lockstep=True, in_process=True, log=path)
    table = json.loads(verdict_path(path).read_text())
    assert table["log_sha256"] == outcome.verdict.checksums.sha256
    assert table["good"] is outcome.verdict.good
    assert table["figures"]["blocks"] == 300
    assert outcome.verdict.checksums == checksums_of(path)
    assert outcome.verdict.checksums.verdict == "fits"


def test_a_verdict_that_cannot_be_written_is_a_fault_and_loses_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "run.mcap"
    monkeypatch.setattr("bridge.log.storage.verdict_file.write_json", full)
    with pytest.raises(Fault, match=r"LOG_WRITE: .*run.verdict.json: the verdict cannot be written: No space left"):
        run_scenario("from-the-start", ["duration_s=0.3"], lockstep=True, in_process=True, log=path)
    assert "control  " in capsys.readouterr().err
    assert (check_log(path).checksums.damaged, check_log(path).checksums.verdict) == ([], "none")
