"""One pass over the records of a run log, from the front and without its index.

So a cut or damaged file loses only the part that is cut or damaged: a checksum shows a damaged chunk, and after a record that
cannot be read the pass goes on with the next whole chunk.
"""

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import IO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk, Header, Metadata, Statistics

from bridge.faults import Fault
from bridge.log import chunk_bytes
from bridge.log.chunk_messages import Chunked, Messages, messages_of
from bridge.log.damage import Damage, also_before
from bridge.log.definitions import Definitions
from bridge.log.library import HEAD, MAGIC, READABLE, refuse_other_version
from bridge.log.storage.parts import LOST, OF_FILES, parts_of

# Largest accepted ratio of uncompressed bytes to file size, and an allowance for short logs. A message of zeros compresses to
# nothing but still costs 16 bytes of index, so even a block of 200 zeros per channel stays below 200.
_LARGEST_RATIO = 200
_ALLOWANCE_BYTES = 1 << 24
_FOOTER_BYTES = 20
# bytes of chunks parsed at once. Smaller: call overhead dominates, as a chunk of 0.1 s holds 0.1 MB
AT_ONCE_BYTES = 1 << 19
_DEFINITIONS = (Opcode.SCHEMA, Opcode.CHANNEL)
_MOST_NAMES = 3  # schemas of another program that a message lists


_Part = tuple[Chunk | bytearray | None, list[bytes]]  # a chunk, or messages outside of chunks; the indexes after it


class _Group(NamedTuple):
    """Messages that a second thread has parsed, from chunks or from outside of chunks."""

    messages: Messages | None  # None if none of its chunks can be read
    bad_chunks: int
    end_bytes: int  # end of the group in the file


def _parsed(parts: list[_Part], end_bytes: int) -> _Group:
    """The messages of a group, and the number of its damaged chunks."""
    chunks: list[Chunked] = []
    for part, indexes in parts:
        data = bytes(part) if isinstance(part, bytearray) else chunk_bytes.unpacked(part)
        if data is not None:
            chunks.append(Chunked(data, indexes))
    messages = messages_of(chunks) if chunks else None
    for channel in messages.by_channel.values() if messages is not None else ():
        _ = channel.stacked  # computed here, because the caller's thread has more work
    return _Group(messages, len(parts) - len(chunks), end_bytes)


