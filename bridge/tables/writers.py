"""Tables written in batches of rows: Parquet, CSV and MATLAB v7.3. A file appears under its name only when complete."""

import contextlib
import io
import shutil
from collections.abc import Callable
from functools import partial
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
    """Rows that are collected until they fill a batch, for which `write` is called."""

    def __init__(self, write: Callable[[Columns], None]) -> None:
        self._write = write
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


class ArrowTable(_Batches):
    """A Parquet or CSV file. Parquet columns have their unit as metadata, CSV columns in their name."""

    def __init__(self, path: Path) -> None:
        super().__init__(self._add)
        self.path = path
        self._new: Replacement | None = None
        self._writer: Any = None
        self._schema: Any = None

    def _add(self, columns: Columns) -> None:
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


class _HdfFile(io.FileIO):
    """A file for HDF5, which ends the process at a failed write: the failure is kept for the owner of the file."""

    failed: OSError | None = None

    def write(self, data: Any) -> int:
        left = memoryview(data).cast("B")
        try:
            while left:  # a full disk takes a part
                left = left[super().write(left) or 0 :]
        except OSError as error:
            self.failed = self.failed or error
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self.failed = self.failed or error
            return size or 0


class MatFile:
    """One MATLAB file with a struct of columns for each table, and the units of the columns in the struct `units`.

    It is made in a temporary folder, because HDF5 also reads while it writes, which a pipe as the target does not allow.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ending = contextlib.ExitStack()
        self._part = self._ending.enter_context(
            _HdfFile(self._ending.enter_context(folder_beside(path)) / "table.mat", "w+")
        )
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
        self._refuse_unwritten()

    def _refuse_unwritten(self) -> None:
        """Raise the OSError of a failed write."""
        if self._part.failed is not None:
            raise self._part.failed

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
        self._refuse_unwritten()
        with replacing(self.path) as out:
            out.write(_MATLAB_HEAD)
            self._part.seek(len(_MATLAB_HEAD))
            shutil.copyfileobj(self._part, out, 1 << 20)
        self._ending.close()
        return [self.path]

    def discard(self) -> None:
        """Remove the unfinished file."""
        self._ending.close()


class MatTable(_Batches):
    """One of several tables of a MATLAB file; the owner of the file completes it."""

    def __init__(self, file: MatFile, table: str) -> None:
        super().__init__(partial(file.add, table))
        self.file = file

    def finish(self) -> list[Path]:
        """Write the waiting rows; return an empty list, as the owner completes the file."""
        self._flush()
        return []

    def discard(self) -> None:
        """Remove the whole file."""
        self.file.discard()
