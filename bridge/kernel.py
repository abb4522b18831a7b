"""Compilation of hot code: numba, cached on disk, without the flags that change bits."""

import hashlib
import importlib
import os
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import numba
import numpy as np
import numpy.typing as npt
from llvmlite.binding import get_host_cpu_features

from bridge.kernel_cache import FOLDER, usable_folder
from bridge.kernel_linking import Kernel, SharedKernel

P = ParamSpec("P")
R = TypeVar("R")

# A record: one element of a numpy structured array, `array[0]`, read and written by field name. Both numba and the plain
# interpreter accept a record. A kernel call costs 0.5 us with records and 8.5 us with NamedTuples of the same 70 numbers
# (docs/decisions/1-records-not-namedtuples.md), and the bytes of a record are the snapshot that the log keeps.
Record = Any

_settings: Any = numba.config  # pyright: ignore[reportPrivateImportUsage]
_settings.CACHE_DIR = os.environ[FOLDER] = str(usable_folder())  # for this process and its children
# colouring thousands of messages that numba alone reads takes 3 % of a compilation
_settings.DISABLE_ERROR_MESSAGE_HIGHLIGHTING = True
_settings.CACHE_LOCATOR_CLASSES = "bridge.kernel_cache.SourcesLocator"


def _named_by_content(layout: Any) -> tuple[str, tuple[str]]:
    """The name of a layout in the symbols of compiled kernels.

    Numba takes a number there that each process counts anew (`Record.mangling_args`). So two processes may keep kernels for two
    lengths of a block under one symbol, and a third one that loads both runs the one on the samples of the other.
    """
    return "Record", (hashlib.sha256(str(layout).encode()).hexdigest()[:16],)


_layouts: Any = numba.types.Record
_layouts.mangling_args = property(_named_by_content)


def _written_once(layout: Any, write: Callable[[Any], str] = _layouts.__repr__) -> str:
    """The text of a layout, kept with it: numba asks for it 9000 times for the controller, 8 % of its compilation."""
    kept: dict[str, str] = layout.__dict__
    if "text" not in kept:
        kept["text"] = write(layout)
    return kept["text"]


_layouts.__repr__ = _written_once

# As it loads its first kernel, numba imports SciPy's linear algebra to see whether it could compile a product of matrices: 0.3 s
# of CPU in every process that controls, simulates or replays. Where numba compiles such a product it imports it all the same.
_linear_algebra: Any = importlib.import_module("numba.np.linalg")
_ask: Any = _linear_algebra.ensure_blas
_linear_algebra.ensure_blas = lambda: None
importlib.import_module("numba.np.arraymath")
_linear_algebra.ensure_blas = _ask


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function`, as a part of each kernel that calls it. With `NUMBA_DISABLE_JIT=1` it runs interpreted: equal bits.

    `fastmath` stays off and kernels use `math.*` on scalars: fast maths and numpy's vector maths both change the last bit, and
    replay guarantees equal bits. With numpy's rules for division (1 / 0 is infinite) numba checks no divisor.
    """
    compiled: Any = function if _settings.DISABLE_JIT else Kernel(function)
    return compiled


def shared_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, and compiled once for all kernels that call it: for a step that runs in several loops.

    A call costs some 50 ns more than the call of a `kernel`. The function must be found in its module under its own name.
    """
    compiled: Any = function if _settings.DISABLE_JIT else SharedKernel(function)
    return compiled


def unlocked_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, and other threads of Python go on while it runs: for calls of a millisecond and more."""
    compiled: Any = function if _settings.DISABLE_JIT else Kernel(function, unlocked=True)
    return compiled


def has_wide_vectors() -> bool:
    """Whether the processor that kernels are compiled for has registers of eight float64 (AVX-512)."""
    return bool(get_host_cpu_features().get("avx512f"))


def record(dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """One zeroed record of `dtype`, with fields as attributes in compiled and interpreted kernels alike."""
    return np.zeros(1, np.dtype((np.record, dtype)))
