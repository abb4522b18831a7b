"""A kernel that is kept on disk runs on the layout that it was compiled for, whichever process kept it."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numba
import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[3]
# the inner kernel is too long to become a part of the outer one: that finds it by its symbol
STEPS = "\n    ".join(f"total = 0.5 * total + math.sin(total + {k}.0)" for k in range(60))
KERNELS = f"""
import math
import sys
import numpy as np
from bridge.kernel import kernel, record

@kernel
def last(r):
    total = r.samples[0]
    {STEPS}
    return r.samples[r.samples.shape[0] - 1] + 0.0 * total

@kernel
def summed(rs, times):
    total = 0.0
    for _ in range(times):
        total += last(rs[0])
    return total

for count in map(int, sys.argv[1:]):
    one = record(np.dtype([("samples", "f8", (count,))]))
    one["samples"][0, -1] = count
    print(summed(one, 2))
"""


def test_two_processes_keep_kernels_for_two_lengths_of_a_block(tmp_path: Path) -> None:
    script = tmp_path / "kernels.py"
    script.write_text(KERNELS)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}

    def lasts(*counts: int) -> list[float]:
        command = [sys.executable, str(script), *map(str, counts)]
        done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        return [float(line) for line in done.stdout.split()]

    assert lasts(100) == [200.0]
    assert lasts(40) == [80.0]
    assert lasts(100, 40) == [200.0, 80.0]


SHARED = """
from bridge.kernel import kernel, shared_kernel

@shared_kernel
def longer(x, by):
    return x + 1.0 / by

@kernel
def twice(x):
    return longer(longer(x, 2), 4)
"""
CALLED = (
    "import shared_code as code; print(code.twice(1.0), len(code.longer.overloads), sum({one}._cache_hits.values()))"
)


def test_a_shared_kernel_is_compiled_once_and_loaded_before_its_callers(tmp_path: Path) -> None:
    (tmp_path / "shared_code.py").write_text(SHARED)
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path]),
    }
    for hits, signature in (("0", "code.twice"), ("1", "code.twice"), ("1", "code.longer")):
        command = [sys.executable, "-c", CALLED.replace("{one}", signature)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        # one compilation for both values in the source
        assert done.stdout.split() == ["1.75", "1", hits]


LATER = """
from plant.four_rigs_step import decayed
decayed(0.5)
import controller.core
from bridge.kernel_cache import ROOT, sources_digest
stamp = controller.core.step._cache._cache_file._source_stamp
print(stamp == sources_digest(ROOT / "controller" / "core.py").encode())
"""


def test_a_kernel_defined_after_a_compilation_depends_on_all_its_sources(tmp_path: Path) -> None:
    """Numba resets its configuration at the first compilation: a stale kernel then called an address that no longer existed."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    environment.pop("NUMBA_CACHE_DIR", None)  # set by `bridge.kernel`: a change of numba's environment
    command = [sys.executable, "-c", LATER]
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"


def test_no_numba_is_installed_whose_internals_may_differ() -> None:
    """The bound may rise where these tests pass with the next version: numba promises nothing about classes that link kernels."""
    major, minor = map(int, numba.__version__.split(".")[:2])
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    assert f"numba>={major}.{minor},<{major}.{minor + 1}" in needed


def test_a_process_that_loads_kernels_does_not_import_linear_algebra() -> None:
    """Numba would import it with the first kernel; where it compiles a product of matrices it still does."""
    code = (
        "import sys, bridge.kernel, numba.np.arraymath as of_arrays, numba.np.linalg as of_matrices\n"
        "assert 'scipy.linalg' not in sys.modules\n"
        "of_matrices.ensure_blas()\n"
        "assert 'scipy.linalg' in sys.modules and of_arrays._HAVE_BLAS"
    )
    subprocess.run([sys.executable, "-P", "-c", code], check=True)
