"""One pass over the records of a run log, from the front and without its index.

So a cut or damaged file loses only the part that is cut or damaged: a checksum shows a damaged chunk, and after a record that
cannot be read the pass goes on with the next whole chunk.
"""

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from io import BytesIO
from pathlib import Path
from typing import IO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Metadata, Schema, Statistics

from bridge.faults import Fault
from bridge.log.chunk_messages import Chunked, Messages, messages_of
from bridge.log.damage import Damage, also_before
from bridge.log.library import HEAD, MAGIC, READABLE, refuse_other_version
from bridge.log.reading.chunk_bytes import (
    LARGEST_CHUNK_BYTES,
    UNREADABLE,
    Record,
    next_chunk,
    next_record,
    opened,
    unpacked,
)
from bridge.log.reading.definitions import Definitions
from bridge.log.storage.parts import LOST, OF_FILES, parts_of

# Uncompressed bytes of all chunks for a byte of the log, and what any log may have besides. Data that compress to nothing, as
# zeros, still cost 16 bytes of index a message, so that not even a block of 200 samples of zeros reaches 200.
_LARGEST_RATIO = 200
_ANYWAY_BYTES = 1 << 24
_FOOTER_BYTES = 20
# of chunks that are taken apart at once; with less the calls cost more than the work, as a chunk of 0.1 s holds 0.1 MB
AT_ONCE_BYTES = 1 << 19
_DEFINITIONS = (Opcode.SCHEMA, Opcode.CHANNEL)
_MOST_NAMES = 3  # of the schemas of another program's file that are told


class _Group(NamedTuple):
    """Chunks, or messages outside of chunks, that a second thread takes apart."""

    apart: "Future[_Apart]"
    end_bytes: int  # place of their end in the file


class _Apart(NamedTuple):
    """The messages of a group."""

    messages: Messages | None  # None where no chunk of it can be read
    bad_chunks: int


class _Filling:
    """The group that is read at present: chunks with their indexes, and messages outside of chunks."""

    def __init__(self) -> None:
        self._parts: list[tuple[Chunk | bytes | None, list[bytes]]] = []
        self._loose: list[bytes] = []
        self.bytes = 0  # uncompressed, as the chunks claim

    def add_chunk(self, chunk: Chunk | None) -> list[bytes]:
        """One more chunk; the list for its indexes, which follow it."""
        self._end_loose()
        indexes: list[bytes] = []
        self._parts.append((chunk, indexes))
        self.bytes += chunk.uncompressed_size if chunk is not None else 0
        return indexes

    def add_message(self, content: bytes) -> None:
        """One more message outside of chunks."""
        self._loose.append(HEAD.pack(Opcode.MESSAGE, len(content)) + content)
        self.bytes += len(content) + HEAD.size

    def _end_loose(self) -> None:
        if self._loose:
            self._parts.append((b"".join(self._loose), []))
            self._loose = []

    def taken(self, end_bytes: int, worker: ThreadPoolExecutor) -> _Group | None:
        """Everything read so far, which is then forgotten; None where there is nothing."""
        self._end_loose()
        parts, self._parts, self.bytes = self._parts, [], 0
        return _Group(worker.submit(_taken_apart, parts), end_bytes) if parts else None


def _taken_apart(parts: list[tuple[Chunk | bytes | None, list[bytes]]]) -> _Apart:
    """The messages of a group; the chunks that are damaged are counted."""
    chunks: list[Chunked] = []
    for part, indexes in parts:
        data = part if isinstance(part, bytes) else unpacked(part)
        if data is not None:
            chunks.append(Chunked(data, indexes))
    messages = messages_of(chunks) if chunks else None
    for mine in messages.by_channel.values() if messages is not None else ():
        _ = mine.stacked  # computed in this thread, as the caller has more to do
    return _Apart(messages, len(parts) - len(chunks))


