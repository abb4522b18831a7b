"""A first start: who still compiles is told, and a run waits for it; the wait can be set."""

import sys
import time
from pathlib import Path
from typing import Any

import pytest

from bridge.faults import Fault
from bridge.plain import COMPILED, COMPILING, LOADED
from cockpit.run import processes
from tests.patience import PATIENCE_S


class Child:
    """As a process that was started: its role, and what it still does."""

    def __init__(self, role: str, still: str = processes.READY) -> None:
        self.role, self.still = role, still


def beginning(log: Path, wait_s: float | None, *children: Any) -> processes.Beginning:
    return processes.Beginning(list(children), log, wait_s)


def test_who_still_compiles_is_told_now_and_then(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(processes, "_TOLD_S", 0.0)
    start = beginning(
        tmp_path / "run.mcap", None, Child("plant", processes.COMPILES), Child("controller", processes.STARTS)
    )
    time.sleep(0.01)
    start.look()
    assert (
        "waiting  the plant still compiles, the controller still starts, since 0 s; Ctrl-C ends it"
        in capsys.readouterr().err
    )


def test_nothing_is_told_once_the_log_has_begun(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(processes, "_TOLD_S", 0.0)
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
        (processes.READY, "have not found each other after"),
    ],
)
def test_after_the_longest_wait_the_fault_says_who_is_not_ready(tmp_path, still, words):
    start = beginning(tmp_path / "run.mcap", 0.001, Child("plant", still), Child("controller", still))
    time.sleep(0.01)
    with pytest.raises(Fault, match=rf"NO_PEER: .*{words} .*--wait S"):
        start.look()


def test_what_a_child_says_of_its_kernels_is_heard_and_told(monkeypatch, capsys):
    said = f"print('stickslip: {COMPILING}the plant, once', file=sys.stderr, flush=True)"
    over = f"print('stickslip: {COMPILED}the plant', file=sys.stderr, flush=True)"
    more = f"print('other', file=sys.stderr); print('stickslip: {LOADED}', file=sys.stderr)"
    code = f"import sys; sys.stdin.readline(); {said}; sys.stdin.readline(); {over}; {more}"
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
    child.process.stdin.write("\n")
    child.process.stdin.close()
    assert child.process.wait(PATIENCE_S) == 0
    child._reader.join(PATIENCE_S)
    assert child.still == processes.READY
    told = capsys.readouterr().err
    assert f"{COMPILING}the plant" in told
    assert COMPILED not in told
