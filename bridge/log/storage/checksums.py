"""Checksums over a whole log: they show a changed byte, and a verdict file that belongs to other bytes.

Each file ends with a CRC of its data and a CRC of its index, as MCAP defines them. They show damage and no manipulation: whoever
changes a file can compute them again, and a new verdict file too. Only a SHA-256 that was noted elsewhere proves the bytes.
A file that was cut has no CRC at its end; the CRC of each chunk shows damage up to its last whole chunk.
"""

import hashlib
import struct
import zlib
from collections.abc import Container
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple

from mcap.opcode import Opcode

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.log.library import HEAD, MAGIC
from bridge.log.storage.parts import parts_of
from bridge.log.storage.verdict_file import VERDICT, judged_sha256, verdict_path

_PIECE_BYTES = 1 << 20
_DATA_END = struct.Struct("<BQI")  # opcode, length, CRC of all bytes before it
_ENDING = struct.Struct("<BQQQI8s")  # end of a file: footer with begins of index and offsets, and a CRC; magic
_STORED = {
    "fits": "the verdict file names this SHA-256",
    "differs": "the verdict file belongs to other bytes",
    "unreadable": "the verdict file cannot be read",
    "inside": "the verdict is inside the log, without a digest",
    "none": "no verdict is stored",
}


class Checksums(NamedTuple):
    """The digest of a log, and its comparison with the checksums in its files and in its verdict file."""

    sha256: str  # digest of all files, one after the other, hexadecimal
    damaged: list[str]  # files with a byte that does not fit a checksum at their end
    complete: bool  # every file has a checksum of all its data
    verdict: Literal["fits", "differs", "unreadable", "inside", "none"]  # the stored verdict, see `_STORED`

    @property
    def changed(self) -> bool:
        """Whether a byte was changed after it was written or judged."""
        return bool(self.damaged) or self.verdict == "differs"

    def with_tables(self, metadata: Container[str]) -> "Checksums":
        """These checksums, with `inside` for a log of version 0.2 whose metadata records hold the verdict."""
        return self._replace(verdict="inside") if self.verdict == "none" and VERDICT in metadata else self


def checksums_of(path: Path, alone: bool = False) -> Checksums:
    """The checksums of a log, all of its files; of one file with `alone`. Raises Fault BAD_LOG if a file cannot be read."""
    digest = hashlib.sha256()
    damaged: list[str] = []
    complete = True
    try:
        for part in [path] if alone else parts_of(path):
            with part.open("rb") as file:
                fits, has_checksum = _read_through(file, digest)
            damaged += [] if fits else [part.name]
            complete &= has_checksum
    except OSError as error:
        raise Fault("BAD_LOG", f"{path}: cannot be read: {error.strerror}; give the path of a .mcap file") from None
    sha256 = digest.hexdigest()
    try:
        judged = judged_sha256(path)
    except (OSError, ValueError):
        return Checksums(sha256, damaged, complete, "unreadable")
    return Checksums(sha256, damaged, complete, "none" if judged is None else "fits" if judged == sha256 else "differs")


def _read_through(file: IO[bytes], digest: Any) -> tuple[bool, bool]:
    """Add a file to the digest. Returns whether it fits the checksums at its end, and whether they cover all of its data."""
    size = file.seek(0, 2)
    opcode, length, summary_start, offset_start, index_crc, magic = _ENDING.unpack(
        _read_at(file, -_ENDING.size, _ENDING.size)
    )
    footer_ends = (opcode, length) == (Opcode.FOOTER, _ENDING.size - HEAD.size - len(MAGIC))
    is_cut = not footer_ends and magic != MAGIC  # the reader reports it
    index_start = min(summary_start or size - _ENDING.size, size)
    opcode, length, data_crc = _DATA_END.unpack(_read_at(file, index_start - size - _DATA_END.size, _DATA_END.size))
    data_ends = (opcode, length) == (Opcode.DATA_END, _DATA_END.size - HEAD.size)
    # the bytes of the two CRCs: all data; the index, and the footer up to its CRC
    places = (0, index_start - _DATA_END.size), (index_start, size - len(MAGIC) - 4)
    sums = [0, 0]
    at = 0
    file.seek(0)
    for piece in iter(lambda: file.read(_PIECE_BYTES), b""):
        digest.update(piece)
        view = memoryview(piece)
        for number, (start, end) in enumerate(places):
            sums[number] = zlib.crc32(view[max(start - at, 0) : max(end - at, 0)], sums[number])
        at += len(piece)
    if is_cut:
        return True, False
    whole = footer_ends and magic == MAGIC and data_ends and bool(summary_start or not (offset_start or index_crc))
    return whole and data_crc in {0, sums[0]} and index_crc in {0, sums[1]}, bool(data_crc)


def _read_at(file: IO[bytes], from_end: int, size: int) -> bytes:
    """`size` bytes at a place counted from the end of the file, zeros before its beginning."""
    file.seek(max(file.seek(0, 2) + from_end, 0))
    return file.read(size).rjust(size, b"\0")


def checksum_findings(checksums: Checksums, path: Path) -> list[Finding]:
    """A finding for each file that was changed, and for a verdict on other bytes or without a digest."""
    text = "does not fit the checksums at its end: it was damaged or changed after writing; do not trust it"
    findings = [Finding("changed", name, text) for name in checksums.damaged]
    name = verdict_path(path).name
    if checksums.verdict == "differs":
        text = f"{name} belongs to other bytes: the log was changed or replaced after it was judged"
        findings.append(Finding("changed", path.name, f"{text}; if that was intended, remove {name}"))
    elif checksums.verdict == "unreadable":
        findings.append(Finding("verdict", name, "holds no verdict of a run, or was damaged; remove it"))
    return findings


def checksums_in_words(checksums: Checksums) -> str:
    """One line for the operator."""
    parts = [f"SHA-256 {checksums.sha256}", _STORED[checksums.verdict]]
    if not (checksums.complete or checksums.verdict == "fits"):
        parts.append("a changed byte outside of its chunks cannot be detected")
    return f"file     {'; '.join(parts)}"
