"""Files: a clear line for one that cannot be read; text and strict JSON written whole or not at all."""

import json
import math
import os
import stat
from pathlib import Path
from typing import Any

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


def write_whole(path: Path, text: str) -> None:
    """Write a file, its folder too, whole or not at all; a link stays one. Raises OSError.

    What is no file, like /dev/null or a pipe, is written into: it must never be replaced.
    """
    if path.is_relative_to("/dev") or (path.exists() and not path.is_file()):
        path.write_text(text, encoding="utf-8")
        return
    path = path.resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def strict_json(value: Any) -> Any:
    """`value` with null for NaN and infinity, which JSON does not know."""
    if isinstance(value, dict):
        return {key: strict_json(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [strict_json(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_json(path: Path, value: Any) -> None:
    """Write a file, its folder too. Raises OSError."""
    write_whole(path, json.dumps(strict_json(value), allow_nan=False, indent=1) + "\n")
