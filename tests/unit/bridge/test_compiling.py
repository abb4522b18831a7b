"""How many kernels are left is shown, once for all processes; a signal ends a command at once while they are compiled."""

import os
import signal
import subprocess
import sys

import pytest

from bridge import compiling
from bridge.compiling import Progress, left_in
from bridge.kernel_linking import _called_by
from plant.simulate import run_blocks
from tests.patience import PATIENCE_S


def test_lines_elsewhere_are_few_and_read_by_the_parent(capsys: pytest.CaptureFixture[str]) -> None:
    progress = Progress()
    for left in range(100, -1, -1):
        progress.show(left, 100)
        progress.show(left, 100)
    counts = [left_in(line) for line in capsys.readouterr().err.splitlines()]
    assert len(counts) == 9
    assert counts[0] == (100, 100)
    assert counts[-1] == (0, 100)
    assert left_in("stickslip: loaded") is None


def test_the_count_never_rises_though_more_kernels_are_found(capsys: pytest.CaptureFixture[str]) -> None:
    progress = Progress()
    for left, total in ((8, 8), (4, 8), (10, 16), (3, 16), (0, 16)):
        progress.show(left, total)
    counts = [left_in(line) for line in capsys.readouterr().err.splitlines()]
    assert counts == [(8, 8), (4, 8), (3, 16), (0, 16)]


def test_nothing_is_shown_where_nothing_is_to_be_compiled(capsys: pytest.CaptureFixture[str]) -> None:
    Progress().show(0, 0)
    with compiling.compiling():
        pass
    assert capsys.readouterr().err == ""


def test_a_terminal_has_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    progress = Progress()
    for left in (2, 1, 0):
        progress.show(left, 2)
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1
    assert shown.count("\r") == 3


def test_kernels_are_counted_with_all_that_they_call() -> None:
    names = {getattr(function, "__name__", "") for function in _called_by(run_blocks.py_func)}
    assert {"run_blocks", "advance", "advance_disturbed", "_stribeck_share"} <= names


# a command that compiles for ever, in a call that no signal handler of Python interrupts
COMMAND = """
import ctypes, sys
from bridge.compiling import compiling
from cockpit.run.child_process import end_like_ctrl_c, exit_status_of

def work():
    end_like_ctrl_c()
    with compiling():
        print("begun", flush=True)
        while True:
            ctypes.CDLL(None).sleep(1000)

sys.exit(exit_status_of(work))
"""


@pytest.mark.parametrize(("number", "name"), [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM")])
def test_a_signal_ends_a_command_that_compiles(number: signal.Signals, name: str) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", COMMAND], env=os.environ, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as command:
        assert command.stdout is not None
        assert command.stderr is not None
        assert command.stdout.readline() == "begun\n"
        command.send_signal(number)
        assert command.wait(PATIENCE_S) == 130
        assert f"INTERRUPTED: stopped by {name} while kernels were compiled" in command.stderr.read()


def test_the_end_of_a_time_budget_waits_for_the_end_of_a_compilation() -> None:
    ended: list[int] = []
    handler = signal.signal(signal.SIGALRM, lambda number, _: ended.append(number))
    try:
        with compiling.compiling("a"), compiling.compiling("b"):
            signal.raise_signal(signal.SIGALRM)
            assert not ended
        assert ended == [signal.SIGALRM]
    finally:
        signal.signal(signal.SIGALRM, handler)
