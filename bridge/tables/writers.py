"""Tables written in batches of rows: Parquet, CSV and MATLAB v7.3. A file appears under its name only when complete."""

import contextlib
import shutil
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from bridge.files import Replacement, folder_beside, replacing
from bridge.units import unit_of

Columns = dict[str, npt.NDArray[Any]]  # columns by name, all of one length
# Rows of a batch; 10 MB of sensor data. Smaller: poor compression and encoding. Larger: more memory.
BATCH_ROWS = 1 << 18
# The 512 bytes with which MATLAB recognises its HDF5 files: text, place of subsystem data (none), version 2.0, byte order.
_MATLAB_HEAD = b"MATLAB 7.3 MAT-file, stickslip, HDF5 schema 1.00 .".ljust(116) + bytes(8) + b"\x00\x02IM" + bytes(384)
_MATLAB_CLASSES = {"f8": "double", "f4": "single", "u4": "uint32", "i8": "int64", "u8": "uint64"}


class TableWriter(Protocol):
    """One table that is being written."""

    def append(self, columns: Columns) -> None:
        """Add rows. Every call has the same columns with the same types."""
        ...

    def finish(self) -> list[Path]:
        """Complete the file, and return its path; an empty list where another writer completes the file."""
        ...

    def discard(self) -> None:
        """Remove the unfinished file."""
        ...


def _schema(columns: Columns) -> Any:
    fields = [
        pa.field(name, pa.from_numpy_dtype(values.dtype), nullable=False, metadata={"unit": unit_of(name)})
        for name, values in columns.items()
    ]
    return pa.schema(fields)


class _Batches:
    """Rows that are collected until they fill a batch."""

    def __init__(self) -> None:
        self._waiting: list[Columns] = []
        self._waiting_rows = 0

    def append(self, columns: Columns) -> None:
        """Add rows; they are written to disk in batches."""
        self._waiting.append(columns)
        self._waiting_rows += len(next(iter(columns.values())))
        if self._waiting_rows >= BATCH_ROWS:
            self._flush()

    def _flush(self) -> None:
        if self._waiting:
            names = self._waiting[0]
            columns: Columns = {name: np.concatenate([piece[name] for piece in self._waiting]) for name in names}
            self._waiting, self._waiting_rows = [], 0
            self._write(columns)

    def _write(self, columns: Columns) -> None:
        raise NotImplementedError


class ArrowTable(_Batches):
    """A Parquet or CSV file. Parquet columns have their unit as metadata, CSV columns in their name."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self._new: Replacement | None = None
        self._writer: Any = None
        self._schema: Any = None

    def _write(self, columns: Columns) -> None:
        if self._writer is None:
            self._schema = _schema(columns)
            self._new = Replacement(self.path)
            if self.path.suffix == ".csv":
                options = pa_csv.WriteOptions(quoting_style="none")
                self._writer = pa_csv.CSVWriter(self._new.file, self._schema, write_options=options)
            else:
                # without dictionaries, as samples rarely repeat
                self._writer = pq.ParquetWriter(
                    self._new.file, self._schema, compression="zstd", compression_level=1, use_dictionary=False
                )
        batch = pa.record_batch([pa.array(values) for values in columns.values()], schema=self._schema)
        self._writer.write_batch(batch)

    def finish(self) -> list[Path]:
        """Write the waiting rows, close the file, and return its path; an empty list without rows."""
        self._flush()
        if self._writer is None or self._new is None:
            return []
        self._writer.close()
        self._new.finish()
        return [self.path]

    def discard(self) -> None:
        """Remove the unfinished file."""
        if self._new is not None:
            self._new.discard()


class MatFile:
    """One MATLAB file with a struct of columns for each table, and the units of the columns in the struct `units`.

    It is made in a temporary folder, because HDF5 also reads while it writes, which a pipe as the target does not allow.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ending = contextlib.ExitStack()
        self._part = self._ending.enter_context(folder_beside(path)) / "table.mat"
        self._file: Any = None

    def add(self, table: str, columns: Columns) -> None:
        """Add rows to the table `table`."""
        import h5py

        if self._file is None:
            self._file = self._ending.enter_context(h5py.File(self._part, "w", userblock_size=len(_MATLAB_HEAD)))
        for name, values in columns.items():
            if f"{table}/{name}" not in self._file:
                # HDF5 lists the dimensions of a MATLAB array in reverse: a column of n rows is [1, n]
                column = self._dataset(table, name, values[None, :], (1, None))
                column.attrs["MATLAB_class"] = np.bytes_(_MATLAB_CLASSES[values.dtype.str[1:]])
                unit = np.frombuffer(unit_of(name).encode("utf-16-le"), np.uint16)
                text = self._dataset(f"units/{table}", name, unit[:, None], None)
                text.attrs["MATLAB_class"], text.attrs["MATLAB_int_decode"] = np.bytes_("char"), np.int32(2)
            else:
                column = self._file[table][name]
                rows = column.shape[1]
                column.resize(rows + len(values), axis=1)
                column[0, rows:] = values

    def _dataset(self, table: str, name: str, values: npt.NDArray[Any], most: tuple[int | None, ...] | None) -> Any:
        for group in (table.partition("/")[0], table):
            self._file.require_group(group).attrs["MATLAB_class"] = np.bytes_("struct")
        return self._file[table].create_dataset(name, data=values, maxshape=most, chunks=values.shape if most else None)

    def finish(self) -> list[Path]:
        """Close the file, move it to its place and return its path; an empty list without rows. Raises OSError."""
        if self._file is None:
            self.discard()
            return []
        self._file.close()
        with replacing(self.path) as out, self._part.open("rb") as made:
            out.write(_MATLAB_HEAD)
            made.seek(len(_MATLAB_HEAD))
            shutil.copyfileobj(made, out, 1 << 20)
        self._ending.close()
        return [self.path]

    def discard(self) -> None:
        """Remove the unfinished file."""
        self._ending.close()


class MatTable(_Batches):
    """One of several tables of a MATLAB file; the owner of the file completes it."""

    def __init__(self, file: MatFile, table: str) -> None:
        super().__init__()
        self.file = file
        self._table = table

    def _write(self, columns: Columns) -> None:
        self.file.add(self._table, columns)

    def finish(self) -> list[Path]:
        """Write the waiting rows; return an empty list, as the owner completes the file."""
        self._flush()
        return []

    def discard(self) -> None:
        """Remove the whole file."""
        self.file.discard()
