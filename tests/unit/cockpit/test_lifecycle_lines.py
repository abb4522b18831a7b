"""Lifecycle messages of a process, printed without blocking on a terminal."""

import threading

import pytest

from cockpit.run import child_process as module
from cockpit.run.child_process import step_reports
from tests.patience import PATIENCE_S


def test_lines_are_printed_in_order_and_all_before_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    with step_reports(quiet=False) as report:
        report("waiting", "for a rig")
        report("running", "\x1b[2J")
    assert capsys.readouterr().err == "waiting  for a rig\nrunning  \\x1b[2J\n"


def test_a_child_of_a_run_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with step_reports(quiet=True) as report:
        report("waiting", "for a rig")
    assert capsys.readouterr().err == ""


def test_a_stalled_terminal_blocks_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    goes_on, over = threading.Event(), threading.Event()

    def print_line(_line: str) -> None:
        goes_on.wait(PATIENCE_S)
        over.set()

    monkeypatch.setattr(module, "print_line", print_line)
    monkeypatch.setattr(module, "_LAST_LINES_S", 0.05)
    with step_reports(quiet=False) as report:
        for _ in range(100):
            report("running", "x")
    assert not over.is_set()
    goes_on.set()
