"""Files: checks before reading and replacing; text and strict JSON written completely or not at all."""

import contextlib
import errno
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import IO, Any

from bridge.faults import Fault


def check_file(path: Path, code: str, remedy: str) -> None:
    """Raise Fault `code` if `path` is not a file, or if the operating system refuses access.

    The fault's line ends in `remedy`.
    """
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):  # ValueError: an impossible file name
        problem = "no such file"
    except OSError as error:
        problem = f"cannot be read: {error.strerror}"
    else:
        if stat.S_ISREG(mode):
            return
        problem = "is a folder, must be a file" if stat.S_ISDIR(mode) else "must be a file on a disk"
    raise Fault(code, f"{path}: {problem}; {remedy}")


def read_json(path: Path) -> Any:
    """The value in a JSON file. Raises OSError, also for a pipe or a device, and ValueError if it is not JSON."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(errno.EINVAL, "must be a file on a disk", str(path))
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:  # brackets 1000 deep
        raise ValueError("its brackets are too deep") from None


_MOST_LINKS = 40  # most links followed in a row; the kernel's limit
_LONGEST_STEM_BYTES = 100  # longest part of a file's name that the name of its unfinished copy repeats
LOG, JSON, PICTURE, PAGE = "run log", "JSON", "picture", "page"
_BEGINS = {  # first bytes of a kind, in lower case
    LOG: (b"\x89mcap",),
    JSON: (b"{", b"["),
    PICTURE: (b"\x89png", b"%pdf", b"<?xml", b"<svg"),
    PAGE: (b"<!doctyp", b"<html"),
}


def refuse_to_replace(path: Path, kind: str, place: str) -> None:
    """Raise Fault CONFIG if `path` is a file of another `kind`, or a pipe or socket in place of a log.

    `kind` is LOG, JSON, PICTURE or PAGE, recognised by the first bytes. `place` is the subject of the message: the option that
    gave the path, or the path.
    """
    with contextlib.suppress(OSError):  # the write that follows reports it
        if kind == LOG and (path.is_fifo() or path.is_socket()):  # a pipe blocks, and cannot be read back
            raise Fault("CONFIG", f"{place}: is a pipe or socket: a log must be a file on a disk; choose another file")
    if not _may_replace(path, 8, lambda begins: begins.lstrip().lower().startswith(_BEGINS[kind])):
        raise Fault("CONFIG", f"{place}: {path.name} exists and holds no {kind}: it would be lost; choose another file")


def refuse_to_replace_text(path: Path, begins: str, place: str) -> None:
    """Raise Fault CONFIG if `path` is a file whose text does not start with `begins`, as the text of the command does."""
    known = begins.encode()
    if not _may_replace(path, len(known), known.__eq__):
        raise Fault("CONFIG", not_ours(path, place))


def refuse_to_replace_corrected(path: Path, text: str, place: str) -> None:
    """Raise Fault CONFIG if `path` is a file with another text than `text`: an operator may have corrected it."""
    if not _may_replace(path, -1, text.encode().__eq__):
        rule = "exists with another content, which would be lost; give it to --map, or remove it"
        raise Fault("CONFIG", f"{place}: {path.name} {rule}")


def _may_replace(path: Path, size: int, is_known: Callable[[bytes], bool]) -> bool:
    """Whether the first `size` bytes of a file are known; also True for an empty, absent or unreadable file."""
    try:
        if not path.is_file() or path.stat().st_size == 0:
            return True
        with path.open("rb") as file:
            return is_known(file.read(size))
    except OSError:  # the write that follows reports it
        return True


def not_ours(path: Path, place: str) -> str:
    """The message for a file that a command would replace but did not write."""
    return f"{place}: {path.name} exists and was not written by this command: it would be lost; choose another file"


def refuse_to_lose(inputs: Iterable[Path], kind: str, option: str, path: Path | None) -> None:
    """Raise Fault CONFIG if `path`, the value of `option`, is one of `inputs`, also through a link; `kind` names the input."""
    if path is not None and any(same_file(path, source) for source in inputs):
        raise Fault("CONFIG", f"{option} {path}: is {kind}, which would be lost; choose another file")


def same_file(first: Path, second: Path) -> bool:
    """Whether two paths lead to the same file, also through symbolic and hard links."""
    try:
        return first.samefile(second)
    except (OSError, ValueError):  # a path does not exist or is an impossible name
        return False


def shown(path: Path) -> str:
    """The path as printable text; bytes that are not UTF-8 are written in hexadecimal."""
    return os.fsencode(path).decode(errors="backslashreplace")


def followed(path: Path) -> Path:
    """The target of a path through symbolic links of this user or root. Raises Fault LOG_WRITE for a link of another user.

    In a shared folder, such a link could make this command overwrite a file of its own user.
    """
    for _ in range(_MOST_LINKS):
        try:
            if not path.is_symlink():
                break
            owner = path.lstat().st_uid
            target = path.readlink()
        except OSError:  # the write that follows reports it
            break
        if owner not in {os.geteuid(), 0}:
            line = f"{path}: is a link of another user to {shown(target)}: refused as the place of an output file"
            raise Fault("LOG_WRITE", f"{line}; remove the link, or choose another file")
        path = path.parent / target
    return path


def open_new(path: Path, mode: int = 0o666) -> IO[bytes]:
    """A new file, open for writing and reading. Raises OSError, also for an existing file or link."""
    return os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, mode), "w+b")


def _hidden(path: Path) -> str:
    """Start of the name of an unfinished copy."""
    return f".{os.fsdecode(os.fsencode(path.name)[:_LONGEST_STEM_BYTES])}."


class Replacement:
    """A file written under a random name in the same folder, which takes the place of `path` at the end.

    A path that is not a regular file, such as /dev/null or a pipe, is written to and never replaced. The folder is created.

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
        # file systems limit a name to 255 bytes
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
        """Remove the unfinished file; an earlier file of the name stays."""
        with contextlib.suppress(OSError):
            self.file.close()
        if self._part is not None:
            self._part.unlink(missing_ok=True)


@contextlib.contextmanager
def replacing(path: Path) -> Generator[IO[bytes]]:
    """A file that takes the place of `path` if the block ends without an error. Raises Fault LOG_WRITE, OSError."""
    new = Replacement(path)
    try:
        yield new.file
        new.finish()
    finally:
        new.discard()


@contextlib.contextmanager
def folder_beside(path: Path) -> Generator[Path]:
    """A private temporary folder next to `path`, removed at the end. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix=_hidden(path), suffix=".part", dir=path.parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def write_whole(path: Path, text: str) -> None:
    """Write a text file completely or not at all, and create its folder. Raises Fault LOG_WRITE, OSError."""
    with replacing(path) as file:
        file.write(text.encode("utf-8"))
