"""The hash chain of a log: a link after each chunk, SHA-256 over all bytes since the link before and over that link's own hash.

A link is a metadata record named `chain`, which other programs skip. Any changed byte before the last link is detected, in
messages, definitions and configurations alike; the checksum of the index covers the rest. A killed log can be verified up to its
last whole chunk. The chain has no secret: whoever can write the file can also compute a new chain, unless its last hash was
noted elsewhere.

A program that rewrites a log, as `mcap compress` or `mcap filter` do, drops the links or copies them to places where none of them
fits. After a changed byte all links but one or two fit. The original content of a rewritten log is not proved.
"""

import contextlib
import hashlib
import struct
import zlib
from io import BytesIO
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Header, Metadata

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.log.library import HEAD, MAGIC, READABLE
from bridge.log.reading.chunk_bytes import UNREADABLE
from bridge.units import counted

CHAIN = "chain"  # the name of the metadata records
_LONGEST_HEADER_BYTES = 4096  # of the content; a longer header belongs to another program
_ANOTHER = "another program"
_LONGEST_LINK_BYTES = 256  # of the content; a longer record is not a link
_PIECE_BYTES = 1 << 20
_FOOTER_BYTES = 20
_ENDING_BYTES = HEAD.size + _FOOTER_BYTES + len(MAGIC)  # from the footer on
_STRETCHES = 16  # most changed stretches listed one by one


class Stretch(NamedTuple):
    """Bytes of a file that were changed after writing."""

    file: str
    from_bytes: int
    until_bytes: int


class HashChain(NamedTuple):
    """The result of the hash chain of a log, or of one of its files."""

    links: int  # 0: the log has no chain
    first: str  # SHA-256 of the first link, hexadecimal; empty without one
    last: str
    changed: list[Stretch]  # at most 16
    changes: int  # all of them
    ended: bool  # the last link is marked as the last
    covered_bytes: int  # end of the last link
    closed: bool  # the file has its footer
    rewritten_by: str = ""  # the library of a program that rewrote the log, after which the chain proves nothing

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return self._asdict() | {"changed": [stretch._asdict() for stretch in self.changed]}


def link_record(number: int, digest: bytes, ended: bool) -> bytes:
    """The bytes of a link."""
    builder = RecordBuilder()
    fields = {"link": str(number), "sha256": digest.hex()} | ({"end": "1"} if ended else {})
    Metadata(name=CHAIN, metadata=fields).write(builder)
    return builder.end()


class _Walk:
    """One pass over the records of a file, without taking them apart."""

    def __init__(self, file: IO[bytes], name: str, size: int) -> None:
        self.file, self.name, self.size = file, name, size
        self.at = 0
        self.hash = hashlib.sha256()
        self.since = 0  # end of the last link
        self.links, self.first, self.last = 0, "", ""
        self.fits = 0  # links with the right hash over at least one byte
        self.library = ""
        self.lost = False  # the record boundaries are lost
        self.changed: list[Stretch] = []
        self.changes = 0
        self.ended = self.closed = False

    def change(self, from_bytes: int, until_bytes: int) -> None:
        self.changes += 1
        if len(self.changed) < _STRETCHES:
            self.changed.append(Stretch(self.name, from_bytes, until_bytes))

    def take(self, size: int) -> None:
        """Hash the next `size` bytes."""
        while size > 0:
            data = self.file.read(min(size, _PIECE_BYTES))
            if not data:
                return
            self.hash.update(data)
            self.at += len(data)
            size -= len(data)

    def run(self) -> None:
        self.records()
        if not self.closed:
            self.file.seek(max(self.size - len(MAGIC), 0))
            self.closed = self.file.read() == MAGIC
            if self.closed:
                self.lost = True
                self.change(self.since, self.size)

    def records(self) -> None:
        self.take(len(MAGIC))
        while True:
            start = self.at
            head = self.file.read(HEAD.size)
            if len(head) < HEAD.size:
                return
            opcode, length = HEAD.unpack(head)
            if opcode == 0 or length > self.size - start - HEAD.size:
                return
            if opcode == Opcode.DATA_END:
                self.end(start, head)
                return
            if opcode == Opcode.HEADER and start == len(MAGIC) and length <= _LONGEST_HEADER_BYTES:
                content = self.file.read(length)
                self.hash.update(head + content)
                self.at += len(head) + len(content)
                with contextlib.suppress(*UNREADABLE):
                    self.library = Header.read(ReadDataStream(BytesIO(content))).library
                continue
            if opcode == Opcode.METADATA and length <= _LONGEST_LINK_BYTES:
                content = self.file.read(length)
                if self.link(head + content, content):
                    continue
                self.hash.update(head + content)
                self.at += len(head) + len(content)
                continue
            self.hash.update(head)
            self.at += len(head)
            self.take(length)

    def link(self, record: bytes, content: bytes) -> bool:
        """Compare a link; False for any other metadata record."""
        try:
            metadata = Metadata.read(ReadDataStream(BytesIO(content)))
            stored = bytes.fromhex(metadata.metadata["sha256"])
        except Exception:
            return False
        if metadata.name != CHAIN:
            return False
        ended = metadata.metadata.get("end") == "1"
        digest = self.hash.digest()
        if stored != digest or record != link_record(self.links, stored, ended):
            self.change(self.since, self.at + len(record))
        self.fits += stored == digest and self.at > self.since
        self.at += len(record)
        self.since = self.at
        self.links += 1
        self.ended = ended
        self.last = stored.hex()
        self.first = self.first or self.last
        self.hash = hashlib.sha256(stored)
        return True

    def end(self, start: int, head: bytes) -> None:
        """Compare the bytes after the data with the checksum in the footer."""
        if self.links and self.since < start:
            self.change(self.since, start)
        data_end = head + self.file.read(4)
        begins = start + len(data_end)
        self.file.seek(max(self.size - _ENDING_BYTES, begins))
        ending = self.file.read()
        self.closed = ending.endswith(MAGIC)
        summary_start, offset_start, crc = (
            struct.unpack("<QQI", ending[HEAD.size : HEAD.size + _FOOTER_BYTES])
            if len(ending) == _ENDING_BYTES
            else (0, 0, 0)
        )
        footer = HEAD.pack(Opcode.FOOTER, _FOOTER_BYTES) + struct.pack("<QQI", summary_start, offset_start, crc) + MAGIC
        # other programs may write a checksum of the data, and none of the summary
        own_end = data_end == HEAD.pack(Opcode.DATA_END, 4) + bytes(4)
        right = ending == footer and (own_end or not self.links)
        if summary_start:
            right &= summary_start == begins and (crc == self.summary_crc(begins) or not (crc or self.links))
        else:
            right &= self.size - begins == _ENDING_BYTES and not (offset_start or crc)
        # a file that was cut within its index does not count as changed
        if not right and (self.closed or ending.startswith(HEAD.pack(Opcode.FOOTER, _FOOTER_BYTES))):
            self.change(start, self.size)

    def rewritten_by(self) -> str:
        """The library of the program that rewrote the file after its recording; empty if it was not rewritten."""
        ours = self.library in READABLE
        if self.lost:  # a changed byte may have altered the library name, and the links cannot be found
            return ""
        if self.links > 1 and not self.fits:
            return _ANOTHER if ours else self.library or _ANOTHER
        return self.library if self.library and not ours and not self.fits else ""

    def summary_crc(self, begins: int) -> int:
        """The checksum of the index and of the footer up to its own field for it."""
        self.file.seek(begins)
        left = self.size - begins - len(MAGIC) - 4
        crc = 0
        while left > 0:
            data = self.file.read(min(left, _PIECE_BYTES))
            if not data:
                break
            crc = zlib.crc32(data, crc)
            left -= len(data)
        return crc


