"""The limit that keeps `make quick` quick."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
TESTS = """
import time
import pytest

def work():
    began_s = time.process_time()
    while time.process_time() - began_s < 0.4:
        pass

def test_cheap():
    time.sleep(0.4)

def test_dear():
    work()

@pytest.mark.slow
def test_dear_and_marked():
    work()
"""


@pytest.mark.parametrize(
    ("limits", "status", "message"),
    [
        (("--cpu-each", "0.3"), 1, "s of CPU: must be 0.3 s at most; do it with less, or mark it slow"),
        (("--cpu-all", "0.6"), 1, "must be 0.6 s at most"),
        (("--cpu-each", "30", "--cpu-all", "60"), 0, "3 passed"),
    ],
)
def test_a_test_over_its_cpu_limit_fails(tmp_path, limits, status, message):
    (tmp_path / "test_made_up.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n  slow: costs much\n")
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "tests.cpu_limit",
        "--rootdir",
        tmp_path,
        "-c",
        tmp_path / "pytest.ini",
    ]
    done = subprocess.run([*command, *limits, tmp_path], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stdout
    assert message in done.stdout
    if "--cpu-all" not in limits:
        assert "1 error" in done.stdout
        assert "ERROR at teardown of test_dear " in done.stdout
