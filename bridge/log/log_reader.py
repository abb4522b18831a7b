"""One pass over the records of a run log, from the front and without its index.

So a cut or damaged file loses only the part that is cut or damaged: a checksum shows a damaged chunk, and after a record that
cannot be read the pass goes on with the next whole chunk.
"""

import contextlib
import struct
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from io import BytesIO
from pathlib import Path
from typing import IO, Any, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Metadata, Schema

from bridge.faults import Fault
from bridge.log.chunk_messages import Chunked, Messages, messages_of
from bridge.log.damage import Damage
from bridge.log.library import HEAD, MAGIC, READABLE
from bridge.log.storage.parts import OF_FILES, parts_of
from bridge.wire.topics import TOPICS

_LARGEST_RECORD_BYTES = 1 << 30
# Uncompressed, of one chunk. Every writer of such logs ends a chunk at some MB at most; larger ones are made to fill a memory.
_LARGEST_CHUNK_BYTES = 1 << 26
# Uncompressed bytes of all chunks for a byte of the log, and what any log may have besides. Data that compress to nothing, as
# zeros, still cost 16 bytes of index a message, so that not even a block of 200 samples of zeros reaches 200.
_LARGEST_RATIO = 200
_ANYWAY_BYTES = 1 << 24
_FOOTER_BYTES = 20
# Every chunk of this project holds "zstd" 28 bytes into its content (after two times, a size and a checksum), which is 37 bytes
# into its record.
_CHUNK_MARK = struct.pack("<I4s", 4, b"zstd")
_MARK_AT = 28
_SEARCH_BYTES = 1 << 20
# of chunks that are taken apart at once; with less the calls cost more than the work, as a chunk of 0.1 s holds 0.1 MB
AT_ONCE_BYTES = 1 << 19
_UNREADABLE = (McapError, struct.error, UnicodeDecodeError, zstandard.ZstdError, MemoryError, OverflowError)
_CHANNEL_TOPICS = {i + 1: topic.name for i, topic in enumerate(topic for topic in TOPICS if topic.logged)}


class _Packed(NamedTuple):
    """A chunk on its way out of the file."""

    chunk: Chunk | None  # None where it cannot be read
    unpacked: Future[bytes]
    indexes: list[bytes]  # contents of the index records after it
    end_bytes: int  # place of its end in the file