def chain_of(path: Path) -> HashChain:
    """The chain of one file. Raises Fault BAD_LOG if the file cannot be read."""
    try:
        with path.open("rb") as file:
            walk = _Walk(file, path.name, path.stat().st_size)
            walk.run()
    except OSError as error:
        raise Fault("BAD_LOG", f"{path}: cannot be read: {error.strerror}; give the path of a .mcap file") from None
    if by := walk.rewritten_by():
        return HashChain(walk.links, walk.first, walk.last, [], 0, walk.ended, 0, walk.closed, by)
    return HashChain(walk.links, walk.first, walk.last, walk.changed, walk.changes, walk.ended, walk.since, walk.closed)


def chain_findings(chain: HashChain, name: str) -> list[Finding]:
    """A finding for each stretch of bytes that was changed after it was written."""
    findings = [
        Finding("changed", stretch.file, _in_words(stretch), stretch.until_bytes - stretch.from_bytes)
        for stretch in chain.changed
    ]
    if chain.changes > len(chain.changed):
        more = chain.changes - len(chain.changed)
        findings.append(Finding("changed", name, f"and {counted(more, 'more stretch', 'more stretches')}", more))
    if chain.links and chain.closed and not chain.ended and not chain.rewritten_by:
        text = "is closed without the end of its hash chain: its last bytes were not written, or were removed"
        findings.append(Finding("changed", name, text))
    return findings


def _in_words(stretch: Stretch) -> str:
    if not stretch.until_bytes:
        return "does not continue the file before it, which was changed or removed"
    where = f"bytes {stretch.from_bytes} to {stretch.until_bytes}"
    return f"{where} were changed after writing; do not trust them"


def chain_in_words(chain: HashChain) -> str:
    """One line for the operator."""
    if chain.rewritten_by:
        return (
            f"chain    does not fit: the log was rewritten by {chain.rewritten_by!r} after its recording; "
            "whether a byte was changed cannot be checked"
        )
    if not (chain.links or chain.changes):
        where = "this log was written without one" if chain.closed else "the rest of this log holds no link"
        return f"chain    none: {where}, so a changed byte outside of its chunks cannot be detected"
    if chain.changes:
        return f"chain    BROKEN at {counted(chain.changes, 'place')} of {counted(chain.links, 'link')}"
    until = "intact" if chain.ended and chain.closed else "intact up to the last whole chunk"
    return f"file     {until} ({counted(chain.links, 'checksum')}); SHA-256 {chain.last}"
