"""The installed command where a stranger calls it: beside files that have the names of its packages."""

import subprocess
import sys
from pathlib import Path

import pytest

from bridge.faults import FAULTS
from tests import made_up
from tests.system.ports import free_endpoint

STICKSLIP = Path(sys.executable).with_name("stickslip")
# packages of the project, and modules that its packages, joblib and Python import before anything else
NAMES = ("bridge", "cockpit", "controller", "diagnosis", "joblib", "json", "numpy", "plant", "scipy", "typing")


@pytest.fixture
def crowded(tmp_path: Path) -> Path:
    """A folder of somebody's own modules; one that is imported ends its process."""
    for name in NAMES:
        (tmp_path / f"{name}.py").write_text(f"raise SystemExit('{name}.py of the folder was imported')\n")
    return tmp_path


def call(folder: Path, *arguments: str, status: int = 0) -> str:
    """What the command says on stdout; it has to end with that exit status."""
    done = subprocess.run([STICKSLIP, *arguments], cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == status, done.stderr
    return done.stdout


def test_a_run_in_a_folder_with_files_of_the_same_names(crowded: Path) -> None:
    said = call(crowded, "run", "--lockstep", "--set", "duration_s=0.5", "--endpoint", free_endpoint())
    assert "blocks   500, none lost" in said


def test_workers_of_a_diagnosis_in_a_folder_with_files_of_the_same_names(crowded: Path) -> None:
    """Each worker says what its evidence lacks: a whole diagnosis in the same workers would take half a minute."""
    for name in ("first", "second"):
        (made_up.evidence_folder(crowded / name) / "run-01.csv").unlink()
    said = call(crowded, "diagnose", "first", "second", "--jobs", "2", status=FAULTS["BAD_EVIDENCE"].exit_status)
    assert said.count("run-01.csv") == 2
