"""The bytes of one MCAP chunk: unpacked and checked for any compression; search for the next chunk after damage."""

import contextlib
import re
import struct
import zlib
from typing import IO, Any, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk

from bridge.log.library import HEAD

LARGEST_RECORD_BYTES = 1 << 30  # longest record that is read; attachments and records of other programs are skipped
# Largest uncompressed size of a chunk. Common writers end a chunk after a few MB; a larger one is meant to exhaust the memory.
LARGEST_CHUNK_BYTES = 1 << 26
UNREADABLE = (
    McapError,
    struct.error,
    UnicodeDecodeError,
    zstandard.ZstdError,
    RuntimeError,
    MemoryError,
    OverflowError,
)
# The name of the compression is 28 bytes into the content of a chunk (after two times, a size and a checksum), 37 bytes into its
# record.
_MARK_AT = 28
_MARKS = tuple(struct.pack("<I", len(name)) + name.encode() for name in ("zstd", "lz4"))
_LONGEST_MARK_BYTES = max(map(len, _MARKS))
# begin of a chunk record, from its opcode to the name of its compression; a look-ahead, since matches may overlap
_CHUNK_HEAD = re.compile(rb"(?=\x06.{36}(?:\x04\0\0\0zstd|\x03\0\0\0lz4|\0\0\0\0))", re.DOTALL)
_HEAD_BYTES = HEAD.size + _MARK_AT + _LONGEST_MARK_BYTES
_SEARCH_BYTES = 1 << 20  # bytes of a damaged file searched at once
_SKIPPED = frozenset({Opcode.ATTACHMENT})  # records that are skipped, besides opcodes unknown to MCAP


class FileRecord(NamedTuple):
    """One record of an MCAP file."""

    opcode: int
    content: bytes  # only its first bytes for a skipped record
    end_bytes: int  # end of the record in the file

    @property
    def is_chunk(self) -> bool:
        """Whether it is a chunk by its opcode or, if that is damaged, by its content."""
        return self.opcode == Opcode.CHUNK or self.content.startswith(_MARKS, _MARK_AT)


class _InPlace:
    """A stream that returns its bytes without a copy; a chunk holds half a megabyte."""

    def __init__(self, content: bytes) -> None:
        self._left = memoryview(content)

    def read(self, size: int) -> memoryview:
        """The next `size` bytes, or as many as are left."""
        part, self._left = self._left[:size], self._left[size:]
        return part


def next_record(file: IO[bytes], at_bytes: int, size_bytes: int) -> FileRecord | None:
    """The next whole record; None where the file is cut or the bytes are not a record.

    Args:
        file: the file, positioned at `at_bytes`.
        at_bytes: begin of the record.
        size_bytes: size of the file.

    """
    head = file.read(HEAD.size)
    if len(head) < HEAD.size:
        return None
    opcode, length = HEAD.unpack(head)
    end_bytes = at_bytes + HEAD.size + length
    if opcode == 0 or end_bytes > size_bytes:
        return None
    if opcode in _SKIPPED or opcode > Opcode.DATA_END:
        record = FileRecord(opcode, file.read(min(length, _HEAD_BYTES)), end_bytes)
        if not record.is_chunk:
            file.seek(end_bytes)
            return record
        return FileRecord(opcode, record.content + file.read(length - len(record.content)), end_bytes)
    return FileRecord(opcode, file.read(length), end_bytes) if length <= LARGEST_RECORD_BYTES else None


def next_chunk(file: IO[bytes], from_bytes: int, size_bytes: int) -> int | None:
    """Start of the first whole chunk with a right checksum at or after `from_bytes`; None if no chunk follows."""
    at = from_bytes
    while at < size_bytes:
        file.seek(at)
        window = file.read(_SEARCH_BYTES)
        for match in _CHUNK_HEAD.finditer(window):
            start = at + match.start()
            file.seek(start)
            record = next_record(file, start, size_bytes)
            if record is not None and _is_whole(record.content):
                return start
        at += max(len(window) - _HEAD_BYTES + 1, 1)
    return None


def _is_whole(content: bytes) -> bool:
    """Whether bytes are a chunk that can be unpacked; an uncompressed chunk must have a correct checksum."""
    chunk = opened(content)
    if chunk is None or chunk.uncompressed_size > LARGEST_CHUNK_BYTES:
        return False
    return bool(chunk.compression or chunk.uncompressed_crc) and unpacked(chunk) is not None


def opened(content: bytes) -> Chunk | None:
    """A chunk, still packed; None if it cannot be read or its size is wrong."""
    with contextlib.suppress(*UNREADABLE):
        stream: Any = _InPlace(content)
        chunk = Chunk.read(ReadDataStream(stream))
        size_bytes = chunk.uncompressed_size
        # checked first: with a damaged size the library would reserve that much memory
        if chunk.compression == "zstd" and zstandard.frame_content_size(chunk.data) in {-1, size_bytes}:
            return chunk  # -1: its writer left the size out
        if chunk.compression == "lz4" or (chunk.compression == "" and len(chunk.data) == size_bytes):
            return chunk
    return None


def unpacked(chunk: Chunk | None) -> bytes | None:
    """The records of a chunk; None if it cannot be read, or its size or checksum is wrong. Checksum 0 is not checked."""
    if chunk is None:
        return None
    size_bytes = chunk.uncompressed_size
    with contextlib.suppress(*UNREADABLE):
        if chunk.compression == "zstd":
            data = zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size_bytes)
        elif chunk.compression == "lz4":  # one byte more than claimed, to detect a larger content
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size_bytes + 1)
        else:
            data = bytes(chunk.data)
        if len(data) == size_bytes and chunk.uncompressed_crc in {0, zlib.crc32(data)}:
            return data
    return None
