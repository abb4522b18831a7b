"""The files of a log that is being written: a full, lost or long file is closed, and the next file begins."""

import os
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from bridge.faults import Fault
from bridge.log.mcap_chunks import ChunkWriter
from bridge.log.storage.part_file import PartFile
from bridge.log.storage.parts import PART, LogPart, part_path
from bridge.units import counted

if TYPE_CHECKING:
    from bridge.log.runlog import RunLog

_LOOK_S = 1.0  # time between two checks of the file's path, and of a full disk
_LONGEST_WAIT_S = 64.0  # longest wait between two tries on a full disk; it doubles, as a quota shows only on writing
_ROOM_BYTES = 16 << 20  # free space on a full disk from which the log continues: half a minute of a run
_SLOW_S = 1.0  # writing time of a chunk from which the disk is reported as slow


class Rotation(NamedTuple):
    """When a log continues in a new file; 0: never for that reason."""

    bytes: int = 0
    seconds: float = 0.0  # time of the run in one file


class LogFiles:
    """The files of one log. If a file cannot be written any more, the fault is kept and raised at the end.

    Args:
        path: the first file.
        owner: fills the beginning of each file, and reports events.
        rotation: when to continue in a new file.
        patient: a full disk does not end the log: it waits for space.

    Raises Fault CONFIG, LOG_WRITE.

    """

    def __init__(self, path: Path, owner: "RunLog", rotation: Rotation, patient: bool) -> None:
        self.path = path
        self.unwritten = 0  # messages lost since the disk was full
        self.whole_t_ns: int | None = None  # time of the latest message in a chunk that is whole in a file
        self._owner, self._rotation, self._patient = owner, rotation, patient
        self._number = 0
        self._begins = ""  # identifies the log; the same in all its files
        self._began_ns = 0
        self._wait_s = _LOOK_S
        self._look_s = time.monotonic() + _LOOK_S
        self._lost_s = 0.0  # time of the run at which the disk was full
        self._fault: Fault | None = None
        self._part: PartFile | None = PartFile(path, replace=True)

    def begin(self) -> None:
        """Write the beginning of the first file."""
        self.guarded(lambda writer: self._owner.begin(writer, LogPart(0, "")))
        if self._fault is not None:  # a log that cannot begin fails even if patient
            raise self._fault

    @property
    def writer(self) -> ChunkWriter | None:
        """The writer of the present file; None while the disk is full."""
        return self._part and self._part.writer

    def guarded(self, write: Callable[[ChunkWriter], None]) -> None:
        """Call `write` with the writer, and pass the bytes to the operating system. Raises Fault LOG_WRITE."""
        part = self._part
        if part is not None and (cut := part.size_trouble()) is not None:
            self._lose(part, "LOG_LOST", cut)
            part = self._part
        if part is None:
            return
        writer = part.writer

        def write_and_identify() -> None:
            write(writer)
            if writer.chunks and not self._begins:
                self._begins = f"{writer.crc:08x}"
                writer.add_metadata(PART, LogPart(0, self._begins).as_texts())

        try:
            part.guarded(write_and_identify)
        except OSError as error:
            self._give_up(part, error)
            return
        if self._owner.t_ns and not part.writer.open_chunk.size:
            self.whole_t_ns = self._owner.t_ns

    def look_after(self) -> None:
        """Start a new file if due; report a file that was taken away and a slow disk."""
        part = self._part
        if part is not None and self._is_long(part):
            self._end(part)
            self._begin_next()
        if time.monotonic() < self._look_s:
            return
        self._look_s = time.monotonic() + self._wait_s
        if part is None:
            if self._has_room():
                self._begin_next()
            return
        if self._patient and part.slowest_s > _SLOW_S:  # lockstep runs write the same log on any disk
            self._owner.add_event("DISK_SLOW", f"a chunk of the log took {part.slowest_s:.1f} s to write")
            part.slowest_s = 0.0
        if self._part is part and (trouble := part.trouble()) is not None:
            self._lose(part, *trouble)

    def close(self) -> None:
        """Close the present file. Raises Fault LOG_WRITE, LOG_LOST, also of earlier files."""
        part = self._part
        if part is not None and not part.closed:
            trouble = part.trouble()
            if trouble is not None:
                self._lose(part, *trouble)
            if self._part is not None:
                self._end(self._part)
        if self._fault is not None:
            fault, self._fault = self._fault, None
            more = f"; {counted(self.unwritten, 'message')} after that were not recorded" if self.unwritten else ""
            also = f"; it continues in {self._name()}" if self._number else ""
            raise Fault(fault.kind.code, fault.line + more + also)

    def _is_long(self, part: PartFile) -> bool:
        most_bytes, most_s = self._rotation
        if not part.writer.chunks:
            return False
        long = bool(most_s) and self._owner.t_ns - self._began_ns >= most_s * 1e9
        return long or (bool(most_bytes) and part.whole_bytes >= most_bytes)

    def _note(self, fault: Fault) -> None:
        self._fault = self._fault or fault

    def _end(self, part: PartFile) -> None:
        try:
            part.close()
            if self._owner.t_ns:
                self.whole_t_ns = self._owner.t_ns
        except OSError as error:
            self._give_up(part, error)

    def _lose(self, part: PartFile, code: str, text: str) -> None:
        """Close a file that was taken away; the log continues in the next file, with the open chunk."""
        self._note(Fault("LOG_LOST", f"{part.path}: {text}"))
        self._begin_next()
        if self._part is None:
            self.unwritten += part.writer.unsure_messages
        else:
            new, old = self._part.writer, part.writer
            new.open_chunk, old.open_chunk = old.open_chunk, new.open_chunk
        part.leave()
        next_file = f"the log continues in {self._name()}" if self._part else "the log waits until it can continue"
        self._owner.add_event(code, f"{part.path.name} {text}; {next_file}")
        if self._part:
            self._owner.repeat_events()

    def _name(self) -> str:
        return part_path(self.path, self._number).name

    def _give_up(self, part: PartFile, error: OSError) -> None:
        """Close a file that cannot be written any more. Raises Fault LOG_WRITE unless patient."""
        self._lost_s = self._owner.t_ns * 1e-9
        text = (
            f"{part.path.name}: {error.strerror}: nothing is recorded from {self._lost_s:.2f} s on, until space is free"
        )
        self.unwritten += part.writer.unsure_messages
        part.close_without_index(lambda: self._owner.add_event("LOG_WRITE", text))
        self._part = None
        self._wait_s = _LOOK_S
        fault = Fault("LOG_WRITE", f"{part.path}: {error.strerror}; {self._kept(part.path)}")
        self._note(fault)
        if not self._patient:
            self._fault = None
            raise fault

    def _kept(self, path: Path) -> str:
        """The state of the closed file, and the remedy."""
        if self.whole_t_ns is None:
            return "the log was closed before anything was recorded; free space, or choose another --log"
        return (
            f"the log was closed at {self.whole_t_ns * 1e-9:.2f} s, everything before is kept; free space, then "
            f"`stickslip log recover {path}` restores its index"
        )

    def _has_room(self) -> bool:
        try:
            disk = os.statvfs(self.path.absolute().parent)
        except OSError:
            return False
        return disk.f_bavail * disk.f_frsize > _ROOM_BYTES

    def _begin_next(self) -> None:
        """Begin the next file; if that fails, wait twice as long before the next try."""
        self._part = None
        number = self._number + 1
        self._begins = self._begins or uuid.uuid4().hex  # the first file was lost before its first chunk
        part: PartFile | None = None
        try:
            while part is None:
                try:
                    part = PartFile(part_path(self.path, number), replace=False)
                except FileExistsError:  # the name belongs to another log
                    number += 1
            writer = part.writer
            part.guarded(lambda: self._owner.begin(writer, LogPart(number, self._begins)))
        except (OSError, Fault) as error:
            if part is not None:
                part.abandon()
            self._wait_s = min(2.0 * self._wait_s, _LONGEST_WAIT_S)
            self._note(error if isinstance(error, Fault) else Fault("LOG_WRITE", f"{self.path}: {error.strerror}"))
            return
        self._part, self._number, self._began_ns = part, number, self._owner.t_ns
        self._wait_s = _LOOK_S
        if self.unwritten:
            text = f"space is free again: {counted(self.unwritten, 'message')} since {self._lost_s:.2f} s were not recorded"
            self.unwritten = 0
            self._owner.add_event("LOG_WRITE", text)
