"""The provenance in pages and pictures."""

import hashlib
import os
from datetime import UTC, datetime
from pathlib import Path

import pytest

from bridge.provenance import COMMAND, provenance, shown_name
from cockpit.figures.run_figure import draw_logs
from cockpit.review.page import write_review
from diagnosis.report.page import write_report
from tests import made_up
from tests.logs import short_log


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "run.csv"
    path.write_bytes(b"t;F\n0;1\n")
    return path


def test_it_is_version_date_command_and_hashes(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    before = COMMAND.set(["look", "my file.csv"])
    made = provenance([file, file])
    COMMAND.reset(before)
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    assert made.inputs == [("run.csv", digest)]
    assert made.in_words() == (
        f"stickslip {made.version}, 2023-11-14 22:13:20 UTC; stickslip look 'my file.csv'; run.csv (SHA-256 {digest[:12]}...)"
    )
    assert made.metadata(".pdf", "a title")["CreationDate"] == made.date


@pytest.mark.parametrize("epoch", ["", "soon", "²", "-5", "9" * 30])
def test_without_a_usable_epoch_the_date_is_now(epoch: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
    assert abs((datetime.now(UTC) - provenance().date).total_seconds()) < 5.0


def test_names_are_text_that_every_format_can_hold() -> None:
    assert shown_name(os.fsdecode(b"m\xe4rz\x1b[2J.mcap")) == "m\\xe4rz\\x1b[2J.mcap"


@pytest.mark.slow
def test_a_report_has_the_hashes_of_its_evidence_and_no_markup_of_a_name(file: Path, tmp_path: Path) -> None:
    odd = file.with_name("<i>.csv")
    file.rename(odd)
    write_report(made_up.diagnosis(), "rig", tmp_path / "report.html", [odd])
    page = (tmp_path / "report.html").read_text()
    digest = hashlib.sha256(odd.read_bytes()).hexdigest()
    assert f"&lt;i&gt;.csv: SHA-256 <code>{digest}</code>" in page
    assert "<i>.csv" not in page


@pytest.mark.slow
def test_a_log_of_any_name_is_drawn_and_has_a_page(tmp_path: Path) -> None:
    log = tmp_path / os.fsdecode(b"m\xe4rz $x_{$ \x1b.mcap")
    log.write_bytes(short_log())
    draw_logs([log, log], tmp_path / "x.svg")
    assert "m\\xe4rz $x_{$ \\x1b.mcap" in (tmp_path / "x.svg").read_text()
    write_review([log], tmp_path / "x.html")
    assert "<title>m\\xe4rz $x_{$ \\x1b.mcap: " in (tmp_path / "x.html").read_text()
