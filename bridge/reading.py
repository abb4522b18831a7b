"""Files that are read: one that is not there, or that cannot be looked at, is one clear line that says why."""

import os
import stat
from pathlib import Path

from bridge.faults import Fault


def check_file(path: Path, code: str, remedy: str) -> None:
    """Raise Fault `code` where there is no file, or where the operating system does not let it be looked at."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):  # ValueError: no name that a file can have
        why = "no such file"
    except OSError as error:
        why = f"cannot be read: {error.strerror}"
    else:
        if stat.S_ISREG(mode):
            return
        why = "is a folder, must be a file" if stat.S_ISDIR(mode) else "must be a file on a disk"
    raise Fault(code, f"{path}: {why}; {remedy}")


def shown(path: Path) -> str:
    """The path as a text that can be printed: bytes of a name that are not UTF-8 are spelt out."""
    return os.fsencode(path).decode(errors="backslashreplace")
