"""The bytes of one MCAP chunk: unpacked and checked, whatever its compression, and found again after damage."""

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

LARGEST_RECORD_BYTES = 1 << 30  # that is read; attachments and records of other programs are passed over, however long
# Uncompressed, of one chunk. Every writer of such logs ends a chunk at some MB at most; larger ones are made to fill a memory.
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
# A chunk holds the name of its compression 28 bytes into its content (after two times, a size and a checksum), which is 37
# bytes into its record.
_MARK_AT = 28
_MARKS = tuple(struct.pack("<I", len(name)) + name.encode() for name in ("zstd", "lz4"))
_LONGEST_MARK_BYTES = max(map(len, _MARKS))
# from the opcode on; a look ahead, as one such stretch of bytes may begin within another
_CHUNK_HEAD = re.compile(rb"(?=\x06.{36}(?:\x04\0\0\0zstd|\x03\0\0\0lz4|\0\0\0\0))", re.DOTALL)
_HEAD_BYTES = HEAD.size + _MARK_AT + _LONGEST_MARK_BYTES
_SEARCH_BYTES = 1 << 20
_PASSED_OVER = frozenset({Opcode.ATTACHMENT})  # these, and opcodes that the MCAP format does not name


class Record(NamedTuple):
    """One record of a file."""

    opcode: int
    content: bytes  # its first bytes alone where the record is passed over
    end_bytes: int  # place of its end in the file

    @property
    def is_chunk(self) -> bool:
        """Whether it is a chunk, by its opcode or, where that is damaged, by its content."""
        return self.opcode == Opcode.CHUNK or self.content.startswith(_MARKS, _MARK_AT)


class _InPlace:
    """A stream that hands out its bytes without a copy; a chunk has half a megabyte of them."""

    def __init__(self, content: bytes) -> None:
        self._left = memoryview(content)

    def read(self, size: int) -> memoryview:
        """The next `size` bytes, or as many as are left."""
        part, self._left = self._left[:size], self._left[size:]
        return part


def next_record(file: IO[bytes], at_bytes: int, size_bytes: int) -> Record | None:
    """The next whole record; None where the file is cut or the bytes are not a record.

    Args:
        file: at the place `at_bytes`.
        at_bytes: where the record begins.
        size_bytes: of the file.

    """
    head = file.read(HEAD.size)
    if len(head) < HEAD.size:
        return None
    opcode, length = HEAD.unpack(head)
    end_bytes = at_bytes + HEAD.size + length
    if opcode == 0 or end_bytes > size_bytes:
        return None
    if opcode in _PASSED_OVER or opcode > Opcode.DATA_END:
        record = Record(opcode, file.read(min(length, _HEAD_BYTES)), end_bytes)
        if not record.is_chunk:
            file.seek(end_bytes)
            return record
        return Record(opcode, record.content + file.read(length - len(record.content)), end_bytes)
    return Record(opcode, file.read(length), end_bytes) if length <= LARGEST_RECORD_BYTES else None


def next_chunk(file: IO[bytes], from_bytes: int, size_bytes: int) -> int | None:
    """Start of the first whole chunk with a right checksum at or after `from_bytes`; None when there is none."""
    at = from_bytes
    while at < size_bytes:
        file.seek(at)
        window = file.read(_SEARCH_BYTES)
        for found in _CHUNK_HEAD.finditer(window):
            start = at + found.start()
            file.seek(start)
            record = next_record(file, start, size_bytes)
            if record is not None and _is_whole(record.content):
                return start
        at += max(len(window) - _HEAD_BYTES + 1, 1)
    return None


def _is_whole(content: bytes) -> bool:
    """Whether bytes are a chunk that can be unpacked; one without compression must have a checksum that says so."""
    chunk = opened(content)
    if chunk is None or chunk.uncompressed_size > LARGEST_CHUNK_BYTES:
        return False
    return bool(chunk.compression or chunk.uncompressed_crc) and unpacked(chunk) is not None


def opened(content: bytes) -> Chunk | None:
    """A chunk as it is in the file; None where it cannot be read, or where its size is wrong."""
    with contextlib.suppress(*UNREADABLE):
        stream: Any = _InPlace(content)
        chunk = Chunk.read(ReadDataStream(stream))
        size_bytes = chunk.uncompressed_size
        # checked before: with a damaged size the library would reserve that much memory
        if chunk.compression == "zstd" and zstandard.frame_content_size(chunk.data) in {-1, size_bytes}:
            return chunk  # -1: its writer left the size out
        if chunk.compression == "lz4" or (chunk.compression == "" and len(chunk.data) == size_bytes):
            return chunk
    return None


def unpacked(chunk: Chunk | None) -> bytes | None:
    """The records of a chunk; None of one that cannot be read, or whose size or checksum is wrong. A checksum of 0 is none."""
    if chunk is None:
        return None
    size_bytes = chunk.uncompressed_size
    with contextlib.suppress(*UNREADABLE):
        if chunk.compression == "zstd":
            data = zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size_bytes)
        elif chunk.compression == "lz4":  # a byte more than is claimed, so that more is seen
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size_bytes + 1)
        else:
            data = bytes(chunk.data)
        if len(data) == size_bytes and chunk.uncompressed_crc in {0, zlib.crc32(data)}:
            return data
    return None
