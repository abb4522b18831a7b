"""The cache of compiled kernels: its folder, its renewal, and one compilation for several processes."""

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
from bridge.plain import ANOTHER_COMPILES, print_line

ROOT = Path(__file__).parents[1]
PACKAGES = ("bridge", "controller", "plant", "diagnosis", "cockpit", "bench")
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
    files: set[Path] = set()
    for source, names, module in _IMPORT.findall(path.read_text(encoding="utf-8")):
        files.update(_named(source or module, root))
        for name in re.findall(r"\w+", names):
            files.update(_named(f"{source}.{name}", root))
    return files


def _closure(path: Path, root: Path) -> set[Path]:
    """A source file and all files that it imports, directly and indirectly."""
    seen, ahead = {path}, [path]
    while ahead:
        new = _imported(ahead.pop(), root) - seen
        seen |= new
        ahead += new
    return seen


@functools.cache
def sources_digest(path: Path, root: Path = ROOT) -> str:
    """A hash of a source file and of all files of the project below `root` that it imports, directly and indirectly.

    Numba recompiles a cached kernel after a change of the kernel's file, but not after a change of a kernel that it calls:
    without this hash, plant/core.py would run the old contact after an edit of plant/contact.py.
    """
    digest = hashlib.sha256()
    for source in sorted(_closure(path, root)):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


class SourcesLocator(UserProvidedCacheLocator):
    """Makes numba recompile a kernel after a change of any source file that it depends on."""

    def get_source_stamp(self) -> bytes:
        """The hash of the function's file and its imports."""
        return sources_digest(Path(self._py_file).resolve()).encode()


def mark_of(owner: str, path: Path, root: Path = ROOT) -> str:
    """The name of the mark file that confirms that the kernels of `owner`, in the source file `path`, are cached.

    Numba separates the kernels of two copies of this project, so the marks depend on `root`.
    """
    place = hashlib.sha256(str(root).encode()).hexdigest()[:8]
    return f"{owner}-{place}-{sources_digest(path, root)}"


def compile_once(owner: str, load: Callable[[], object]) -> None:
    """Call `load`, which calls kernels for the first time. Of several processes one compiles, and the others wait.

    Args:
        owner: name of the kernels' owner, as a part of a file name.
        load: compiles the kernels, or loads them from the cache.

    """
    folder = Path(os.environ[FOLDER])
    done = folder / mark_of(owner, Path(sys.modules[load.__module__].__file__ or ""))
    with compiling(load.__module__):
        if done.exists():
            load()
            return
        with (folder / f"{owner}.lock").open("a") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                print_line(f"stickslip: {ANOTHER_COMPILES}{owner}: waiting for it")
                fcntl.flock(lock, fcntl.LOCK_EX)
            except OSError:  # a file system without locks: each process compiles
                pass
            load()
            for old in folder.glob(f"{done.name.rpartition('-')[0]}-*"):
                old.unlink(missing_ok=True)
            done.touch()


def _is_ours(folder: Path) -> bool:
    """Whether only this user may write there: kernels are code, so a writer could run code as this user."""
    status = folder.stat()
    return status.st_uid == os.geteuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _private(folder: Path) -> Path:
    """A private folder inside a folder that others may write to. Raises OSError if it is not this user's."""
    private = folder / f"stickslip-{os.geteuid()}"
    if not private.exists():
        private.mkdir(mode=0o700)
        print_line(
            f"stickslip: {folder}: is another user's, or others may write there: compiled kernels are code, so they are stored "
            f"in the private folder {private}"
        )
    if private.is_symlink() or not _is_ours(private):
        raise OSError(errno.EPERM, "others may write to it, and to its private subfolder")
    return private


def usable_folder() -> Path:
    """The folder for compiled kernels; if it is not writable, a temporary one until this process ends."""
    # not `Path.home`, which fails for a user without a home
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = Path(os.environ.get(FOLDER) or Path(home) / "stickslip")
    try:
        if str(folder).startswith("~"):  # not expanded: a folder named `~` would be created in the working directory
            raise OSError(errno.ENOENT, "the home folder is unknown")
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _is_ours(folder):
            folder = _private(folder)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        temporary = tempfile.mkdtemp(prefix="stickslip-kernels-")
        atexit.register(shutil.rmtree, temporary, ignore_errors=True)
        line = (
            f"stickslip: {folder}: {error.strerror}: compiled kernels cannot be stored, so every command compiles them again, "
            f"which takes up to 1 min; set {FOLDER} to a writable folder"
        )
        print_line(line)
        return Path(temporary)
    return folder