class LogReader:
    """One pass over a log, all of its files. `damage` is complete after the pass; `metadata` and `channels` grow during it.

    Args:
        path: the first file; the files that go on from it are read too.
        alone: read no other file.

    """

    def __init__(self, path: Path, alone: bool = False) -> None:
        self.path = path
        self.alone = alone
        self.damage = Damage(0, 0, closed=False)
        self._claimed_bytes = 0  # uncompressed size of the chunks so far
        self.header: Header | None = None
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.size_bytes = 0
        self.position_bytes = 0  # end of the part that was read

    def count_bad_messages(self, count: int) -> None:
        """Add `count` messages that are whole but not messages of their topic to the damage."""
        if count:
            self._count(bad_records=count)

    def topic(self, channel_id: int) -> str:
        """Topic of a channel; where its definition is damaged, the topic that every log of this version gives the channel."""
        if channel_id in self.channels:
            return self.channels[channel_id].topic.removeprefix("/")
        return _CHANNEL_TOPICS.get(channel_id, f"channel {channel_id}")

    def messages(self) -> Iterator[Messages]:
        """The messages of one chunk after the other, of several small ones at once.

        Raises Fault BAD_LOG when the file is not a run log.
        """
        some: list[Chunked] = []
        for chunk in self._chunks():
            some.append(chunk)
            if sum(len(one.data) for one in some) >= AT_ONCE_BYTES:
                yield messages_of(some)
                some = []
        if some:
            yield messages_of(some)

    def _chunks(self) -> Iterator[Chunked]:
        """Every chunk that is not damaged, uncompressed."""
        try:
            paths = [self.path] if self.alone else parts_of(self.path)
            sizes_bytes = [path.stat().st_size for path in paths]
            self.size_bytes = sum(sizes_bytes)
            before_bytes = 0
            closed = True
            for path, size_bytes in zip(paths, sizes_bytes, strict=True):
                self.damage = self.damage._replace(closed=False)
                yield from self._of_file(path, size_bytes, before_bytes)
                closed &= self.damage.closed
                before_bytes += size_bytes
                self.position_bytes = before_bytes
            self.damage = self.damage._replace(closed=closed)
        except OSError as error:
            raise Fault(
                "BAD_LOG", f"{self.path}: cannot be read: {error.strerror}; give the path of a .mcap file"
            ) from None
        self._must_have_header()

    def _of_file(self, path: Path, size_bytes: int, before_bytes: int) -> Iterator[Chunked]:
        # the next chunk is uncompressed while the caller works on the present one
        with path.open("rb") as file, ThreadPoolExecutor(max_workers=1) as beside:
            ready: _Packed | None = None
            for packed in self._packed(file, beside, size_bytes):
                if ready is not None:
                    yield from self._taken_out(ready, before_bytes)
                ready = packed
            if ready is not None:
                yield from self._taken_out(ready, before_bytes)

    def _taken_out(self, packed: _Packed, before_bytes: int) -> Iterator[Chunked]:
        """A chunk; nothing, but for the count, where it is damaged."""
        data = _checked(packed.chunk, packed.unpacked.result)
        if data is None:
            self._count(bad_chunks=1)
            return
        self._must_have_header()
        self._learn_channels(data)
        self.position_bytes = before_bytes + packed.end_bytes
        yield Chunked(data, packed.indexes)

    def _packed(self, file: IO[bytes], beside: ThreadPoolExecutor, size_bytes: int) -> Iterator[_Packed]:
        """Every chunk, while it is uncompressed."""
        if file.read(len(MAGIC)) != MAGIC:
            line = f"{self.path}: {size_bytes} bytes, no MCAP file (its first 8 bytes say so); give a run log"
            raise Fault("BAD_LOG", line)
        whole_bytes = len(MAGIC)
        packed: _Packed | None = None
        while not self.damage.closed:
            record = _next(file, size_bytes - whole_bytes)
            is_chunk = record is not None and _is_chunk(*record)
            if packed is not None and (record is None or is_chunk or record[0] != Opcode.MESSAGE_INDEX):
                yield packed  # now that all of its indexes were read
                packed = None
            if record is None:
                start = self._after_damage(file, whole_bytes, size_bytes)
                if start is None:
                    break
                whole_bytes = file.seek(start)
                continue
            opcode, content = record
            whole_bytes += HEAD.size + len(content)
            if is_chunk:
                chunk = _opened(content)
                self._refuse_a_bomb(chunk)
                packed = _Packed(chunk, beside.submit(_unpacked, chunk), [], whole_bytes)
            elif opcode == Opcode.FOOTER and len(content) == _FOOTER_BYTES:
                self.damage = self.damage._replace(closed=True)
            elif packed is not None:
                packed.indexes.append(content)
            else:
                self._learn(opcode, content)
        if not self.damage.closed:
            self._count(cut_bytes=size_bytes - whole_bytes)

    def _count(self, cut_bytes: int = 0, bad_chunks: int = 0, bad_records: int = 0) -> None:
        now = self.damage
        self.damage = Damage(
            now.cut_bytes + cut_bytes, now.bad_chunks + bad_chunks, now.closed, now.bad_records + bad_records
        )

    def _refuse_a_bomb(self, chunk: Chunk | None) -> None:
        """Raise Fault BAD_LOG for chunks that claim more than a run of their size can hold; nothing was uncompressed then."""
        if chunk is None or chunk.compression != "zstd":
            return
        self._claimed_bytes += chunk.uncompressed_size
        most_bytes = _ANYWAY_BYTES + _LARGEST_RATIO * self.size_bytes
        told = f"{self.path}: {self.size_bytes / 1e3:.0f} kB"
        if chunk.uncompressed_size > _LARGEST_CHUNK_BYTES:
            rule = f"must be at most {_LARGEST_CHUNK_BYTES / 1e6:.0f} MB"
            told += f": holds a chunk of {chunk.uncompressed_size / 1e6:.0f} MB: {rule}"
        elif self._claimed_bytes > most_bytes:
            rule = f"must be at most {most_bytes / 1e6:.0f} MB for a log of its size"
            told += f": would unpack to more than {self._claimed_bytes / 1e6:.0f} MB: {rule}"
        else:
            return
        raise Fault("BAD_LOG", f"{told}; it was made to fill the memory or is damaged: do not trust it")

    def _must_have_header(self) -> None:
        if self.header is None:
            line = (
                f"{self.path}: holds no header; it was cut before anything was written, or its first bytes are damaged"
            )
            raise Fault("BAD_LOG", line)

    def _after_damage(self, file: IO[bytes], from_bytes: int, size_bytes: int) -> int | None:
        """Start of the next whole chunk after bytes that cannot be read; None when there is none."""
        start = _next_chunk(file, from_bytes + 1, size_bytes)
        if start is not None:
            self._count(bad_records=1)
            return start
        if size_bytes - from_bytes > len(MAGIC):
            file.seek(size_bytes - len(MAGIC))
            if file.read() == MAGIC:  # only the index is damaged; everything before it was read
                self._count(bad_records=1)
                self.damage = self.damage._replace(closed=True)
        return None

    def _learn(self, opcode: int, content: bytes) -> None:
        stream = ReadDataStream(BytesIO(content))
        try:
            if opcode == Opcode.HEADER:
                self.header = Header.read(stream)
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                self.schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(stream)
                self.channels[channel.id] = channel
            elif opcode == Opcode.METADATA:
                metadata = Metadata.read(stream)
                if metadata.name not in OF_FILES:
                    self.metadata[metadata.name] = dict(metadata.metadata)
        except _UNREADABLE:
            self._count(bad_records=1)
        if opcode == Opcode.HEADER and self.header is not None and self.header.library not in READABLE:
            by = self.header.library
            known = " or ".join(map(repr, READABLE))
            raise Fault(
                "BAD_LOG", f"{self.path}: written by {by!r}: must be {known}; another program's or version's log"
            )

    def _learn_channels(self, data: bytes) -> None:
        at = 0
        while at + HEAD.size <= len(data) and data[at] in {Opcode.SCHEMA, Opcode.CHANNEL}:
            opcode, length = HEAD.unpack_from(data, at)
            at += HEAD.size
            self._learn(opcode, data[at : at + length])
            at += length


