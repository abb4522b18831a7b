"""A compiled kernel is renewed with every source that it can hang on, and with no other."""

import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from bridge import kernel_cache
from bridge.kernel_cache import ROOT, compile_once, mark_of, sources_digest
from tests.patience import PATIENCE_S


def digest(root: Path) -> str:
    sources_digest.cache_clear()
    kernel_cache._imported.cache_clear()
    return sources_digest(root / "plant" / "core.py", root)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    sources = {
        "plant/__init__.py": "",
        "plant/core.py": "from plant.contact import step\nfrom plant.effects import (\n    friction,\n    drive as d,\n)\n",
        "plant/contact.py": "import bridge.units\n",
        "plant/effects/__init__.py": "",
        "plant/effects/friction.py": "def late():\n    from plant.effects.rigs.four import LANES\n",
        "plant/effects/drive.py": "",
        "plant/effects/rigs/four.py": "LANES = 4\n",
        "plant/node.py": "from plant.core import advance\n",
        "bridge/units.py": "",
        "cockpit/app.py": "from plant.rig.node import PlantNode\n",
    }
    for name, text in sources.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    "place",
    [
        *("plant/core.py", "plant/__init__.py", "plant/contact.py", "bridge/units.py"),
        *("plant/effects/__init__.py", "plant/effects/friction.py", "plant/effects/drive.py"),
        "plant/effects/rigs/four.py",
    ],
)
def test_the_imports_of_a_kernel_are_in_its_key_in_any_sub_package(project: Path, place: str) -> None:
    before = digest(project)
    (project / place).write_text((project / place).read_text() + "STEP_S = 2e-5\n")
    assert digest(project) != before


@pytest.mark.parametrize("place", ["plant/node.py", "cockpit/app.py"])
def test_an_edit_elsewhere_recompiles_nothing(project: Path, place: str) -> None:
    before = digest(project)
    (project / place).write_text("STEP_S = 2e-5\n")
    assert digest(project) == before


def test_the_kernels_of_the_plant_hang_on_no_command_and_no_diagnosis() -> None:
    files = kernel_cache._closure(ROOT / "plant" / "step.py", ROOT)
    assert {ROOT / "plant/contact.py", ROOT / "plant/effects/friction.py", ROOT / "bridge/kernel.py"} <= files
    assert not [path for path in files if path.parts[len(ROOT.parts)] in {"cockpit", "diagnosis", "controller"}]


def test_two_copies_of_the_project_have_separate_marks(project: Path) -> None:
    copy = shutil.copytree(project, project.with_name("copy"))
    own, other = mark_of("x", project / "plant/core.py", project), mark_of("x", copy / "plant/core.py", copy)
    assert own != other
    assert own.rpartition("-")[2] == other.rpartition("-")[2]  # of the same sources


@pytest.mark.slow
def test_one_process_compiles_and_the_others_wait_and_report_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    code = """
from pathlib import Path
from bridge.kernel_cache import compile_once
from plant.core import advance

def compiles():
    Path("%s", "compiled").write_text("by the other")

compiles.__module__ = "plant.core"
compile_once("a test", compiles)
"""
    begun, go_on = threading.Event(), threading.Event()

    def slowly() -> None:
        begun.set()
        assert go_on.wait(PATIENCE_S)

    first = threading.Thread(target=compile_once, args=("a test", slowly))
    first.start()
    assert begun.wait(PATIENCE_S)
    with subprocess.Popen(
        [sys.executable, "-c", code % tmp_path], cwd=ROOT, env=os.environ, stderr=subprocess.PIPE, text=True
    ) as other:
        assert other.stderr is not None
        assert "another process compiles the kernels of a test: waiting for it" in other.stderr.readline()
        assert not (tmp_path / "compiled").exists()
        go_on.set()
        assert other.wait(PATIENCE_S) == 0
    first.join()
    assert (tmp_path / "compiled").read_text() == "by the other"
