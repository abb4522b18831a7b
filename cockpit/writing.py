"""Files that a command writes at its end: refused at its start where they cannot be, one clear line where they fail."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from bridge.faults import Fault


def check_writable(option: str, path: Path) -> None:
    """Raise Fault LOG_WRITE where the nearest folder above a file does not allow it."""
    above = next(parent for parent in (path, *path.absolute().parents) if parent.exists())
    if not os.access(above, os.W_OK) or (above != path and not above.is_dir()):
        raise Fault("LOG_WRITE", f"{option} {path}: cannot be written: {above} does not allow it; choose another")


@contextmanager
def writing() -> Generator[None]:
    """Turn what the operating system refuses into a Fault LOG_WRITE."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        line = f"{error.filename}: cannot be written: {error.strerror}; choose another place or free space"
        raise Fault("LOG_WRITE", line) from None
