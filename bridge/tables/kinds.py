"""The format of a table file, from its first bytes; its suffix may be wrong."""

import re
import shlex
import tomllib
from pathlib import Path
from typing import Any, Literal

from bridge.faults import Fault
from bridge.tables.text.encoding import wide_encoding

Kind = Literal["text", "parquet", "mat", "hdf5", "tdms", "sheet", "mcap", "json"]
_NUMPY = b"\x93NUMPY"
_ZIP, _ZIP_NAME_LENGTH, _ZIP_NAME = b"PK\x03\x04", slice(26, 28), 30  # mark, and places of the first file's name
_BOOKS = ("[Content_Types].xml", "_rels/", "mimetype", "docProps/", "xl/", "META-INF/")  # first files of a workbook
_MARKS: tuple[tuple[bytes, Kind], ...] = (
    (b"PAR1", "parquet"),
    (b"MATLAB 5.0", "mat"),
    (b"TDSm", "tdms"),
    (b"\x89HDF\r\n\x1a\n", "hdf5"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "sheet"),
    (b"\x89MCAP0\r\n", "mcap"),
)
FOREIGN = Path(__file__).with_name("foreign.toml")
_FOREIGN: list[dict[str, Any]] = tomllib.loads(FOREIGN.read_text(encoding="utf-8"))["kind"]
_HDF5_AT = 512  # MATLAB v7.3 writes a head of 512 bytes before the HDF5 data
_BY_SUFFIX: dict[str, Kind] = {".parquet": "parquet", ".mat": "mat", ".tdms": "tdms"}
_BY_SUFFIX.update(dict.fromkeys((".xlsx", ".xls", ".ods"), "sheet"))
_LOOKED_AT = 4096  # first bytes that decide whether a file is a text
_CONTROLS = bytes({*range(32)} - {*b"\t\n\v\f\r\x1a\x1b"})
_MOST_CONTROLS = 0.02  # share of control characters in a text; a serial port gives a few at its start
_PROSE = 1 << 16  # first and last bytes in which lines are searched for numbers
# Share of words in a line that begin with a digit, and of such lines: 0.02 to 0.31 in texts of this project, 0.5 to 1 in tables.
_OF_WORDS, _LEAST_ROWS = 0.25, 0.3
_BETWEEN_WORDS = re.compile(rb"""[\s,;|=:"'{}\[\]()]+""")
_SHOWN = 8  # first bytes of an unknown file that the message shows


def kind_of(path: Path) -> Kind:
    """The format of a table: by its magic bytes; for a damaged file without them by its suffix; else text.

    Raises Fault BAD_TABLE for a file of a kind that is not read, with the way to convert it.
    """
    with path.open("rb") as file:
        start = file.read(_LOOKED_AT)
    if start[_HDF5_AT:].startswith(b"\x89HDF"):
        return "hdf5"
    if start.startswith((_NUMPY, _ZIP)):
        return _of_zip(path, start)
    for mark, kind in _MARKS:
        if start.startswith(mark):
            return kind
    binary = _is_binary(start)
    for row in _FOREIGN:
        if _is(row, start, binary, path):
            line = f"{path.name}: is {row['name']}, which is not read; convert it: "
            raise Fault("BAD_TABLE", line + row["convert"].replace("FILE", shlex.quote(str(path))))
    if kind := _BY_SUFFIX.get(path.suffix.lower()):
        return kind
    if binary:
        line = f"{path.name}: is binary, of an unknown kind (it begins with {start[:_SHOWN].hex(' ')})"
        raise Fault("BAD_TABLE", f"{line}; export it as CSV in the program that wrote it")
    kind = "json" if start.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"{", b"[") and b'"' in start else "text"
    if kind == "text":
        _refuse_prose(path)
    return kind


def _refuse_prose(path: Path) -> None:
    """Raise Fault BAD_TABLE for a text without rows of numbers, such as a README, before any library for tables is needed."""
    with path.open("rb") as file:
        begin = file.read(_PROSE)
        file.seek(max(path.stat().st_size - _PROSE, 0))
        end = file.read(_PROSE)
    if wide_encoding(begin):
        return
    shares: list[float] = []
    for part in (begin, end):  # a long head may fill the begin, notes the end
        lines = [line for line in part.splitlines()[:-1] or [part] if line.strip()]
        shares.append(sum(map(_may_be_row, lines)) / max(len(lines), 1))
    if begin.strip() and max(shares) < _LEAST_ROWS:
        line = f"{path.name}: is a text with numbers in {100.0 * max(shares):.0f} % of its lines: no row of numbers in most"
        raise Fault("BAD_TABLE", f"{line}; give a file of measured data")


def _may_be_row(line: bytes) -> bool:
    words = [word for word in _BETWEEN_WORDS.split(line) if word]
    return sum(word.lstrip(b"+-.")[:1].isdigit() for word in words) >= max(_OF_WORDS * len(words), 1)


def _of_zip(path: Path, start: bytes) -> Kind:
    """A workbook; raises Fault BAD_TABLE for arrays of NumPy and for an archive of other files."""
    first = start[_ZIP_NAME:][: int.from_bytes(start[_ZIP_NAME_LENGTH], "little")].decode(errors="replace")
    if start.startswith(_NUMPY) or first.endswith(".npy"):
        line = f"{path.name}: holds NumPy arrays, without names for time and force; write them as columns of a text"
        call = 'numpy.savetxt("NAME.csv", numpy.column_stack([t, F]), delimiter=",", header="t (s),F (N)", comments="")'
        raise Fault("BAD_TABLE", f"{line}: {call}")
    if not first.startswith(_BOOKS) and path.suffix.lower() not in _BY_SUFFIX:
        line = f"{path.name}: is an archive (zip) with {first!r}; unpack it and give a file of it"
        raise Fault("BAD_TABLE", f"{line}: unzip {shlex.quote(str(path))}")
    return "sheet"


def _is(row: dict[str, Any], start: bytes, binary: bool, path: Path) -> bool:
    """Whether a file is of the kind of a row of foreign.toml."""
    mark: str = row["mark"]
    at = int(row.get("at", 0))
    if (row.get("binary") and not binary) or path.suffix.lower() != row.get("suffix", path.suffix.lower()):
        return False
    if mark.startswith("0x"):
        return start[at:].startswith(bytes.fromhex(mark[2:]))
    begin = start[at:] if at or binary else start.lstrip(b"\xef\xbb\xbf")
    return begin[: len(mark)].lower() == mark.lower().encode()


def _is_binary(start: bytes) -> bool:
    """Whether the first bytes of a file belong to no text of any encoding."""
    if not start or wide_encoding(start):
        return False
    return len(start) - len(start.translate(None, _CONTROLS)) > _MOST_CONTROLS * len(start)
