"""One file of a log while it is being written: opened, locked, watched, closed, also where the disk is full."""

import contextlib
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path

from bridge.faults import Fault
from bridge.files import LOG, followed, open_new, refuse_to_replace
from bridge.log.library import LIBRARY
from bridge.log.live import locked
from bridge.log.mcap_chunks import ChunkWriter, ending_without_index


class PartFile:
    """A file that is being written, and its chunks.

    Args:
        path: the file. Its folder is made.
        replace: whether a log that is there may be replaced.

    Raises Fault CONFIG, LOG_WRITE; FileExistsError where it may not be replaced.

    """

    def __init__(self, path: Path, replace: bool) -> None:
        if replace:
            refuse_to_replace(path, LOG, str(path))
        self.path = path
        self.whole_bytes = 0
        self.slowest_s = 0.0  # longest write since it was last set to 0
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if replace:
                # not truncated when it is opened: the file may be the log of a run under way
                flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
                self._file = os.fdopen(os.open(followed(path), flags, 0o666), "wb")
            else:
                self._file = open_new(path)
            if not locked(self._file):
                self._file.close()
                line = f"{path}: is being recorded: must be another file than that of a run that goes on"
                raise Fault("LOG_WRITE", f"{line}; wait for the end of that one, or choose another --log")
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
        """Call `write`, and see what it wrote to the operating system. Raises OSError."""
        began_s = time.monotonic()
        write()
        self._file.flush()
        self.slowest_s = max(self.slowest_s, time.monotonic() - began_s)
        self.whole_bytes = self._file.tell()
        self.writer.note_whole()

    def size_trouble(self) -> str | None:
        """What is wrong with the size of the file, in words; asked before each write, which would hide it behind a hole."""
        here = os.fstat(self._file.fileno())
        if here.st_size == self.whole_bytes or not stat.S_ISREG(here.st_mode):
            return None
        how = "cut" if here.st_size < self.whole_bytes else "written to by another program"
        return f"was {how}: {self.whole_bytes} bytes were written, {here.st_size} are there"

    def trouble(self) -> tuple[str, str] | None:
        """Code and words for a file that is not at its path any more, or not as it was written; None where all is well."""
        try:
            here = os.fstat(self._file.fileno())
            if not stat.S_ISREG(here.st_mode):
                return None
            if (size := self.size_trouble()) is not None:
                return "LOG_LOST", size
            try:
                there = self.path.stat()
            except FileNotFoundError:
                if here.st_nlink:
                    return "LOG_LOST", "was renamed: it is whole, and under another name"
                return "LOG_LOST", "was deleted: what was recorded until now is lost"
            if (there.st_dev, there.st_ino) != (here.st_dev, here.st_ino):
                kept = "is whole under another name" if here.st_nlink else "is lost"
                return "LOG_REPLACED", f"was replaced by another file: what was recorded until now {kept}"
        except OSError as error:
            return "LOG_LOST", f"cannot be seen any more: {error.strerror}"
        return None

    def leave(self) -> None:
        """Close a file that was taken away: with its index where it is still whole, under whatever name."""
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
        """Close and remove a file that could not even begin."""
        with contextlib.suppress(OSError):
            self._file.close()
        self.path.unlink(missing_ok=True)

    def close_without_index(self, last_words: Callable[[], object]) -> None:
        """Close the file after its last whole chunk where it cannot be written any more.

        Removing the chunk that did not fit makes room for the end, and mostly for one more small chunk with `last_words`, which
        adds messages to `writer`.
        """
        with contextlib.suppress(OSError):
            self._file.close()

        def with_last_words() -> None:
            last_words()
            self.writer.finish_without_index()

        ends = (with_last_words, self.writer.finish_without_index)
        with contextlib.suppress(OSError), self.path.open("r+b", buffering=0) as file:
            for end in ends:
                file.truncate(self.whole_bytes)
                file.seek(self.whole_bytes)
                self.writer.give_up(file)
                try:
                    end()
                except OSError:
                    continue
                return
            file.truncate(self.whole_bytes)
            file.seek(self.whole_bytes)
            file.write(ending_without_index())
