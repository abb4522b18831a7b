"""Compilation of hot code: numba, cached on disk, without the flags that change bits."""

import atexit
import errno
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numba
import numpy as np
import numpy.typing as npt

P = ParamSpec("P")
R = TypeVar("R")

# A record: one element of a numpy structured array, `array[0]`, read and written by field name. Both numba and the plain
# interpreter accept a record. A kernel call costs 0.5 us with records and 8.5 us with NamedTuples of the same 70 numbers
# (docs/decisions/1-records-not-namedtuples.md), and the bytes of a record are the snapshot that the log keeps.
Record = Any


PACKAGES = ("bridge", "controller", "plant", "diagnosis")  # with kernels, or with constants that kernels freeze


def sources_digest(root: Path) -> str:
    """A hash over every source file of PACKAGES below `root`, sub-packages included.

    Numba renews a cached kernel when the kernel's own file changes, but not when a kernel that it calls changes. Without this
    hash, plant/core.py would run the old contact after an edit of plant/contact.py.
    """
    digest = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    """The cache folder of this version of the kernels' sources."""
    # not `Path.home`, which fails for a user without a home
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(home) / "stickslip" / sources_digest(Path(__file__).parent.parent)


def _usable(folder: Path) -> Path:
    """The folder; when it is not writable, a temporary one for this process and its children, removed when this one ends."""
    try:
        if str(folder).startswith("~"):  # not expanded: a folder of that name would be made where the command is called
            raise OSError(errno.ENOENT, "its home is not known")
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        own = tempfile.mkdtemp(prefix="stickslip-kernels-")
        atexit.register(shutil.rmtree, own, ignore_errors=True)
        os.environ[_CACHE] = own
        line = (
            f"stickslip: {folder}: {error.strerror}: compiled kernels cannot be kept, so every command compiles them anew, "
            f"which takes up to a minute; set {_CACHE} to a folder that can be written to"
        )
        print(line, file=sys.stderr)
        return Path(own)
    return folder


_CACHE = "NUMBA_CACHE_DIR"
_settings: Any = numba.config  # pyright: ignore[reportPrivateImportUsage]
_settings.CACHE_DIR = str(_usable(Path(os.environ.get(_CACHE) or _cache_folder())))


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function`. With `NUMBA_DISABLE_JIT=1` it runs interpreted, with the same bits.

    `fastmath` stays off and kernels use `math.*` on scalars: fast maths and numpy's vector maths both change the last bit, and
    replay guarantees equal bits. With numpy's rules for division (1 / 0 is infinite) numba checks no divisor.
    """
    compiled: Any = numba.njit(cache=True, fastmath=False, error_model="numpy")(function)
    return compiled


def record(dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """One zeroed record of `dtype`, with fields as attributes in compiled and interpreted kernels alike."""
    return np.zeros(1, np.dtype((np.record, dtype)))
