"""A kernel that is kept on disk runs on the layout that it was compiled for, whichever process kept it."""

import os
import subprocess
import sys
from pathlib import Path

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
    for hits, one in (("0", "code.twice"), ("1", "code.twice"), ("1", "code.longer")):
        command = [sys.executable, "-c", CALLED.replace("{one}", one)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        # one compilation for both values in the source
        assert done.stdout.split() == ["1.75", "1", hits]
