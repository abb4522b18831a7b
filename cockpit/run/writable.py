"""Files that a command writes at its end: refused at its start where they cannot be, one clear line where they fail."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from bridge.faults import Fault


def check_writable(option: str, path: Path) -> None:
    """Raise Fault LOG_WRITE where a file, or the nearest folder above it, does not allow it, CONFIG for a mistyped option."""
    if str(path).startswith("--"):
        line = f"{option} {path}: takes a file, and {path} is an option; give a file, or the whole path of one of that name"
        raise Fault("CONFIG", line)
    with writing(path):
        Path(f"{path}.part").exists()  # it is written beside itself first: a name may be too long for that
        needed = [path] if path.exists() else []
        if path.is_file() or not needed:
            needed.append(next(parent for parent in path.absolute().parents if parent.exists()))
    for place in needed:
        if not os.access(place, os.W_OK) or (place != path and not place.is_dir()):
            raise Fault("LOG_WRITE", f"{option} {path}: cannot be written: {place} does not allow it; choose another")


@contextmanager
def writing(path: Path | None = None) -> Generator[None]:
    """Turn what the operating system refuses into a Fault LOG_WRITE, of `path` where it does not say of what."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        where = str(error.filename or path).removesuffix(".part")
        line = f"{where}: cannot be written: {error.strerror}; choose another place or free space"
        raise Fault("LOG_WRITE", line) from None
