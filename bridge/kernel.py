"""Compilation of hot code: numba, cached on disk, without the flags that change bits."""

import hashlib
import importlib
import math
import os
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import numba
import numpy as np
from llvmlite.binding import get_host_cpu_features

from bridge.arrays import Records
from bridge.kernel_cache import FOLDER, usable_folder
from bridge.kernel_linking import Kernel, SharedKernel

P = ParamSpec("P")
R = TypeVar("R")

# A record: one element of a numpy structured array, `array[0]`, read and written by field name. Both numba and the plain
# interpreter accept a record. A kernel call costs 0.5 us with records and 8.5 us with NamedTuples of the same 70 numbers
# (docs/decisions/1-records-not-namedtuples.md), and the bytes of a record are the snapshot that the log keeps. `bridge.layouts`
# names the layouts with known fields; this name is for parts of records, such as the samples of a channel.
Record = Any

_settings: Any = numba.config  # pyright: ignore[reportPrivateImportUsage]
_settings.CACHE_DIR = os.environ[FOLDER] = str(usable_folder())  # for this process and its children
# highlighting thousands of internal error messages takes 3 % of a compilation
os.environ["NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING"] = "1"


def _named_by_content(layout: Any) -> tuple[str, tuple[str]]:
    """The name of a layout in the symbols of compiled kernels.

    Numba uses a number there that each process counts from 0 (`Record.mangling_args`). Two processes may then cache kernels for
    two block lengths under one symbol, and a third process that loads both would run a kernel on samples of the wrong length.
    """
    return "Record", (hashlib.sha256(str(layout).encode()).hexdigest()[:16],)


_layouts: Any = numba.types.Record
_layouts.mangling_args = property(_named_by_content)


def _written_once(layout: Any, write: Callable[[Any], str] = _layouts.__repr__) -> str:
    """The text of a layout, cached: numba asks for it 9000 times for the controller, 8 % of its compilation."""
    kept: dict[str, str] = layout.__dict__
    if "text" not in kept:
        kept["text"] = write(layout)
    return kept["text"]


_layouts.__repr__ = _written_once

# On loading its first kernel, numba imports SciPy's linear algebra to check whether it could compile a matrix product: 0.3 s of
# CPU in every process that controls, simulates or replays. A kernel with a matrix product still triggers the import.
_linear_algebra: Any = importlib.import_module("numba.np.linalg")
_check_for_library: Any = _linear_algebra.ensure_blas
_linear_algebra.ensure_blas = lambda: None
importlib.import_module("numba.np.arraymath")
_linear_algebra.ensure_blas = _check_for_library


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function`, once in each kernel that calls it. With `NUMBA_DISABLE_JIT=1` it runs interpreted, with equal bits.

    `fastmath` stays off and kernels use `math.*` on scalars: fast maths and numpy's vector maths both change the last bit, and
    replay guarantees equal bits. With numpy's rules for division (1 / 0 is infinite) numba checks no divisor.
    """
    compiled: Any = function if _settings.DISABLE_JIT else Kernel(function)
    return compiled


def shared_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, but compiled once for all kernels that call it: for a step that runs in several loops.

    A call takes about 50 ns longer than a call of a `kernel`. The module must hold the function under the function's name.
    """
    compiled: Any = function if _settings.DISABLE_JIT else SharedKernel(function)
    return compiled


def unlocked_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, but without Python's lock (GIL), so that other threads run: for calls of 1 ms and more."""
    compiled: Any = function if _settings.DISABLE_JIT else Kernel(function, unlocked=True)
    return compiled


@kernel
def hypot(a: float, b: float) -> float:
    """The root of a^2 + b^2. The last bit of `math.hypot` differs between compiled and interpreted kernels."""
    return math.sqrt(a * a + b * b)


def has_wide_vectors() -> bool:
    """Whether the processor that kernels are compiled for has registers of eight float64 (AVX-512)."""
    return bool(get_host_cpu_features().get("avx512f"))


def record(dtype: np.dtype[Any]) -> Records:
    """One zeroed record of `dtype`, with fields as attributes in compiled and interpreted kernels alike."""
    return np.zeros(1, np.dtype((np.record, dtype)))
