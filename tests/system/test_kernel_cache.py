"""Compiled kernels: a first start of several runs at once, and where nothing can be kept, as in a container without a home."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bridge.compiling import PROGRESS
from bridge.plain import ANOTHER_COMPILES
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint

pytestmark = pytest.mark.slow

COMPILES = """
import math, subprocess, sys
import numba
from plant.four_rigs_step import decayed
assert math.isclose(decayed(0.5), math.expm1(-0.5))
started = "import numba, bridge.kernel; print(numba.config.CACHE_DIR)"
print(numba.config.CACHE_DIR, subprocess.run([sys.executable, "-c", started], capture_output=True, text=True).stdout)
"""


@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "HOME"])
def test_without_a_folder_to_write_to_kernels_are_compiled_for_one_command(tmp_path, variable):
    (tmp_path / "file").touch()
    usual = {name: value for name, value in os.environ.items() if name not in {"XDG_CACHE_HOME", "NUMBA_CACHE_DIR"}}
    nowhere = str(tmp_path / "file" / "cache")
    done = subprocess.run(
        [sys.executable, "-c", COMPILES],
        env=usual | {variable: nowhere, "TMPDIR": str(tmp_path)},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert nowhere in done.stderr
    assert "set NUMBA_CACHE_DIR" in done.stderr
    assert done.stderr.count("\n") == 1
    own, of_what_it_started = done.stdout.split()
    assert own == of_what_it_started
    assert Path(own).parent == tmp_path
    assert not Path(own).exists()  # nothing is left behind


def test_a_user_without_a_home_gets_no_folder_of_that_name(tmp_path):
    """As a container's user of a number that no file lists."""
    code = """
import pwd

def nobody(number):
    raise KeyError(number)

pwd.getpwuid = nobody
import bridge.kernel
"""
    usual = {name: value for name, value in os.environ.items() if name in {"PATH", "PYTHONPATH"}}
    done = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env=usual | {"TMPDIR": str(tmp_path)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=True,
    )
    assert "the home folder is unknown" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.nightly
def test_two_first_starts_at_once_compile_each_set_once_and_report_no_missing_process(tmp_path):
    cache = tmp_path / "cache"
    fast = (
        "--scenario",
        "from-the-start",
        "--lockstep",
        "--set",
        "duration_s=1",
        "--set",
        "rig.drive.stiffness_N_per_m=3e5",
    )  # in lockstep a busy computer changes nothing but the time it takes
    begun = [
        subprocess.Popen(
            [sys.executable, "-m", "cockpit", "run", *fast, "--endpoint", free_endpoint(), "--log", tmp_path / name],
            env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
            cwd=Path(__file__).parents[2],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        for name in ("one.mcap", "other.mcap")
    ]
    errors = [process.communicate(timeout=PATIENCE_S)[1] for process in begun]
    assert [process.returncode for process in begun] == [0, 0], errors
    lines = "".join(errors).splitlines()
    assert any(PROGRESS in line for line in lines), lines
    for role in ("plant", "controller"):
        assert sum(f"{ANOTHER_COMPILES}the {role}: waiting for it" in line for line in lines) == 1, lines
        # the second process loads the kernels that the first has kept, and writes nothing
        done = next(cache.glob(f"the {role}-*")).stat().st_mtime_ns
        assert all(path.stat().st_mtime_ns <= done for path in cache.glob(f"{role}_*/*.nbc"))
    assert not [line for line in lines if "have not connected to each other" in line]
