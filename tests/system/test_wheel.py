"""The wheel: it holds all that the packages need, and is small without extras."""

import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

from bridge.faults import FAULTS
from tests import made_up
from tests.system.ports import free_endpoint

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PACKAGES = ("bridge", "cockpit", "controller", "diagnosis", "plant")
BASE_MB = 640.0  # 634 on 30 November 2026: llvmlite 173, scipy 143, numpy 73, matplotlib with fonts and pictures 94, our code 11
INSTALLER = {"pip", "setuptools", "pkg_resources"}  # 27 MB, which a new environment holds before any installation


def run(*command: str | Path, cwd: Path, status: int = 0, **more: str) -> str:
    """Stdout of a command that has to end with that exit status, without the environment of the checkout."""
    usual = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(command, cwd=cwd, env=usual | more, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == status, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder, cwd=ROOT)
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_holds_every_file_of_the_packages_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as file:
        held = {name for name in file.namelist() if ".dist-info/" not in name}
    listed = run(
        "git", "ls-files", "--cached", "--others", "--exclude-standard", *PACKAGES, "deploy", cwd=ROOT
    ).splitlines()
    assert held == {f"cockpit/{name}" if name.startswith("deploy/") else name for name in listed}


def test_the_content_of_the_wheel_runs_in_an_empty_folder(wheel: Path, tmp_path: Path) -> None:
    unpacked, empty = tmp_path / "unpacked", tmp_path / "empty"
    empty.mkdir()
    zipfile.ZipFile(wheel).extractall(unpacked)
    # interpreted: the kernels at another path would be compiled again, for half a minute, and never used
    output = run(
        sys.executable, "-P", "-m", "cockpit", "run", "--in-process", "--scenario", "from-the-start", "--set", "duration_s=0.05",
        cwd=empty, status=FAULTS["NOT_JUDGED"].exit_status, PYTHONPATH=str(unpacked), NUMBA_DISABLE_JIT="1",
    )  # fmt: skip
    assert "data     whole: 50 blocks" in output
    where = run(
        sys.executable, "-P", "-c", "import cockpit; print(cockpit.__file__)", cwd=empty, PYTHONPATH=str(unpacked)
    )
    assert Path(where.strip()).is_relative_to(unpacked)


def installed(at: Path, requirement: str) -> Path:
    """The bin folder of a new environment with the requirements, from the package index."""
    venv.create(at, with_pip=True)
    run(at / "bin" / "python", "-m", "pip", "install", "--quiet", requirement, cwd=at)
    return at / "bin"


@pytest.mark.nightly
@pytest.mark.timeout(1800)  # downloads
def test_a_fresh_installation_is_small_and_runs(wheel: Path, tmp_path: Path) -> None:
    at = installed(tmp_path / "base", str(wheel))
    (packages,) = (tmp_path / "base" / "lib").glob("python*/site-packages")
    ours = [each for each in packages.iterdir() if each.name.split("-")[0] not in INSTALLER]
    files = [path for each in ours for path in (each, *each.rglob("*")) if path.is_file()]
    assert sum(path.stat().st_blocks * 512 for path in files) < BASE_MB * 2**20
    output = run(
        at / "stickslip", "run", "--lockstep", "--scenario", "from-the-start", "--set", "duration_s=1",
        "--set", "rig.drive.stiffness_N_per_m=3e5", "--endpoint", free_endpoint(), cwd=tmp_path, NUMBA_CACHE_DIR=str(tmp_path),
    )  # fmt: skip
    assert "data     whole: 1000 blocks" in output


@pytest.mark.nightly
@pytest.mark.timeout(1800)  # downloads
def test_a_fresh_installation_with_all_diagnoses(wheel: Path, tmp_path: Path) -> None:
    made_up.evidence_folder(tmp_path / "evidence")
    at = installed(tmp_path / "all", f"{wheel}[all]")
    output = run(at / "stickslip", "diagnose", "evidence", "--jobs", "2", cwd=tmp_path, NUMBA_CACHE_DIR=str(tmp_path))
    assert output.startswith("unexplained")