class _InPlace:
    """A stream that hands out its bytes without a copy; a chunk has half a megabyte of them."""

    def __init__(self, content: bytes) -> None:
        self._left = memoryview(content)

    def read(self, size: int) -> memoryview:
        """The next `size` bytes, or as many as are left."""
        part, self._left = self._left[:size], self._left[size:]
        return part


def _is_chunk(opcode: int, content: bytes) -> bool:
    """Whether a record is a chunk, by its opcode or, where that is damaged, by its content."""
    return opcode == Opcode.CHUNK or content[_MARK_AT : _MARK_AT + len(_CHUNK_MARK)] == _CHUNK_MARK


def _next(file: IO[bytes], left_bytes: int) -> tuple[int, bytes] | None:
    """Opcode and content of the next whole record; None where the file is cut or the bytes are not a record.

    Args:
        left_bytes: from the present place in the file to its end.

    """
    head = file.read(HEAD.size)
    if len(head) < HEAD.size:
        return None
    opcode, length = HEAD.unpack(head)
    if opcode == 0 or opcode > Opcode.DATA_END or length > min(left_bytes - HEAD.size, _LARGEST_RECORD_BYTES):
        return None
    return opcode, file.read(length)


def _next_chunk(file: IO[bytes], from_bytes: int, size: int) -> int | None:
    """Start of the first whole chunk with a right checksum at or after `from_bytes`; None when there is none."""
    mark_offset = HEAD.size + _MARK_AT
    at = from_bytes
    while at < size:
        file.seek(at)
        window = file.read(_SEARCH_BYTES)
        found = window.find(_CHUNK_MARK)
        while found >= 0:
            start = at + found - mark_offset
            if start >= from_bytes:
                file.seek(start)
                record = _next(file, size - start)
                if record is not None and record[0] == Opcode.CHUNK and _uncompressed(record[1]) is not None:
                    return start
            found = window.find(_CHUNK_MARK, found + 1)
        at += max(len(window) - len(_CHUNK_MARK) + 1, 1)
    return None


def _uncompressed(content: bytes) -> bytes | None:
    """The records of a chunk; None when its checksum or its size is wrong."""
    chunk = _opened(content)
    if chunk is None or chunk.uncompressed_size > _LARGEST_CHUNK_BYTES:
        return None
    return _checked(chunk, lambda: _unpacked(chunk))


def _opened(content: bytes) -> Chunk | None:
    """A chunk as it is in the file; None where it cannot be read, or where its size is wrong."""
    with contextlib.suppress(*_UNREADABLE):
        stream: Any = _InPlace(content)
        chunk = Chunk.read(ReadDataStream(stream))
        # checked before: with a damaged size the library would reserve that much memory
        size_bytes = chunk.uncompressed_size
        if (
            chunk.compression != "zstd"
            or zstandard.frame_content_size(chunk.data) == size_bytes <= _LARGEST_RECORD_BYTES
        ):
            return chunk
    return None


def _unpacked(chunk: Chunk | None) -> bytes:
    """The records of a chunk; nothing of one that cannot be read. Raises ZstdError, MemoryError."""
    if chunk is None:
        return b""
    return zstandard.ZstdDecompressor().decompress(chunk.data) if chunk.compression == "zstd" else bytes(chunk.data)


def _checked(chunk: Chunk | None, unpacked: Callable[[], bytes]) -> bytes | None:
    """What `unpacked` returns, where the chunk's checksum is that of it; else None."""
    with contextlib.suppress(*_UNREADABLE):
        data = unpacked()
        if chunk is not None and zlib.crc32(data) == chunk.uncompressed_crc:
            return data
    return None
