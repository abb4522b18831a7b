"""Files: a clear line for a file that cannot be read; text and strict JSON written whole or not at all."""

import json
import math
import os
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bridge.faults import Fault


def check_file(path: Path, code: str, remedy: str) -> None:
    """Raise Fault `code` when `path` is not a file, or when the operating system does not let it be read.

    The fault's line ends in `remedy`.
    """
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):  # ValueError: a name that no file can have
        why = "no such file"
    except OSError as error:
        why = f"cannot be read: {error.strerror}"
    else:
        if stat.S_ISREG(mode):
            return
        why = "is a folder, must be a file" if stat.S_ISDIR(mode) else "must be a file on a disk"
    raise Fault(code, f"{path}: {why}; {remedy}")


LOG, JSON = "run log", "JSON"
_BEGINS = {LOG: (b"\x89MCAP",), JSON: (b"{", b"[")}


def refuse_to_replace(path: Path, kind: str, place: str) -> None:
    """Raise Fault CONFIG where `path` is a file that is not of this kind (LOG or JSON), or a log would go into a pipe.

    `place` is what the error names: the option that gave the path, or the path.
    """
    try:
        if kind == LOG and (path.is_fifo() or path.is_socket()):  # would wait for a reader, and cannot be read again
            raise Fault("CONFIG", f"{place}: is no file on a disk, which a log must be; choose another file")
        if not path.is_file() or path.stat().st_size == 0:
            return
        with path.open("rb") as file:
            begins = file.read(8).lstrip()
    except OSError:  # who writes it says why it cannot
        return
    if not begins.startswith(_BEGINS[kind]):
        raise Fault("CONFIG", f"{place}: {path.name} is there and is no {kind}, it would be lost; choose another file")


def refuse_to_lose(inputs: Iterable[Path], what: str, option: str, path: Path | None) -> None:
    """Raise Fault CONFIG where `path`, which `option` names, is one of `inputs` by any name; a hard link is one too."""
    if path is not None and any(_same_file(path, one) for one in inputs):
        raise Fault("CONFIG", f"{option} {path}: is {what}, which would be lost; choose another file")


def _same_file(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except (OSError, ValueError):  # one of them is not there, or no file can have its name
        return False


def shown(path: Path) -> str:
    """The path as printable text; bytes that are not UTF-8 are written in hexadecimal."""
    return os.fsencode(path).decode(errors="backslashreplace")


def write_whole(path: Path, text: str) -> None:
    """Write a text file whole or not at all, and make its folder. A symbolic link stays a link. Raises OSError.

    A path that is not a regular file, such as /dev/null or a pipe, is written into and never replaced.
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
    """`value` as JSON knows it: a named tuple is an object, a path a text, NaN and infinity are null."""
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = value._asdict()  # pyright: ignore[reportAttributeAccessIssue]
    if isinstance(value, dict):
        return {key: strict_json(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [strict_json(inner) for inner in value]
    if isinstance(value, Path):
        return shown(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_json(path: Path, value: Any) -> None:
    """Write `value` as strict JSON, whole or not at all, and make the folder. Raises OSError."""
    write_whole(path, json.dumps(strict_json(value), allow_nan=False, indent=1) + "\n")
