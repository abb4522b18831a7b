"""Compiled kernels where nothing can be kept: a read-only home, a container's user without one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

COMPILES = """
import math, subprocess, sys
import numba
from plant.four_rigs_step import gone
assert math.isclose(gone(0.5), math.expm1(-0.5))
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
        timeout=120,
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
        timeout=60,
        check=True,
    )
    assert "its home is not known" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
