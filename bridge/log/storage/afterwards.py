"""A table added to a closed log: the end of the file is rewritten with one more link of the chain and a new index."""

import hashlib
import json
import struct
import zlib
from io import BytesIO
from pathlib import Path
from typing import IO, Any

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Footer, McapRecord, Metadata, MetadataIndex, Statistics, SummaryOffset

from bridge.log.library import HEAD, MAGIC
from bridge.log.live import locked
from bridge.log.reading.chunk_bytes import UNREADABLE
from bridge.log.storage.chain import CHAIN, HashChain, link_record
from bridge.log.storage.parts import parts_of

_FOOTER_BYTES = HEAD.size + 20
_DATA_END_BYTES = HEAD.size + 4
_LINK_BYTES = 512  # within which the last link is, before the end of the data
_LARGEST_INDEX_BYTES = 1 << 28  # for a log of a month; a log with a larger index is not changed


def add_table(path: Path, name: str, fields: dict[str, Any], chain: HashChain) -> HashChain:
    """Write a table of values, each as JSON, behind the last chunk of a log. Returns the new chain.

    A log is not changed unless it is closed, not being recorded, and written by this project's recorder alone.

    Args:
        path: the log; of several files the last one gets the table.
        name: of the table.
        fields: of the table.
        chain: the log's chain so far.

    """
    if not (chain.closed and chain.ended) or chain.changes:
        return chain
    table = Metadata(name=name, metadata={key: json.dumps(value, default=str) for key, value in fields.items()})
    try:
        with parts_of(path)[-1].open("r+b") as file:
            if not locked(file):
                return chain
            last = _added(file, table)
    except (OSError, ValueError, KeyError, *UNREADABLE):
        return chain
    return chain._replace(links=chain.links + 1, last=last.hex(), covered_bytes=file_end(path)) if last else chain


def file_end(path: Path) -> int:
    """The end of the last link of a log's last file."""
    with parts_of(path)[-1].open("rb") as file:
        return _summary_start(file) - _DATA_END_BYTES


def _summary_start(file: IO[bytes]) -> int:
    """Start of the index; 0 without an index."""
    file.seek(-_FOOTER_BYTES - len(MAGIC), 2)
    return Footer.read(ReadDataStream(BytesIO(file.read(_FOOTER_BYTES)[HEAD.size :]))).summary_start


def _added(file: IO[bytes], table: Metadata) -> bytes:
    """Write the table and the new end; returns the hash of the new last link, or nothing if another program wrote the end."""
    start = _summary_start(file)
    size = file.seek(0, 2)
    if not start or size - start > _LARGEST_INDEX_BYTES:
        return b""
    at = start - _DATA_END_BYTES
    file.seek(max(at - _LINK_BYTES, 0))
    before = file.read(at - max(at - _LINK_BYTES, 0))
    mark = struct.pack("<I", len(CHAIN)) + CHAIN.encode()
    record = before[before.rindex(mark) - HEAD.size :]
    link = Metadata.read(ReadDataStream(BytesIO(record[HEAD.size :]))).metadata
    number, digest = int(link["link"]), bytes.fromhex(link["sha256"])
    if record != link_record(number, digest, ended=True):
        return b""
    file.seek(at)
    data_end, summary = file.read(_DATA_END_BYTES), file.read(size - start - _FOOTER_BYTES - len(MAGIC))
    added = _encoded(table)
    new = hashlib.sha256(digest + added).digest()
    place = MetadataIndex(offset=at, length=len(added), name=table.name)
    added += link_record(number + 1, new, ended=True) + data_end
    file.seek(at)
    file.write(added + _index(summary, place, at + len(added)))
    file.flush()
    return new


def _index(summary: bytes, place: MetadataIndex, start: int) -> bytes:
    """The index that begins at `start`: the old index plus the place of the new table; with footer and magic."""
    groups: dict[int, bytes] = {}
    at = 0
    while at < len(summary):
        opcode, length = HEAD.unpack_from(summary, at)
        end = at + HEAD.size + length
        content = summary[at:end]
        if opcode == Opcode.STATISTICS:
            counts = Statistics.read(ReadDataStream(BytesIO(content[HEAD.size :])))
            counts.metadata_count += 2  # the table and the link
            content = _encoded(counts)
        if opcode != Opcode.SUMMARY_OFFSET:
            groups[opcode] = groups.get(opcode, b"") + content
        at = end
    groups[Opcode.METADATA_INDEX] = groups.get(Opcode.METADATA_INDEX, b"") + _encoded(place)
    offsets: list[McapRecord] = []
    at = start
    for opcode, group in groups.items():
        offsets.append(SummaryOffset(opcode, at, len(group)))
        at += len(group)
    index = b"".join(groups.values()) + _encoded(*offsets)
    head = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, at)
    footer = Footer(summary_start=start, summary_offset_start=at, summary_crc=zlib.crc32(head, zlib.crc32(index)))
    return index + _encoded(footer) + MAGIC


def _encoded(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()