class LogReader:
    """One pass over a log, all of its files. `damage`, `foreign` and `metadata` grow during it and are complete after it.

    Any MCAP file with topics of this project is a log, whichever program wrote it last.

    Args:
        path: the first file; the files that continue it are read too.
        alone: read no other file.

    """

    def __init__(self, path: Path, alone: bool = False) -> None:
        self.path = path
        self.alone = alone
        self.damage = Damage(0, 0, closed=False)
        self.header: Header | None = None
        self.metadata: dict[str, dict[str, str]] = {}
        self.foreign: dict[str, int] = {}  # skipped messages in topics of other programs
        self.attachments = 0
        self.size_bytes = 0
        self.position_bytes = 0  # end of the part that was read
        self.definitions = Definitions(path)  # definitions of the file that is being read
        self._any_topic = False
        self._claimed_bytes = 0  # uncompressed size of the chunks so far
        self._stated: int | None = None  # number of messages according to the file's statistics

    def count_bad_messages(self, count: int, why: str) -> None:
        """Add `count` whole messages that do not fit their topic to the damage; `why` is the fault of the first."""
        if count:
            self.damage = self.damage.and_also(bad_records=count)._replace(first_bad=self.damage.first_bad or why)

    def topic(self, channel_id: int) -> str | None:
        """The topic of a channel of this project; None if it belongs to another program, or its definition is lost."""
        return self.definitions.topic(channel_id) if self.definitions.find(channel_id) else None

    def pass_over(self, channel_id: int, messages: int) -> None:
        """Count messages of a channel without a topic of this project."""
        if self.definitions.find(channel_id):
            name = self.definitions.channels[channel_id].topic
            self.foreign[name] = self.foreign.get(name, 0) + messages
        else:
            self.damage = self.damage.and_also(nameless=messages)

    def messages(self) -> Iterator[Messages]:
        """The messages of the log, in groups of chunks.

        Raises Fault BAD_LOG when the file is not a run log.
        """
        try:
            paths = [self.path] if self.alone else parts_of(self.path)
            sizes_bytes = [path.stat().st_size for path in paths]
            self.size_bytes = sum(sizes_bytes)
            before_bytes = 0
            closed = True
            for path, size_bytes in zip(paths, sizes_bytes, strict=True):
                self._begin(path)
                read = 0
                for messages in self._groups(path, size_bytes, before_bytes):
                    read += len(messages.start)
                    yield messages
                closed &= self.damage.closed
                if self._stated is not None:
                    self.damage = self.damage.and_also(missing=max(self._stated - read, 0))
                self._any_topic |= self.definitions.any_own()
                before_bytes += size_bytes
                self.position_bytes = before_bytes
            self.damage = self.damage._replace(closed=closed)
        except OSError as error:
            raise Fault(
                "BAD_LOG", f"{self.path}: cannot be read: {error.strerror}; give the path of a .mcap file"
            ) from None
        self._must_be_ours()

    def _begin(self, path: Path) -> None:
        """Reset the state of the previous file: channel numbers are valid within one file only."""
        self._any_topic |= self.definitions.any_own()
        self.damage = self.damage._replace(closed=False)
        self.definitions = Definitions(path)
        self._stated = None

    def _groups(self, path: Path, size_bytes: int, before_bytes: int) -> Iterator[Messages]:
        # A second thread parses a group while the caller works on the previous group. With 2, 4 and 8 groups ahead no log is read
        # faster, and 8 hold 13 MB more. A definition waits in its place, so that it applies to the messages after it.
        before: Future[_Group] | chunk_bytes.FileRecord | None = None
        with path.open("rb") as file, ThreadPoolExecutor(max_workers=1) as worker:
            for item in chain(self._items(file, worker, size_bytes), [None]):
                if isinstance(before, chunk_bytes.FileRecord):
                    self._learn(before.opcode, before.content)
                elif before is not None:
                    messages, bad_chunks, end_bytes = before.result()
                    self.position_bytes = before_bytes + end_bytes
                    bad_records = messages.broken if messages is not None else 0
                    self.damage = self.damage.and_also(bad_chunks=bad_chunks, bad_records=bad_records)
                    if messages is not None:
                        for opcode, content in messages.others:
                            if opcode in _DEFINITIONS:
                                self._learn(opcode, content)
                        yield messages
                before = item

    def _items(
        self, file: IO[bytes], worker: ThreadPoolExecutor, size_bytes: int
    ) -> Iterator[Future[_Group] | chunk_bytes.FileRecord]:
        """Groups of chunks, and the definitions between them, in file order."""
        if file.read(len(MAGIC)) != MAGIC:
            line = f"{self.path}: {size_bytes} bytes, no MCAP file (its first 8 bytes differ); give a run log"
            raise Fault("BAD_LOG", line)
        at = len(MAGIC)  # end of the whole records
        parts: list[_Part] = []
        waiting_bytes = 0  # uncompressed size of the parts, as the chunks claim
        indexes: list[bytes] | None = None  # index records of the previous chunk; None if another record followed it
        while not self.damage.closed:
            record = chunk_bytes.next_record(file, at, size_bytes)
            is_index = record is not None and record.opcode == Opcode.MESSAGE_INDEX and not record.is_chunk
            is_definition = record is not None and record.opcode in _DEFINITIONS and not record.is_chunk
            if parts and (is_definition or (waiting_bytes > AT_ONCE_BYTES and not is_index)):
                yield worker.submit(_parsed, parts, at)
                parts, waiting_bytes = [], 0
            if record is None:
                start = self._after_damage(file, at, size_bytes)
                if start is None:
                    break
                at, indexes = file.seek(start), None
                continue
            at = record.end_bytes
            if is_index and indexes is not None:
                indexes.append(record.content)
                continue
            indexes = None
            if record.is_chunk:
                chunk = chunk_bytes.opened(record.content)
                self._refuse_inflated(chunk)
                indexes = []
                parts.append((chunk, indexes))
                waiting_bytes += chunk.uncompressed_size if chunk is not None else 0
            elif record.opcode == Opcode.MESSAGE:
                if not (parts and isinstance(loose := parts[-1][0], bytearray)):
                    parts.append((loose := bytearray(), []))
                loose += HEAD.pack(Opcode.MESSAGE, len(record.content)) + record.content
                waiting_bytes += HEAD.size + len(record.content)
            elif record.opcode == Opcode.FOOTER and len(record.content) == _FOOTER_BYTES:
                # bytes after the end, or an incomplete one, would hide a wrong checksum of the file
                self.damage = self.damage._replace(closed=file.read(len(MAGIC) + 1) == MAGIC)
                file.seek(at)
            elif record.opcode == Opcode.ATTACHMENT:
                self.attachments += 1
            elif is_definition:
                yield record
            else:
                self._learn(record.opcode, record.content)
        if parts:
            yield worker.submit(_parsed, parts, at)
        if not self.damage.closed:
            self.damage = self.damage.and_also(cut_bytes=size_bytes - at)

    def _refuse_inflated(self, chunk: Chunk | None) -> None:
        """Raise Fault BAD_LOG for chunks that claim more data than a log of this size can hold, before any is uncompressed."""
        if chunk is None or not chunk.compression:
            return
        self._claimed_bytes += chunk.uncompressed_size
        most_bytes = _ALLOWANCE_BYTES + _LARGEST_RATIO * self.size_bytes
        line = f"{self.path}: {self.size_bytes / 1e3:.0f} kB"
        if chunk.uncompressed_size > chunk_bytes.LARGEST_CHUNK_BYTES:
            rule = f"must be at most {chunk_bytes.LARGEST_CHUNK_BYTES / 1e6:.0f} MB"
            line += f": holds a chunk of {chunk.uncompressed_size / 1e6:.0f} MB: {rule}"
        elif self._claimed_bytes > most_bytes:
            rule = f"must be at most {most_bytes / 1e6:.0f} MB for a log of its size"
            line += f": would unpack to more than {self._claimed_bytes / 1e6:.0f} MB: {rule}"
        else:
            return
        raise Fault("BAD_LOG", f"{line}; it was made to fill the memory or is damaged: do not trust it")

    def _must_be_ours(self) -> None:
        """Raise Fault BAD_LOG for a file without a topic of this project."""
        foreign = self.definitions.foreign_schemas()
        # True for a run that was cut before its first definition
        began = self.header is not None and self.header.library in READABLE
        if self._any_topic or (began and not foreign):
            return
        if foreign:
            named = ", ".join(foreign[:_MOST_NAMES]) + (", ..." if len(foreign) > _MOST_NAMES else "")
            line = f"{self.path}: holds no topic of a run: its messages are {named}; give a run log"
            raise Fault("BAD_LOG", f"{line}. `stickslip log import` reads measured data of another program")
        lost = "holds no header" if self.header is None else "defines no topic"
        why = "it was cut before anything was written, or its first bytes are damaged"
        raise Fault("BAD_LOG", f"{self.path}: {lost}; {why}")

    def _after_damage(self, file: IO[bytes], from_bytes: int, size_bytes: int) -> int | None:
        """Start of the next whole chunk after bytes that cannot be read; None if no chunk follows."""
        start = chunk_bytes.next_chunk(file, from_bytes + 1, size_bytes)
        if start is not None:
            self.damage = self.damage.and_also(bad_records=1)
            return start
        if size_bytes - from_bytes > len(MAGIC):
            file.seek(size_bytes - len(MAGIC))
            if file.read() == MAGIC:  # no chunk follows the damage, only the index or messages outside of chunks
                self.damage = self.damage.and_also(bad_records=1)._replace(closed=True)
        return None

    def _learn(self, opcode: int, content: bytes) -> None:
        stream = ReadDataStream(BytesIO(content))
        try:
            if opcode == Opcode.HEADER:
                self.header = Header.read(stream)
            elif opcode in _DEFINITIONS:
                self.definitions.learn(opcode, content)
            elif opcode == Opcode.METADATA:
                metadata = Metadata.read(stream)
                if metadata.name == LOST:
                    self.damage = also_before(self.damage, metadata.metadata.get("what", ""))
                elif metadata.name not in OF_FILES:
                    self.metadata[metadata.name] = dict(metadata.metadata)
            elif opcode == Opcode.STATISTICS:
                self._stated = Statistics.read(stream).message_count
        except chunk_bytes.UNREADABLE:
            self.damage = self.damage.and_also(bad_records=1)
        if opcode == Opcode.HEADER and self.header is not None:
            refuse_other_version(self.path, self.header.library)
