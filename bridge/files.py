"""Files: a clear line for a file that cannot be read; text and strict JSON written whole or not at all."""

import contextlib
import errno
import json
import math
import os
import shutil
import stat
import tempfile
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import IO, Any

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


def read_json(path: Path) -> Any:
    """The value in a JSON file. Raises OSError, also for a pipe or a device, and ValueError where it is no JSON."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(errno.EINVAL, "must be a file on a disk", str(path))
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:  # brackets 1000 deep
        raise ValueError("its brackets are too deep") from None


_MOST_LINKS = 40  # one after the other, as the kernel's own limit is
_LONGEST_STEM_BYTES = 100  # of a file's name that the name of its unfinished copy begins with
LOG, JSON, PICTURE, PAGE = "run log", "JSON", "picture", "page"
_BEGINS = {  # in small letters
    LOG: (b"\x89mcap",),
    JSON: (b"{", b"["),
    PICTURE: (b"\x89png", b"%pdf", b"<?xml", b"<svg"),
    PAGE: (b"<!doctyp", b"<html"),
}


def refuse_to_replace(path: Path, kind: str, place: str) -> None:
    """Raise Fault CONFIG where `path` is a file that is not of this `kind`, or a log would go into a pipe.

    A kind is LOG, JSON, PICTURE or PAGE, told by the first bytes. `place` is what the error names: the option that gave
    the path, or the path.
    """
    try:
        if kind == LOG and (path.is_fifo() or path.is_socket()):  # would wait for a reader, and cannot be read again
            raise Fault("CONFIG", f"{place}: is no file on a disk, which a log must be; choose another file")
        if not path.is_file() or path.stat().st_size == 0:
            return
        with path.open("rb") as file:
            begins = file.read(8).lstrip().lower()
    except OSError:  # who writes it says why it cannot
        return
    if not begins.startswith(_BEGINS[kind]):
        raise Fault("CONFIG", f"{place}: {path.name} is there and is no {kind}, it would be lost; choose another file")


def refuse_to_replace_text(path: Path, begins: str, place: str) -> None:
    """Raise Fault CONFIG where `path` is a text that does not begin with what the command that would write it begins with."""
    try:
        if not path.is_file() or path.stat().st_size == 0:
            return
        with path.open("rb") as file:
            same = file.read(len(begins.encode())) == begins.encode()
    except OSError:  # who writes it says why it cannot
        return
    if not same:
        raise Fault("CONFIG", not_ours(path, place))


def refuse_to_replace_corrected(path: Path, text: str, place: str) -> None:
    """Raise Fault CONFIG where `path` is a file with another text than `text`: somebody may have corrected it."""
    try:
        same = not path.is_file() or path.stat().st_size == 0 or path.read_bytes() == text.encode()
    except OSError:  # who writes it says why it cannot
        return
    if not same:
        raise Fault(
            "CONFIG",
            f"{place}: {path.name} is there and says otherwise, it would be lost; give it to --map, or remove it",
        )


def not_ours(path: Path, place: str) -> str:
    """The line of a Fault for a file that a command would replace and did not write."""
    return f"{place}: {path.name} is there and is none that this command wrote, it would be lost; choose another file"


def refuse_to_lose(inputs: Iterable[Path], what: str, option: str, path: Path | None) -> None:
    """Raise Fault CONFIG where `path`, which `option` names, is one of `inputs` by any name; a hard link is one too."""
    if path is not None and any(same_file(path, one) for one in inputs):
        raise Fault("CONFIG", f"{option} {path}: is {what}, which would be lost; choose another file")


def same_file(one: Path, other: Path) -> bool:
    """Whether two paths mean one file, by a link of either kind as well."""
    try:
        return one.samefile(other)
    except (OSError, ValueError):  # one of them is not there, or no file can have its name
        return False


def shown(path: Path) -> str:
    """The path as printable text; bytes that are not UTF-8 are written in hexadecimal."""
    return os.fsencode(path).decode(errors="backslashreplace")


def followed(path: Path) -> Path:
    """The file that a path means, at the end of links of our own. Raises Fault LOG_WRITE for a link of somebody else.

    In a folder that several people write to, such a link may lead to a file that only we may write.
    """
    for _ in range(_MOST_LINKS):
        try:
            if not path.is_symlink():
                break
            owner = path.lstat().st_uid
            target = path.readlink()
        except OSError:  # who writes it says why it cannot
            break
        if owner not in {os.geteuid(), 0}:
            line = f"{path}: is a link that another user laid, to {shown(target)}: is not written through"
            raise Fault("LOG_WRITE", f"{line}; remove the link, or choose another file")
        path = path.parent / target
    return path


def open_new(path: Path, mode: int = 0o666) -> IO[bytes]:
    """A file that was not there before, open for writing and reading. Raises OSError, also where a link is in its place."""
    return os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, mode), "w+b")


def _hidden(path: Path) -> str:
    """How the name of an unfinished copy begins."""
    return f".{os.fsdecode(os.fsencode(path.name)[:_LONGEST_STEM_BYTES])}."


class Replacement:
    """A file that is written beside another under a name that nobody can foresee, and takes its place at the end.

    A path that is not a regular file, such as /dev/null or a pipe, is written into and never replaced. The folder is made.

    Raises Fault LOG_WRITE, OSError.
    """

    def __init__(self, path: Path) -> None:
        self._part: Path | None = None
        if path.is_relative_to("/dev") or (path.exists() and not path.is_file()):
            self.path = path
            self.file: IO[bytes] = path.open("wb")
            return
        self.path = followed(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # a name of 255 bytes is the longest that a disk takes
        part = self.path.with_name(f"{_hidden(self.path)}{os.urandom(8).hex()}.part")
        self.file = open_new(part)
        self._part = part

    def finish(self) -> None:
        """Put the file in its place. Raises OSError."""
        self.file.close()
        if self._part is not None:
            self._part.replace(self.path)
            self._part = None

    def discard(self) -> None:
        """Remove the file; what was there before stays."""
        with contextlib.suppress(OSError):
            self.file.close()
        if self._part is not None:
            self._part.unlink(missing_ok=True)


@contextlib.contextmanager
def replacing(path: Path) -> Generator[IO[bytes]]:
    """A file that takes the place of `path` where the block ends well. Raises Fault LOG_WRITE, OSError."""
    new = Replacement(path)
    try:
        yield new.file
        new.finish()
    finally:
        new.discard()


@contextlib.contextmanager
def folder_beside(path: Path) -> Generator[Path]:
    """A folder beside `path` that is ours alone, for files on their way there; it is removed at the end. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix=_hidden(path), suffix=".part", dir=path.parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def write_whole(path: Path, text: str) -> None:
    """Write a text file whole or not at all, and make its folder. Raises Fault LOG_WRITE, OSError."""
    with replacing(path) as file:
        file.write(text.encode("utf-8"))


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
