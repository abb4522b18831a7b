"""A first start: a process that still compiles is reported, and the run waits for it; the wait can be set."""

import re
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from bridge.compiling import PROGRESS
from bridge.faults import Fault
from cockpit.run import processes
from tests.patience import PATIENCE_S


class Child:
    """Fake of a started process with its kernels left to compile."""

    def __init__(self, left: tuple[int, int] = (0, 0)) -> None:
        self.left = left


def beginning(log: Path, wait_s: float | None, *children: Any) -> processes.StartWatch:
    return processes.StartWatch(list(children), log, wait_s)


def test_a_run_that_has_not_begun_is_reported_now_and_then(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(processes, "_REPORT_S", 0.0)
    start = beginning(tmp_path / "run.mcap", None, Child(), Child())
    time.sleep(0.01)
    start.look()
    assert re.search(
        r"waiting  plant, controller and recorder have not connected to each other, since \d+ s; Ctrl-C ends it",
        capsys.readouterr().err,
    )


def test_the_kernels_left_are_summed_over_all_processes(tmp_path, capsys):
    plant, controller = Child((30, 40)), Child((30, 40))
    start = beginning(tmp_path / "run.mcap", None, plant, controller)
    for plant.left, controller.left in (((30, 40), (30, 40)), ((0, 40), (20, 40)), ((0, 40), (0, 40))):
        start.look()
    printed = capsys.readouterr().err.splitlines()
    assert printed == [f"stickslip: {PROGRESS}{left} of 80 left" for left in (60, 20, 0)]


def test_nothing_is_reported_once_the_log_has_begun(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(processes, "_REPORT_S", 0.0)
    log = tmp_path / "run.mcap"
    log.write_bytes(b"of the run before")
    start = beginning(log, 0.001, Child())
    time.sleep(0.01)
    log.write_bytes(b"of this run, which has begun")
    start.look()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("left", "words"), [(3, "kernels are still compiled"), (0, "have not connected to each other")]
)
def test_after_the_longest_wait_the_fault_gives_the_reason(tmp_path, left, words):
    start = beginning(tmp_path / "run.mcap", 0.001, Child((left, 4)), Child())
    time.sleep(0.01)
    with pytest.raises(Fault, match=rf"NO_PEER: .*{words} after .*--wait S"):
        start.look()


def test_the_kernel_progress_of_a_child_is_read_and_reported(monkeypatch, capsys):
    progress = f"print('stickslip: {PROGRESS}3 of 4 left', file=sys.stderr, flush=True)"
    over = f"print('stickslip: {PROGRESS}0 of 4 left', file=sys.stderr, flush=True)"
    code = (
        f"import sys; sys.stdin.readline(); {progress}; sys.stdin.readline(); {over}; print('other', file=sys.stderr)"
    )
    started = processes.subprocess.Popen

    def instead(_words: list[str], **how: Any) -> Any:
        return started([sys.executable, "-c", code], **(how | {"stdin": processes.subprocess.PIPE}))

    monkeypatch.setattr(processes.subprocess, "Popen", instead)
    child = processes.Child("plant", [])
    child.process.stdin.write("\n")
    child.process.stdin.flush()
    until_s = time.monotonic() + PATIENCE_S
    while not child.left[0] and time.monotonic() < until_s:
        time.sleep(0.01)
    assert child.left == (3, 4)
    child.process.stdin.write("\n")
    child.process.stdin.close()
    assert child.process.wait(PATIENCE_S) == 0
    child._reader.join(PATIENCE_S)
    assert child.left == (0, 4)
    assert capsys.readouterr().err == ""  # the parent shows the kernels left of all its children
