"""A first start: a process that still compiles is reported, and the run waits for it; the wait can be set."""

import re
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from bridge.compiling import PROGRESS
from bridge.faults import Fault
from bridge.plain import LOADED
from cockpit.run import processes
from tests.patience import PATIENCE_S


class Child:
    """Fake of a started process: its role and its present activity."""

    def __init__(self, role: str, still: str = processes.READY, left: tuple[int, int] = (0, 0)) -> None:
        self.role, self.still, self.left = role, still, left


def beginning(log: Path, wait_s: float | None, *children: Any) -> processes.StartWatch:
    return processes.StartWatch(list(children), log, wait_s)


def test_a_starting_process_is_reported_now_and_then(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(processes, "_REPORT_S", 0.0)
    start = beginning(tmp_path / "run.mcap", None, Child("plant"), Child("controller", processes.STARTS))
    time.sleep(0.01)
    start.look()
    assert re.search(r"waiting  the controller still starts, since \d+ s; Ctrl-C ends it", capsys.readouterr().err)


def test_the_kernels_left_are_summed_over_all_processes(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(processes, "_REPORT_S", 0.0)
    plant, controller = (Child(role, processes.COMPILES, (30, 40)) for role in ("plant", "controller"))
    start = beginning(tmp_path / "run.mcap", None, plant, controller)
    for plant.left, controller.left in (((30, 40), (30, 40)), ((0, 40), (20, 40)), ((0, 40), (0, 40))):
        start.look()
    printed = capsys.readouterr().err.splitlines()
    assert printed == [f"stickslip: {PROGRESS}{left} of 80 left" for left in (60, 20, 0)]


def test_nothing_is_reported_once_the_log_has_begun(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(processes, "_REPORT_S", 0.0)
    log = tmp_path / "run.mcap"
    log.write_bytes(b"of the run before")
    start = beginning(log, 0.001, Child("plant"))
    time.sleep(0.01)
    log.write_bytes(b"of this run, which has begun")
    start.look()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("still", "words"),
    [
        (processes.COMPILES, "the plant and the controller still compile after"),
        (processes.STARTS, "the plant and the controller still start after"),
        (processes.READY, "have not connected to each other after"),
    ],
)
def test_after_the_longest_wait_the_fault_names_the_processes_that_are_not_ready(tmp_path, still, words):
    start = beginning(tmp_path / "run.mcap", 0.001, Child("plant", still), Child("controller", still))
    time.sleep(0.01)
    with pytest.raises(Fault, match=rf"NO_PEER: .*{words} .*--wait S"):
        start.look()


def test_the_kernel_progress_of_a_child_is_read_and_reported(monkeypatch, capsys):
    progress = f"print('stickslip: {PROGRESS}3 of 4 left', file=sys.stderr, flush=True)"
    over = f"print('stickslip: {PROGRESS}0 of 4 left', file=sys.stderr, flush=True)"
    more = f"print('other', file=sys.stderr); print('stickslip: {LOADED}', file=sys.stderr)"
    code = f"import sys; sys.stdin.readline(); {progress}; sys.stdin.readline(); {over}; {more}"
    started = processes.subprocess.Popen

    def instead(_words: list[str], **how: Any) -> Any:
        return started([sys.executable, "-c", code], **(how | {"stdin": processes.subprocess.PIPE}))

    monkeypatch.setattr(processes.subprocess, "Popen", instead)
    child = processes.Child("plant", [])
    assert child.still == processes.STARTS
    child.process.stdin.write("\n")
    child.process.stdin.flush()
    until_s = time.monotonic() + PATIENCE_S
    while child.still != processes.COMPILES and time.monotonic() < until_s:
        time.sleep(0.01)
    assert child.still == processes.COMPILES
    assert child.left == (3, 4)
    child.process.stdin.write("\n")
    child.process.stdin.close()
    assert child.process.wait(PATIENCE_S) == 0
    child._reader.join(PATIENCE_S)
    assert child.still == processes.READY
    assert child.left == (0, 4)
    assert capsys.readouterr().err == ""  # the parent shows the kernels left of all its children
