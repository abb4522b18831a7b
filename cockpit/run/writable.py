"""Checks at the start of a command that it can write its files at its end; one clear line if a write fails."""

import os
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

from bridge import files
from bridge.faults import Fault
from bridge.files import refuse_to_replace
from bridge.log.storage.verdict_file import refuse_to_lose_other_file

# suffixes of the files that commands write, by kind
LOG = (".mcap",)
PICTURE = (".png", ".svg", ".pdf")
PAGE = (".html", ".htm")
RIG = (".toml",)
JSON = (".json",)
JUNIT = (".xml",)
TABLE = (".parquet", ".csv", ".mat")
CSV = (".csv",)
SHEETS = (".csv", ".xlsx")
_NEVER_LOST: dict[tuple[str, ...], str] = {
    LOG: files.LOG,
    JSON: files.JSON,
    PICTURE: files.PICTURE,
    PAGE: files.PAGE,
}  # an existing file with such a suffix is replaced only if its content is of that kind
_NO_FOLDER = {*LOG, *PICTURE, *PAGE, *RIG, *JSON, *TABLE, ".tdms", ".txt"}  # suffixes refused for a new folder


def check_output(option: str, path: Path, suffixes: tuple[str, ...]) -> None:
    """Raise Fault if a file of this kind cannot be written: CONFIG for its name, LOG_WRITE for its folder."""
    check_writable(option, path)
    for known, kind in _NEVER_LOST.items():
        if suffixes == known or path.suffix.lower() in known:
            refuse_to_replace(path, kind, f"{option} {path}")
    if path.suffix.lower() in LOG:
        refuse_to_lose_other_file(path)
    if path.is_dir():
        raise Fault("CONFIG", f"{option} {path}: must be a file, not a folder; choose another")
    if path.suffix.lower() not in suffixes:
        raise Fault("CONFIG", f"{option} {path}: must end in {', '.join(suffixes)}; choose another name")


def check_output_folder(option: str, path: Path) -> None:
    """Raise Fault if a folder cannot be made: CONFIG if the name is a file or looks like a file, LOG_WRITE for its parent."""
    check_writable(option, path)
    if path.exists() and not path.is_dir():
        raise Fault("CONFIG", f"{option} {path}: must be a folder, not a file; choose another")
    if path.suffix.lower() in _NO_FOLDER and not path.exists():
        raise Fault(
            "CONFIG", f"{option} {path}: must be a folder, but {path.suffix} is a suffix of files; choose another"
        )


def check_writable(option: str, path: Path) -> None:
    """Raise Fault LOG_WRITE if a file, or the nearest folder above it, is not writable; CONFIG for a mistyped option."""
    if str(path).startswith("--"):
        line = (
            f"{option} {path}: takes a file, but {path} is an option; give a file, with its folder if it has this name"
        )
        raise Fault("CONFIG", line)
    with writing(path):
        needed = [path] if path.exists() else []
        if path.is_file() or not needed:
            needed.append(next(parent for parent in path.absolute().parents if parent.exists()))
    for place in needed:
        if not os.access(place, os.W_OK) or (place != path and not place.is_dir()):
            raise Fault("LOG_WRITE", f"{option} {path}: cannot be written: {place} is not writable; choose another")


def written(write: Callable[[], None], refused: list[Fault]) -> bool:
    """Write a file; True if it was written. A fault is added to `refused`, so that other files are still written."""
    try:
        with writing():
            write()
    except Fault as fault:
        if fault.line not in {known.line for known in refused}:  # a file may be written many times
            refused.append(fault)
        return False
    return True


def stamp_of(path: Path) -> tuple[int, int] | None:
    """Time and size of a file, to detect a change; None if it does not exist."""
    if not path.is_file():
        return None
    now = path.stat()
    return now.st_mtime_ns, now.st_size


@contextmanager
def writing(path: Path | None = None) -> Generator[None]:
    """Turn an OSError into a Fault LOG_WRITE; it names `path` if the error names no file."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        where = error.filename if error.filename and not str(error.filename).endswith(".part") else path
        line = f"{where}: cannot be written: {error.strerror}; choose another place or free space"
        raise Fault("LOG_WRITE", line) from None
