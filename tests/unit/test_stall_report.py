"""A test that fails while the computer stalls: reported, and by CI not counted."""

import subprocess
import sys
from pathlib import Path

import pytest

from bridge.wire.pauses import Pause
from tests.stall_report import LEAST_NS, _Thread, words

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
# replaces the timers: the computer stalls during each test with `stalled` in its name
CONFTEST = """
from bridge.wire.pauses import Pause
from tests import stall_report

class Watch:
    seen = []

    def poll(self):
        found, self.seen[:] = list(self.seen), []
        return found

    def close(self):
        pass

class Named:
    refused = ""
    poll, close = Watch().poll, Watch().close

stall_report.PauseWatch = Named

def pytest_runtest_call(item):
    if "stall" in item.name:
        Watch.seen.append(Pause(0, SECONDS * 1_000_000_000))
"""
TESTS = """
def test_good(): pass
def test_good_with_stall(): pass
def test_bad_with_stall(): raise ValueError("late")
"""


@pytest.mark.parametrize(
    ("more", "option", "seconds", "status", "expected"),
    [
        ("", "--excuse-stalls", 1, 0, "NOT JUDGED test_made_up.py::test_bad_with_stall: the computer stalled 1 time"),
        ("", "--stalls", 1, 1, "during test_made_up.py::test_bad_with_stall: stalled 1 time, longest 1000 ms"),
        ("", "--excuse-stalls", 0, 1, "computer never stalled for 20 ms"),
        ("def test_bad(): raise ValueError", "--excuse-stalls", 1, 1, "computer stalled 2 times"),
    ],
)
def test_only_a_failure_during_a_stall_is_excused(
    tmp_path: Path, more: str, option: str, seconds: int, status: int, expected: str
) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST.replace("SECONDS", str(seconds)))
    (tmp_path / "test_made_up.py").write_text(TESTS + more)
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "tests.stall_report",
        "--rootdir",
        tmp_path,
        "-c",
        tmp_path / "pytest.ini",
    ]
    done = subprocess.run([*command, option, tmp_path], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stdout
    assert expected in done.stdout
    assert ("ValueError: late" in done.stdout) or status == 0


def test_a_thread_sees_that_it_woke_late(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.stall_report.LEAST_NS", 0)
    thread = _Thread()
    while not (found := thread.poll()):
        pass
    thread.close()
    assert found[0].until_ns > found[0].from_ns


def test_stalls_are_counted_and_the_longest_is_named() -> None:
    assert words([Pause(0, LEAST_NS), Pause(0, 2 * LEAST_NS)]) == "stalled 2 times, longest 40 ms"
