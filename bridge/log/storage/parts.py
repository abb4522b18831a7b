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
from bridge.log.storage.chain import CHAIN, HashChain, Stretch, chain_of

PART = "part"  # the metadata record of every file but the first
RECOVERED = "recovered"  # the metadata record of a file that `stickslip log recover` wrote; before the record above
LOST = "lost"  # the metadata record at the end of such a file, if the original log was not whole
OF_FILES = frozenset({CHAIN, PART, RECOVERED, LOST})  # records about the file, not about its run
_BEGINNING_BYTES = 1 << 21  # the first link is within: definitions, configurations and one chunk


class LogPart(NamedTuple):
    """The place of a file in a log of several files."""

    number: int  # of the file, from 0
    begins: str  # SHA-256 of the first link of the log's first file
    follows: str  # SHA-256 of the last link of the file before
    recovered: bool = False  # it was rewritten, and its links differ from those known to the next file


def part_path(first: Path, number: int) -> Path:
    """The name of the file with this number in a log that begins with `first`."""
    return first.with_name(f"{first.stem}-{number:04d}{first.suffix}") if number else first


def part_of(path: Path) -> LogPart | None:
    """The place of a file; number 0 for a first file. None if it cannot be read."""
    try:
        with path.open("rb") as file:
            data = file.read(_BEGINNING_BYTES)
        at = len(MAGIC) if data.startswith(MAGIC) else len(data)
        recovered: str | None = None
        while at + HEAD.size <= len(data):
            opcode, length = HEAD.unpack_from(data, at)
            at += HEAD.size
            if opcode == Opcode.METADATA:
                record = Metadata.read(ReadDataStream(BytesIO(data[at : at + length])))
                if record.name == PART:
                    value = {key: json.loads(text) for key, text in record.metadata.items()}
                    place = int(value["number"]), str(value["begins"]), str(value["follows"])
                    return LogPart(*place, recovered is not None)
                if record.name == RECOVERED:
                    recovered = record.metadata["begins"]
                if record.name == CHAIN:
                    return LogPart(0, recovered or record.metadata["sha256"], "", recovered is not None)
            at += length
    except Exception:
        return None
    return None


def parts_of(path: Path) -> list[Path]:
    """The files of a log from `path` on, in order; `path` alone if no other file continues it."""
    numbered = re.fullmatch(r"(.*)-(\d{4,})", path.stem)
    others = _numbered(path.stem, path)
    place = part_of(path) if others or numbered else None
    if place is None:
        return [path]
    if place.number:
        others = _numbered(numbered[1], path) if numbered else {}
    rest = {number: other for number, other in others.items() if number > place.number}
    mine = [rest[number] for number in sorted(rest) if _belongs(rest[number], number, place.begins)]
    return [path, *mine]


def later_names(path: Path) -> list[Path]:
    """Files named like further files of the log `path`, in order."""
    named = _numbered(path.stem, path)
    return [named[number] for number in sorted(named)]


def _numbered(stem: str, first: Path) -> dict[int, Path]:
    """Files in the folder of `first` named like further files of the log `stem`."""
    named = re.compile(rf"{re.escape(stem)}-(\d{{4,}}){re.escape(first.suffix)}")
    likely = first.parent.glob(f"{glob.escape(stem)}-[0-9][0-9][0-9][0-9]*")
    matches = ((named.fullmatch(other.name), other) for other in likely)
    return {int(match[1]): other for match, other in matches if match}


def _belongs(path: Path, number: int, begins: str) -> bool:
    part = part_of(path)
    return part is not None and part.number == number and part.begins == begins


def chain_of_log(path: Path) -> HashChain:
    """The chain of all files of a log, including whether each file continues the one before. Raises Fault BAD_LOG."""
    parts = parts_of(path)
    chains = [chain_of(part) for part in parts]
    whole = chains[0]
    before = part_of(path) if len(parts) > 1 else None
    for part, chain in zip(parts[1:], chains[1:], strict=True):
        place = part_of(part)
        changed = [*whole.changed, *chain.changed]
        changes = whole.changes + chain.changes
        anew = (before is not None and before.recovered) or whole.rewritten_by or chain.rewritten_by
        if place is not None and whole.last and place.follows != whole.last and not anew:
            changed.append(Stretch(part.name, 0, 0))
            changes += 1
        before = place
        whole = HashChain(
            whole.links + chain.links,
            whole.first,
            chain.last or whole.last,
            changed,
            changes,
            whole.ended and chain.ended,
            chain.covered_bytes,
            whole.closed and chain.closed,
            whole.rewritten_by or chain.rewritten_by,
        )
    return whole
