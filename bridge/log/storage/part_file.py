"""One file of a log while it is being written: opened, locked, watched, closed, also on a full disk."""

import contextlib
import fcntl
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO

from bridge.faults import Fault
from bridge.files import LOG, followed, open_new, refuse_to_replace
from bridge.log.library import LIBRARY
from bridge.log.mcap_chunks import ChunkWriter


def _locked(file: IO[bytes], kind: int = fcntl.LOCK_EX) -> bool:
    """Lock a log against writing and replacing by other processes; False when another process has the lock."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        pass
    return True


def refuse_a_live_log(path: Path, option: str) -> None:
    """Raise Fault LOG_WRITE when `path` is a log that is being recorded; `option` is the option that names another file."""
    if not path.is_file():
        return
    with path.open("rb") as file:
        if not _locked(file, fcntl.LOCK_SH):
            line = f"{path}: is being recorded: must be closed before it is replaced, or the rest of the run is lost"
            raise Fault("LOG_WRITE", f"{line}; wait for the end of the run, or give another {option}")


class PartFile:
    """A file that is being written, and its chunks.

    Args:
        path: the file. Its folder is made.
        replace: whether an existing log may be replaced.

    Raises Fault CONFIG, LOG_WRITE; FileExistsError where it may not be replaced.

    """

    def __init__(self, path: Path, replace: bool) -> None:
        if replace:
            refuse_to_replace(path, LOG, str(path))
        self.path = path
        self.whole_bytes = 0
        self.slowest_s = 0.0  # longest write since the last reset
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if replace:
                # not truncated before it is locked: the file may be the log of a run under way
                flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
                self._file = os.fdopen(os.open(followed(path), flags, 0o666), "wb")
            else:
                self._file = open_new(path)
            if not _locked(self._file):
                self._file.close()
                line = f"{path}: is being recorded: must not be the log of a run in progress"
                raise Fault("LOG_WRITE", f"{line}; wait for the end of that run, or choose another --log")
            if path.is_file():
                self._file.truncate(0)
            self.writer = ChunkWriter(self._file, LIBRARY, path.absolute().parent)
        except FileExistsError:
            raise
        except OSError as error:
            raise Fault("LOG_WRITE", f"{path}: cannot be written: {error.strerror}; choose another --log") from None

    @property
    def closed(self) -> bool:
        """Whether the file was closed."""
        return self._file.closed

    def guarded(self, write: Callable[[], None]) -> None:
        """Call `write`, and pass the bytes to the operating system. Raises OSError."""
        began_s = time.monotonic()
        write()
        self._file.flush()
        self.slowest_s = max(self.slowest_s, time.monotonic() - began_s)
        self.whole_bytes = self._file.tell()
        self.writer.note_whole()

    def size_trouble(self) -> str | None:
        """A change of the file's size by another program, as text; checked before each write, which would hide it."""
        opened = os.fstat(self._file.fileno())
        if opened.st_size == self.whole_bytes or not stat.S_ISREG(opened.st_mode):
            return None
        how = "cut" if opened.st_size < self.whole_bytes else "written to by another program"
        return f"was {how}: {self.whole_bytes} bytes were written, the file has {opened.st_size}"

    def trouble(self) -> tuple[str, str] | None:
        """Code and text for a file that was moved, replaced or changed; None for an intact file."""
        try:
            opened = os.fstat(self._file.fileno())
            if not stat.S_ISREG(opened.st_mode):
                return None
            if (size := self.size_trouble()) is not None:
                return "LOG_LOST", size
            try:
                named = self.path.stat()
            except FileNotFoundError:
                if opened.st_nlink:
                    return "LOG_LOST", "was renamed: it is whole, under another name"
                return "LOG_LOST", "was deleted: the recording so far is lost"
            if (named.st_dev, named.st_ino) != (opened.st_dev, opened.st_ino):
                kept = "is whole under another name" if opened.st_nlink else "is lost"
                return "LOG_REPLACED", f"was replaced by another file: the recording so far {kept}"
        except OSError as error:
            return "LOG_LOST", f"cannot be accessed any more: {error.strerror}"
        return None

    def leave(self) -> None:
        """Close a file that was taken away; with its index if it is still whole under another name."""
        with contextlib.suppress(OSError):
            if self.size_trouble() is None and os.fstat(self._file.fileno()).st_nlink:
                self.guarded(self.writer.finish)
        with contextlib.suppress(OSError):
            self._file.close()

    def close(self) -> None:
        """Write the index and close the file. Raises OSError."""
        self.guarded(self.writer.finish)
        self._file.close()

    def abandon(self) -> None:
        """Close and remove a file whose beginning could not be written."""
        with contextlib.suppress(OSError):
            self._file.close()
        self.path.unlink(missing_ok=True)

    def close_without_index(self, last_words: Callable[[], object]) -> None:
        """Close the file after its last whole chunk because it cannot be written any more.

        Removing the chunk that did not fit frees space for the end, and mostly for one more small chunk with `last_words`, which
        adds messages to `writer`.
        """
        with contextlib.suppress(OSError):
            self._file.close()

        with contextlib.suppress(OSError), self.path.open("r+b", buffering=0) as file:
            for words in (last_words, lambda: None):  # `give_up` drops the last words: the second try writes 50 bytes
                file.truncate(self.whole_bytes)
                file.seek(self.whole_bytes)
                self.writer.give_up(file)
                with contextlib.suppress(OSError):
                    words()
                    self.writer.finish(index=False)
                    return
