"""Where compiled kernels are kept, when one is compiled anew, and which of several processes compiles it."""

import atexit
import errno
import fcntl
import functools
import hashlib
import os
import re
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from numba.core.caching import UserProvidedCacheLocator

from bridge.compiling import compiling
from bridge.plain import ANOTHER_COMPILES, say

ROOT = Path(__file__).parents[1]
PACKAGES = ("bridge", "controller", "plant", "diagnosis", "cockpit")
_IMPORT = re.compile(r"^[ \t]*(?:from ([\w.]+) import (\([^)]*\)|.*)|import ([\w.]+))", re.MULTILINE)
FOLDER = "NUMBA_CACHE_DIR"


def _named(module: str, root: Path) -> Iterator[Path]:
    """The source files below `root` that run when `module` is imported."""
    parts = module.split(".")
    if parts[0] in PACKAGES:
        for length in range(1, len(parts) + 1):
            place = root.joinpath(*parts[:length])
            yield from (path for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file())


@functools.cache
def _imported(path: Path, root: Path) -> set[Path]:
    """Source files of this project that `path` imports."""
    found: set[Path] = set()
    for source, names, module in _IMPORT.findall(path.read_text(encoding="utf-8")):
        found.update(_named(source or module, root))
        for name in re.findall(r"\w+", names):
            found.update(_named(f"{source}.{name}", root))
    return found


def _closure(path: Path, root: Path) -> set[Path]:
    """A source file and all that it imports, and they, and so on."""
    seen, ahead = {path}, [path]
    while ahead:
        new = _imported(ahead.pop(), root) - seen
        seen |= new
        ahead += new
    return seen


@functools.cache
def sources_digest(path: Path, root: Path = ROOT) -> str:
    """A hash over a source file and over all files of the project below `root` that it imports, and they, and so on.

    Numba renews a cached kernel when the kernel's own file changes, but not when a kernel that it calls changes. Without this
    hash, plant/core.py would run the old contact after an edit of plant/contact.py.
    """
    digest = hashlib.sha256()
    for source in sorted(_closure(path, root)):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


class SourcesLocator(UserProvidedCacheLocator):
    """Tells numba that a kernel is another one when any source changes that it can hang on."""

    def get_source_stamp(self) -> bytes:
        """The hash of the sources of the function's file."""
        return sources_digest(Path(self._py_file).resolve()).encode()


def mark_of(what: str, path: Path, root: Path = ROOT) -> str:
    """The name of the file that says that the kernels of `what` are kept, which hang on the source file `path`.

    Numba keeps those of two copies of this project apart, so each copy below its own `root` has marks of its own.
    """
    place = hashlib.sha256(str(root).encode()).hexdigest()[:8]
    return f"{what}-{place}-{sources_digest(path, root)}"


def compile_once(what: str, load: Callable[[], object]) -> None:
    """Call `load`, which calls kernels for the first time. Of several processes one compiles them, and the others wait.

    Args:
        what: whose kernels they are, in words that make a file name.
        load: compiles the kernels, or loads them where they are kept.

    """
    folder = Path(os.environ[FOLDER])
    done = folder / mark_of(what, Path(sys.modules[load.__module__].__file__ or ""))
    with compiling(load.__module__):
        if done.exists():
            load()
            return
        with (folder / f"{what}.lock").open("a") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                say(f"stickslip: {ANOTHER_COMPILES}{what}: waiting for it")
                fcntl.flock(lock, fcntl.LOCK_EX)
            except OSError:  # a file system without locks: each process compiles
                pass
            load()
            for old in folder.glob(f"{done.name.rpartition('-')[0]}-*"):
                old.unlink(missing_ok=True)
            done.touch()


def _is_ours(folder: Path) -> bool:
    """Whether nobody else may write there: a kernel is code, and whoever can put a file there has it run in our name."""
    seen = folder.stat()
    return seen.st_uid == os.geteuid() and not seen.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _private(folder: Path) -> Path:
    """A folder of our own inside one that others may write to. Raises OSError where it is not ours either."""
    own = folder / f"stickslip-{os.geteuid()}"
    if not own.exists():
        own.mkdir(mode=0o700)
        say(
            f"stickslip: {folder}: is another user's, or others may write there: compiled kernels are code, so they are kept in "
            f"{own}, which is yours alone"
        )
    if own.is_symlink() or not _is_ours(own):
        raise OSError(errno.EPERM, "others may write there, and to the folder of your own in it")
    return own


def usable_folder() -> Path:
    """The folder for compiled kernels; where none can be written, a temporary one until this process ends."""
    # not `Path.home`, which fails for a user without a home
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = Path(os.environ.get(FOLDER) or Path(home) / "stickslip")
    try:
        if str(folder).startswith("~"):  # not expanded: a folder of that name would be made where the command is called
            raise OSError(errno.ENOENT, "its home is not known")
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _is_ours(folder):
            folder = _private(folder)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        own = tempfile.mkdtemp(prefix="stickslip-kernels-")
        atexit.register(shutil.rmtree, own, ignore_errors=True)
        line = (
            f"stickslip: {folder}: {error.strerror}: compiled kernels cannot be kept, so every command compiles them anew, "
            f"which takes up to a minute; set {FOLDER} to a folder that can be written to"
        )
        say(line)
        return Path(own)
    return folder
