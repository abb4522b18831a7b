"""Files that a command writes at its end: refused at its start where they cannot be, one clear line where they fail."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from bridge import files
from bridge.faults import Fault
from bridge.files import refuse_to_replace

# suffixes of what commands write, by kind
LOG = (".mcap",)
PICTURE = (".png", ".svg", ".pdf")
PAGE = (".html", ".htm")
RIG = (".toml",)
JSON = (".json",)
TABLE = (".parquet", ".csv", ".mat")
CSV = (".csv",)
SHEETS = (".csv", ".xlsx")
_NEVER_LOST: dict[tuple[str, ...], str] = {
    LOG: files.LOG,
    JSON: files.JSON,
    PICTURE: files.PICTURE,
    PAGE: files.PAGE,
}  # a file of another kind under such a name is not replaced
_NO_FOLDER = {*LOG, *PICTURE, *PAGE, *RIG, *JSON, *TABLE, ".tdms", ".txt"}


def check_output(option: str, path: Path, suffixes: tuple[str, ...]) -> None:
    """Raise Fault where a file of this kind cannot be written: CONFIG for its name, LOG_WRITE for its place."""
    check_writable(option, path)
    for known, kind in _NEVER_LOST.items():
        if suffixes == known or path.suffix.lower() in known:
            refuse_to_replace(path, kind, f"{option} {path}")
    if path.is_dir():
        raise Fault("CONFIG", f"{option} {path}: must be a file, not a folder; choose another")
    if path.suffix.lower() not in suffixes:
        raise Fault("CONFIG", f"{option} {path}: must end in {', '.join(suffixes)}; choose another name")


def check_output_folder(option: str, path: Path) -> None:
    """Raise Fault where a folder cannot be made: CONFIG for a name that is a file's, LOG_WRITE for its place."""
    check_writable(option, path)
    if path.exists() and not path.is_dir():
        raise Fault("CONFIG", f"{option} {path}: must be a folder, not a file; choose another")
    if path.suffix.lower() in _NO_FOLDER and not path.exists():
        raise Fault(
            "CONFIG", f"{option} {path}: must be a folder, and {path.suffix} ends the name of a file; choose another"
        )


def check_writable(option: str, path: Path) -> None:
    """Raise Fault LOG_WRITE where a file, or the nearest folder above it, does not allow it, CONFIG for a mistyped option."""
    if str(path).startswith("--"):
        line = f"{option} {path}: takes a file, and {path} is an option; give a file, or the whole path of one of that name"
        raise Fault("CONFIG", line)
    with writing(path):
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
        where = error.filename if error.filename and not str(error.filename).endswith(".part") else path
        line = f"{where}: cannot be written: {error.strerror}; choose another place or free space"
        raise Fault("LOG_WRITE", line) from None
