"""The installed command in a foreign folder, next to files with the names of its packages."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from bridge.faults import FAULTS, install
from cockpit.run.child_process import EXTRA_MODULES
from tests import made_up
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
STICKSLIP = Path(sys.executable).with_name("stickslip")
# packages of the project, and modules that its packages, joblib and Python import before anything else
SHORT = "--scenario from-the-start --set duration_s=0.5 --set rig.drive.stiffness_N_per_m=3e5"  # the slide follows its drive
NAMES = ("bridge", "cockpit", "controller", "diagnosis", "joblib", "json", "numpy", "plant", "scipy", "typing")


@pytest.fixture
def crowded(tmp_path: Path) -> Path:
    """A folder of foreign modules; an import of one ends the process."""
    for name in NAMES:
        (tmp_path / f"{name}.py").write_text(f"raise SystemExit('{name}.py of the folder was imported')\n")
    return tmp_path


def call(folder: Path, *arguments: str, status: int = 0, search: Path | None = None) -> str:
    """Stdout of the command, which has to end with that exit status.

    Args:
        search: a folder of modules that come before the installed ones, in child processes too.

    """
    env = os.environ | ({} if search is None else {"PYTHONPATH": str(search)})
    done = subprocess.run(
        [STICKSLIP, *arguments], cwd=folder, env=env, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == status, done.stderr
    return done.stdout


def test_a_run_in_a_folder_with_files_of_the_same_names(crowded: Path) -> None:
    words = f"run --lockstep {SHORT} --endpoint {free_endpoint()}"
    output = call(crowded, *words.split())
    assert "data     whole: 500 blocks" in output


@pytest.mark.nightly  # 14 s of CPU; the run before has processes in such a folder, too
def test_workers_of_a_diagnosis_in_a_folder_with_files_of_the_same_names(crowded: Path) -> None:
    """Each worker reports the gaps of its evidence: a whole diagnosis in the same workers would take half a minute."""
    for name in ("first", "second"):
        (made_up.evidence_folder(crowded / name) / "run-01.csv").unlink()
    output = call(crowded, "diagnose", "first", "second", "--jobs", "2", status=FAULTS["BAD_EVIDENCE"].exit_status)
    assert output.count("run-01.csv") == 2


# all in one process, where importing costs its two seconds once; `--lockstep` starts plant, controller and recorder
BASE = """
import sys
from cockpit.cli import app
from cockpit.live import operator

for line in sys.argv[1:]:
    try:
        app(line.split())
    except SystemExit as ended:
        if ended.code:
            sys.exit(f"{line}: {ended.code}")
"""


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    """A folder that hides all that only extras bring."""
    folder = tmp_path / "hidden"
    folder.mkdir()
    for name in (*EXTRA_MODULES, "dask", "distributed", "hypothesis", "mujoco", "pandas", "sklearn"):
        (folder / f"{name}.py").write_text(f"raise ModuleNotFoundError('No module named {name}', name='{name}')\n")
    return folder


def test_a_plain_installation_needs_no_extra(tmp_path: Path, plain: Path) -> None:
    guide = (ROOT / "docs/guides/your-first-test.md").read_text(encoding="utf-8")
    (tmp_path / "first.toml").write_text(guide.split("```toml\n")[1].split("```")[0])
    lines = [
        f"run --in-process {SHORT} --log run.mcap",
        f"run --lockstep {SHORT} --log bus.mcap --endpoint {free_endpoint()}",
        "replay run.mcap",
        "log info run.mcap",
        "log check run.mcap",
        "log recover run.mcap --out whole.mcap",
        "plot run.mcap",
        "review run.mcap",
        "test first.toml --jobs 2 --html tests.html --junit tests.xml",
        "scenarios",
        "explain",
    ]
    done = subprocess.run(
        [sys.executable, "-P", "-c", BASE, *lines], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(plain)},
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run.png").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("diagnose", "evidence"),
        ("log", "export", "run.mcap", "--to", "run.csv"),
        ("log", "import", "run.csv", "--map", "map.toml", "--out", "evidence"),
        ("reproduce",),
    ],
    ids=lambda arguments: " ".join(arguments[:2]),
)
def test_a_command_names_the_extra_that_is_missing(tmp_path: Path, plain: Path, arguments: tuple[str, ...]) -> None:
    kind = FAULTS["MISSING_EXTRA"]
    env = os.environ | {"PYTHONPATH": str(plain)}
    done = subprocess.run(
        [STICKSLIP, *arguments], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == kind.exit_status
    assert re.fullmatch(
        rf"stickslip: MISSING_EXTRA: this command needs (\w+), which is not installed; {re.escape(install('all'))}\n",
        done.stderr,
    )
    assert done.stdout == ""


def test_the_missing_extra_as_json(tmp_path: Path, plain: Path) -> None:
    kind = FAULTS["MISSING_EXTRA"]
    output = call(tmp_path, "reproduce", "--json", status=kind.exit_status, search=plain)
    assert json.loads(output) == {
        "fault": kind.code,
        "line": f"this command needs jinja2, which is not installed; {install('all')}",
        "exit_status": kind.exit_status,
    }


def test_everything_in_the_extras_is_documented() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert extras["all"] == ["stickslip[diagnosis,tables]"]
    names = {re.split(r"[\[>=]", line)[0] for line in (*extras["diagnosis"], *extras["tables"])}
    modules = {name.replace("-", "_").removesuffix("_support") for name in names - {"stickslip"}}
    assert modules == EXTRA_MODULES
