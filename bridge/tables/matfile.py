"""MATLAB v5 files written column by column, so that a log larger than the memory can be exported.

SciPy writes a variable from one array in memory. Here each column grows in a temporary file, and the files are joined at the end.
Layout: MathWorks, MAT-File Format, version 5 (uncompressed elements, little endian).
"""

import shutil
import struct
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault

_INT8, _UINT16, _INT32, _UINT32, _MATRIX = 1, 4, 5, 6, 14  # kinds of data elements
_STRUCT, _CHAR = 2, 4  # classes of matrices
_NUMBERS = {  # numpy type: kind of data element, class of matrix
    "<f8": (9, 6),
    "<f4": (7, 7),
    "<u4": (6, 13),
    "<i8": (12, 14),
    "<u8": (13, 15),
}
_NAME_BYTES = 64  # MATLAB names have at most 63 letters
# MATLAB reads no variable of 2 GiB or more from this format
LARGEST_VARIABLE_BYTES = (1 << 31) - 1


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 8)


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + _padded(data)


def _matrix_head(matrix_class: int, rows: int, columns: int, name: str) -> bytes:
    flags = _element(_UINT32, struct.pack("<II", matrix_class, 0))
    return flags + _element(_INT32, struct.pack("<ii", rows, columns)) + _element(_INT8, name.encode())


def _names(names: list[str]) -> bytes:
    packed = b"".join(name.encode().ljust(_NAME_BYTES, b"\0") for name in names)
    # the width is a small element: kind and length share one word
    return struct.pack("<HHI", _INT32, 4, _NAME_BYTES) + _element(_INT8, packed)


def _text(value: str) -> bytes:
    return _element(_MATRIX, _matrix_head(_CHAR, 1, len(value), "") + _element(_UINT16, value.encode("utf-16-le")))


def text_struct(name: str, fields: dict[str, dict[str, str]]) -> bytes:
    """Bytes of a variable that is a struct of structs of texts."""

    def struct_of(name: str, names: list[str], values: list[bytes]) -> bytes:
        return _element(_MATRIX, _matrix_head(_STRUCT, 1, 1, name) + _names(names) + b"".join(values))

    inner = [struct_of("", list(texts), [_text(text) for text in texts.values()]) for texts in fields.values()]
    return struct_of(name, list(fields), inner)


def file_head() -> bytes:
    """The 128 bytes at the start of every file."""
    return b"MATLAB 5.0 MAT-file, stickslip".ljust(124) + struct.pack("<H2s", 0x0100, b"IM")


class ColumnStruct:
    """A variable `name`, a struct of column vectors; it grows on disk, in `folder`, with a file for each column."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name = name
        self.rows = 0
        self._folder = folder
        self._files: dict[str, IO[bytes]] = {}
        self._dtypes: dict[str, np.dtype[Any]] = {}

    def append(self, columns: dict[str, npt.NDArray[Any]]) -> None:
        """Add rows. Every call has the same columns with the same types."""
        for name, values in columns.items():
            if name not in self._files:
                self._files[name] = (self._folder / f"{self.name}.{name}").open("w+b")
                self._dtypes[name] = values.dtype
            self._files[name].write(np.ascontiguousarray(values).data)
        self.rows += len(next(iter(columns.values())))

    def write_to(self, out: IO[bytes]) -> None:
        """Write the variable and remove the columns. Raises Fault BAD_TABLE if the variable is too large for the format."""
        heads: list[bytes] = []
        for name in self._files:
            kind, matrix_class = _NUMBERS[self._dtypes[name].str]
            data_bytes = self.rows * self._dtypes[name].itemsize
            body = _matrix_head(matrix_class, self.rows, 1, "") + struct.pack("<II", kind, data_bytes)
            heads.append(struct.pack("<II", _MATRIX, len(body) + data_bytes + -data_bytes % 8) + body)
        head = _matrix_head(_STRUCT, 1, 1, self.name) + _names(list(self._files))
        total = len(head) + sum(
            len(column) + self.rows * dtype.itemsize + -self.rows * dtype.itemsize % 8
            for column, dtype in zip(heads, self._dtypes.values(), strict=True)
        )
        if total > LARGEST_VARIABLE_BYTES:
            line = (
                f"{self.name}: {total / 1e9:.1f} GB: a MATLAB v5 file holds at most 2.1 GB a variable; "
                "take less with --from and --until, or export .parquet, which MATLAB reads too"
            )
            raise Fault("BAD_TABLE", line)
        out.write(struct.pack("<II", _MATRIX, total) + head)
        for (name, file), column in zip(self._files.items(), heads, strict=True):
            out.write(column)
            file.seek(0)
            shutil.copyfileobj(file, out, 1 << 20)
            out.write(bytes(-self.rows * self._dtypes[name].itemsize % 8))
        self.close()

    def close(self) -> None:
        """Close and remove the files of the columns."""
        for name, file in self._files.items():
            file.close()
            (self._folder / f"{self.name}.{name}").unlink(missing_ok=True)
        self._files = {}
