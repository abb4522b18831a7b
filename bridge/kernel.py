"""How hot code is compiled: numba, cached on disk, without the flags that change bits."""

import atexit
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

# A record: one element of a numpy structured array, `array[0]`, read and written by field name. Numba and the plain
# interpreter both accept it. A kernel call costs 0.5 us with records and 8.5 us with NamedTuples of the same 70
# numbers (measured), and a record's bytes are the snapshot that the log keeps.
Record = Any


PACKAGES = ("bridge", "controller", "plant", "diagnosis")  # those that hold kernels, or constants that kernels freeze


def sources_digest(root: Path) -> str:
    """A hash over every source file of PACKAGES below `root`, sub-packages included.

    Numba renews a cached kernel when its own file changes, not when a kernel that it calls does: without this, an edit of
    plant/contact.py would leave plant/core.py running the old contact.
    """
    digest = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    """A folder of its own for every version of the kernels' sources."""
    # `Path.home` fails for a user without one
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(home) / "stickslip" / sources_digest(Path(__file__).parent.parent)


def _usable(folder: Path) -> Path:
    """The folder, or where nothing can be written there one for this process and those that it starts, gone at its end."""
    try:
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
    """Compile `function`; `NUMBA_DISABLE_JIT=1` runs it interpreted, with the same bits.

    `fastmath` stays off and kernels use `math.*` on scalars: fast maths and numpy's own vector maths both change the
    last bit, and replay promises the same bits. Numpy's rules for division spare a check before each one.
    """
    compiled: Any = numba.njit(cache=True, fastmath=False, error_model="numpy")(function)
    return compiled


def record(dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """One zeroed record of `dtype`, with fields as attributes in compiled and interpreted kernels alike."""
    return np.zeros(1, np.dtype((np.record, dtype)))
