"""The files of one log: `run.mcap`, `run-0001.mcap`, `run-0002.mcap`, ... Each later file names the log it belongs to."""

import glob
import json
import re
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Metadata

from bridge.log.library import HEAD, MAGIC

PART = "part"  # the metadata record of each file: of the first file after its first chunk, of others before it
RECOVERED = "recovered"  # the metadata record of a file that `stickslip log recover` wrote; before the record above
LOST = "lost"  # the metadata record at the end of such a file, if the original log was damaged
_CHAIN = "chain"  # the metadata record after each chunk in logs of version 0.2; its first hash identifies the log
OF_FILES = frozenset({_CHAIN, PART, RECOVERED, LOST})  # records about the file, not about its run
_BEGINNING_BYTES = 1 << 21  # bytes that hold the record PART: it follows definitions, configurations and one chunk


class LogPart(NamedTuple):
    """The place of a file in a log of several files."""

    number: int  # number of the file, from 0
    begins: str  # identifies the log: the checksum of the first bytes of its first file

    def as_texts(self) -> dict[str, str]:
        """The fields of the metadata record."""
        return {"number": json.dumps(self.number), "begins": json.dumps(self.begins)}


def part_path(first: Path, number: int) -> Path:
    """The name of the file with this number in a log that begins with `first`."""
    return first.with_name(f"{first.stem}-{number:04d}{first.suffix}") if number else first


def part_of(path: Path) -> LogPart | None:
    """The place of a file; number 0 for a first file. None if it cannot be read, or is alone."""
    try:
        with path.open("rb") as file:
            data = file.read(_BEGINNING_BYTES)
        at = len(MAGIC) if data.startswith(MAGIC) else len(data)
        recovered = ""
        while at + HEAD.size <= len(data):
            opcode, length = HEAD.unpack_from(data, at)
            at += HEAD.size
            if opcode == Opcode.METADATA:
                record = Metadata.read(ReadDataStream(BytesIO(data[at : at + length])))
                if record.name == PART:
                    return LogPart(
                        int(json.loads(record.metadata["number"])), str(json.loads(record.metadata["begins"]))
                    )
                if record.name == RECOVERED:
                    recovered = record.metadata.get("begins", "")
                if record.name == _CHAIN:
                    return LogPart(0, recovered or record.metadata["sha256"])
            at += length
    except Exception:
        return None
    return None


def parts_of(path: Path) -> list[Path]:
    """The files of a log from `path` on, in order; `path` alone if no other file continues it."""
    likely = _numbered(path.stem, path) or re.search(r"-\d{4,}$", path.stem)
    place = part_of(path) if likely else None
    if place is None:
        return [path]
    stem = path.stem.removesuffix(f"-{place.number:04d}") if place.number else path.stem
    later = [(number, file) for number, file in _numbered(stem, path) if number > place.number]
    return [path, *(file for number, file in later if part_of(file) == LogPart(number, place.begins))]


def later_names(path: Path) -> list[Path]:
    """Files named like further files of the log `path`, in order."""
    return [file for _, file in _numbered(path.stem, path)]


def _numbered(stem: str, first: Path) -> list[tuple[int, Path]]:
    """Files in the folder of `first` named like further files of the log `stem`, in order of their numbers."""
    named = re.compile(rf"{re.escape(stem)}-(\d{{4,}}){re.escape(first.suffix)}")
    likely = first.parent.glob(f"{glob.escape(stem)}-[0-9][0-9][0-9][0-9]*")
    return sorted((int(match[1]), file) for file in likely if (match := named.fullmatch(file.name)))