class LogReader:
    """One pass over a log, all of its files. `damage`, `foreign` and `metadata` grow during it and are complete after it.

    Any MCAP file with topics of this project is a log, whichever program wrote it last.

    Args:
        path: the first file; the files that go on from it are read too.
        alone: read no other file.

    """

    def __init__(self, path: Path, alone: bool = False) -> None:
        self.path = path
        self.alone = alone
        self.damage = Damage(0, 0, closed=False)
        self.header: Header | None = None
        self.metadata: dict[str, dict[str, str]] = {}
        self.foreign: dict[str, int] = {}  # messages of topics of other programs, which are passed over
        self.attachments: list[tuple[Path, int, int]] = []  # file, first byte and number of bytes of the content
        self.size_bytes = 0
        self.position_bytes = 0  # end of the part that was read
        self._definitions = Definitions(path)
        self._any_own = False
        self._claimed_bytes = 0  # uncompressed size of the chunks so far
        self._stated: int | None = None  # messages of the present file by its own count

    @property
    def schemas(self) -> dict[int, Schema]:
        """The schemas of the file that is read at present, by their number."""
        return self._definitions.schemas

    @property
    def channels(self) -> dict[int, Channel]:
        """The channels of the file that is read at present, by their number."""
        return self._definitions.channels

    def count_bad_messages(self, count: int, why: str) -> None:
        """Add `count` messages that are whole but not messages of their topic to the damage, and why the first of them is not."""
        if count:
            self.damage = self.damage.and_also(bad_records=count)._replace(first_bad=self.damage.first_bad or why)

    def topic(self, channel_id: int) -> str | None:
        """The topic of a channel of this project; None where the channel is another program's, or its definition is lost."""
        return self._definitions.topic(channel_id) if self._definitions.find(channel_id) else None

    def pass_over(self, channel_id: int, messages: int) -> None:
        """Count messages of a channel that has no topic."""
        if self._definitions.find(channel_id):
            name = self.channels[channel_id].topic
            self.foreign[name] = self.foreign.get(name, 0) + messages
        else:
            self.damage = self.damage.and_also(nameless=messages)

    def messages(self) -> Iterator[Messages]:
        """The messages of one chunk after the other, of several small ones at once.

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
                for messages in self._some_at_once(path, size_bytes, before_bytes):
                    read += len(messages.start)
                    yield messages
                closed &= self.damage.closed
                if self._stated is not None:
                    self.damage = self.damage.and_also(missing=max(self._stated - read, 0))
                self._any_own |= self._definitions.any_own()
                before_bytes += size_bytes
                self.position_bytes = before_bytes
            self.damage = self.damage._replace(closed=closed)
        except OSError as error:
            raise Fault(
                "BAD_LOG", f"{self.path}: cannot be read: {error.strerror}; give the path of a .mcap file"
            ) from None
        self._must_be_ours()

    def _begin(self, path: Path) -> None:
        """Forget what held for the file before: each numbers its channels for itself."""
        self._any_own |= self._definitions.any_own()
        self.damage = self.damage._replace(closed=False)
        self._definitions = Definitions(path)
        self._stated = None

    def _some_at_once(self, path: Path, size_bytes: int, before_bytes: int) -> Iterator[Messages]:
        # A second thread takes a group apart while the caller works on the group before; with 2, 4 and 8 groups ahead no log is
        # read faster, and 8 hold 13 MB more. Definitions wait in the same list, so that each holds for the messages after it.
        ahead: list[_Group | Record] = []
        with path.open("rb") as file, ThreadPoolExecutor(max_workers=1) as worker:
            for item in self._items(file, worker, size_bytes):
                if isinstance(item, _Group):
                    for before in ahead:
                        yield from self._taken_in(before, before_bytes)
                    ahead = []
                ahead.append(item)
            for item in ahead:
                yield from self._taken_in(item, before_bytes)

    def _taken_in(self, item: _Group | Record, before_bytes: int) -> Iterator[Messages]:
        """Learn a definition, or hand out the messages of a group."""
        if isinstance(item, Record):
            self._learn(item.opcode, item.content)
            return
        messages, bad_chunks = item.apart.result()
        self.position_bytes = before_bytes + item.end_bytes
        bad_records = messages.broken if messages is not None else 0
        if bad_chunks or bad_records:
            self.damage = self.damage.and_also(bad_chunks=bad_chunks, bad_records=bad_records)
        if messages is None:
            return
        for opcode, content in messages.others:
            if opcode in _DEFINITIONS:
                self._learn(opcode, content)
        yield messages

    def _items(self, file: IO[bytes], worker: ThreadPoolExecutor, size_bytes: int) -> Iterator[_Group | Record]:
        """Groups of chunks, and the records between them, in file order."""
        if file.read(len(MAGIC)) != MAGIC:
            line = f"{self.path}: {size_bytes} bytes, no MCAP file (its first 8 bytes say so); give a run log"
            raise Fault("BAD_LOG", line)
        whole_bytes = len(MAGIC)
        filling = _Filling()
        indexes: list[bytes] | None = None  # of the chunk just before
        while not self.damage.closed:
            record = next_record(file, whole_bytes, size_bytes)
            is_message = record is not None and record.opcode == Opcode.MESSAGE
            is_index = record is not None and record.opcode == Opcode.MESSAGE_INDEX and not record.is_chunk
            is_definition = record is not None and record.opcode in _DEFINITIONS and not record.is_chunk
            if is_definition or (filling.bytes > AT_ONCE_BYTES and not is_index):
                group = filling.taken(whole_bytes, worker)
                if group is not None:
                    yield group
            if record is None:
                start = self._after_damage(file, whole_bytes, size_bytes)
                if start is None:
                    break
                whole_bytes = file.seek(start)
                indexes = None
                continue
            content_at = whole_bytes + HEAD.size
            whole_bytes = record.end_bytes
            if record.is_chunk:
                chunk = opened(record.content)
                self._refuse_a_bomb(chunk)
                indexes = filling.add_chunk(chunk)
            elif is_message:
                filling.add_message(record.content)
                indexes = None
            elif is_index and indexes is not None:
                indexes.append(record.content)
            elif record.opcode == Opcode.FOOTER and len(record.content) == _FOOTER_BYTES:
                self.damage = self.damage._replace(closed=True)
            elif record.opcode == Opcode.ATTACHMENT:
                self.attachments.append((Path(file.name), content_at, whole_bytes - content_at))
            else:
                indexes = None
                if is_definition:
                    yield record
                else:
                    self._learn(record.opcode, record.content)
        group = filling.taken(whole_bytes, worker)
        if group is not None:
            yield group
        if not self.damage.closed:
            self.damage = self.damage.and_also(cut_bytes=size_bytes - whole_bytes)

    def _refuse_a_bomb(self, chunk: Chunk | None) -> None:
        """Raise Fault BAD_LOG for chunks that claim more than a run of their size can hold; nothing was uncompressed then."""
        if chunk is None or not chunk.compression:
            return
        self._claimed_bytes += chunk.uncompressed_size
        most_bytes = _ANYWAY_BYTES + _LARGEST_RATIO * self.size_bytes
        told = f"{self.path}: {self.size_bytes / 1e3:.0f} kB"
        if chunk.uncompressed_size > LARGEST_CHUNK_BYTES:
            rule = f"must be at most {LARGEST_CHUNK_BYTES / 1e6:.0f} MB"
            told += f": holds a chunk of {chunk.uncompressed_size / 1e6:.0f} MB: {rule}"
        elif self._claimed_bytes > most_bytes:
            rule = f"must be at most {most_bytes / 1e6:.0f} MB for a log of its size"
            told += f": would unpack to more than {self._claimed_bytes / 1e6:.0f} MB: {rule}"
        else:
            return
        raise Fault("BAD_LOG", f"{told}; it was made to fill the memory or is damaged: do not trust it")

    def _must_be_ours(self) -> None:
        """Raise Fault BAD_LOG for a file without a topic of this project."""
        foreign = self._definitions.foreign_schemas()
        # of a run that was cut before its first definition
        began = self.header is not None and self.header.library in READABLE
        if self._any_own or (began and not foreign):
            return
        if foreign:
            named = ", ".join(foreign[:_MOST_NAMES]) + (", ..." if len(foreign) > _MOST_NAMES else "")
            line = f"{self.path}: holds no topic of a run: its messages are {named}; give a run log"
            raise Fault("BAD_LOG", f"{line}. `stickslip log import` takes in measured data of another program")
        lost = "holds no header" if self.header is None else "defines no topic"
        why = "it was cut before anything was written, or its first bytes are damaged"
        raise Fault("BAD_LOG", f"{self.path}: {lost}; {why}")

    def _after_damage(self, file: IO[bytes], from_bytes: int, size_bytes: int) -> int | None:
        """Start of the next whole chunk after bytes that cannot be read; None when there is none."""
        start = next_chunk(file, from_bytes + 1, size_bytes)
        if start is not None:
            self.damage = self.damage.and_also(bad_records=1)
            return start
        if size_bytes - from_bytes > len(MAGIC):
            file.seek(size_bytes - len(MAGIC))
            if file.read() == MAGIC:  # what is behind the damage has no chunk: the index, or messages without one
                self.damage = self.damage.and_also(bad_records=1)._replace(closed=True)
        return None

    def _learn(self, opcode: int, content: bytes) -> None:
        stream = ReadDataStream(BytesIO(content))
        try:
            if opcode == Opcode.HEADER:
                self.header = Header.read(stream)
            elif opcode in _DEFINITIONS:
                self._definitions.learn(opcode, content)
            elif opcode == Opcode.METADATA:
                metadata = Metadata.read(stream)
                if metadata.name == LOST:
                    self.damage = also_before(self.damage, metadata.metadata.get("what", ""))
                elif metadata.name not in OF_FILES:
                    self.metadata[metadata.name] = dict(metadata.metadata)
            elif opcode == Opcode.STATISTICS:
                self._stated = Statistics.read(stream).message_count
        except UNREADABLE:
            self.damage = self.damage.and_also(bad_records=1)
        if opcode == Opcode.HEADER and self.header is not None:
            refuse_other_version(self.path, self.header.library)
