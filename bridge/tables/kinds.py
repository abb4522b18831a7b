"""The format of a table file, from its first bytes; its suffix may be wrong."""

from pathlib import Path
from typing import Literal

from bridge.faults import Fault

Kind = Literal["text", "parquet", "mat", "hdf5", "tdms", "sheet", "mcap"]
_NUMPY = b"\x93NUMPY"
_ZIP, _ZIP_NAME_LENGTH, _ZIP_NAME = b"PK\x03\x04", slice(26, 28), 30  # mark, and places of the first file's name
_MARKS: tuple[tuple[bytes, Kind], ...] = (
    (b"PAR1", "parquet"),
    (b"MATLAB 5.0", "mat"),
    (b"TDSm", "tdms"),
    (b"\x89HDF\r\n\x1a\n", "hdf5"),
    (_ZIP, "sheet"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "sheet"),
    (b"\x89MCAP0\r\n", "mcap"),
)
_PACKED = (
    (b"\x1f\x8b", "gzip"),
    (b"BZh", "bzip2"),
    (b"\xfd7zXZ\x00", "xz"),
    (b"\x28\xb5\x2f\xfd", "zstd"),
    (b"7z\xbc\xaf\x27\x1c", "7-Zip"),
    (b"Rar!", "RAR"),
)
_HDF5_AT = 512  # MATLAB v7.3 writes a head of 512 bytes before the HDF5 data
_BY_SUFFIX: dict[str, Kind] = {".parquet": "parquet", ".mat": "mat", ".tdms": "tdms"}
_BY_SUFFIX.update(dict.fromkeys((".xlsx", ".xls", ".ods"), "sheet"))


def kind_of(path: Path) -> Kind:
    """The format of a table: by its magic bytes; for a damaged file without them by its suffix; else text.

    Raises Fault BAD_TABLE for a compressed file and for a file of NumPy.
    """
    with path.open("rb") as file:
        start = file.read(_HDF5_AT + 8)
    if start[_HDF5_AT:].startswith(b"\x89HDF"):
        return "hdf5"
    first_in_zip = start[_ZIP_NAME:][: int.from_bytes(start[_ZIP_NAME_LENGTH], "little")]
    if start.startswith(_NUMPY) or (start.startswith(_ZIP) and first_in_zip.endswith(b".npy")):
        line = f"{path.name}: holds NumPy arrays, without names for time and force; write them as columns of a text"
        call = 'numpy.savetxt("NAME.csv", numpy.column_stack([t, F]), delimiter=",", header="t (s),F (N)", comments="")'
        raise Fault("BAD_TABLE", f"{line}: {call}")
    for mark, kind in _MARKS:
        if start.startswith(mark):
            return kind
    for mark, name in _PACKED:
        if start.startswith(mark):
            raise Fault("BAD_TABLE", f"{path.name}: is packed by {name}; unpack it, and give the unpacked file")
    return _BY_SUFFIX.get(path.suffix.lower(), "text")
