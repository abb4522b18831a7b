"""Tables written in batches of rows: Parquet, CSV and MATLAB v5. A file appears under its name only when complete."""

import contextlib
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from bridge.files import Replacement, folder_beside, replacing
from bridge.tables.matfile import ColumnStruct, file_head, text_struct
from bridge.units import unit_of

Columns = dict[str, npt.NDArray[Any]]  # by name, all of one length
# Rows of a batch, 10 MB of sensors. Too small: compression and encoding are poor; too large: memory.
BATCH_ROWS = 1 << 18


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


class ArrowTable:
    """A Parquet or CSV file. Parquet columns have their unit as metadata, CSV columns in their name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._new: Replacement | None = None
        self._writer: Any = None
        self._schema: Any = None
        self._waiting: list[Columns] = []
        self._waiting_rows = 0

    def append(self, columns: Columns) -> None:
        """Add rows; they are written to disk in batches."""
        self._waiting.append(columns)
        self._waiting_rows += len(next(iter(columns.values())))
        if self._waiting_rows >= BATCH_ROWS:
            self._flush()

    def _flush(self) -> None:
        if not self._waiting:
            return
        names = self._waiting[0]
        columns: Columns = {name: np.concatenate([piece[name] for piece in self._waiting]) for name in names}
        self._waiting, self._waiting_rows = [], 0
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
    """One MATLAB file with a struct of columns for each table, and the units of the columns in the struct `units`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ending = contextlib.ExitStack()
        self._folder = self._ending.enter_context(folder_beside(path))
        self._structs: dict[str, ColumnStruct] = {}
        self._units: dict[str, dict[str, str]] = {}

    def append(self, table: str, columns: Columns) -> None:
        """Add rows to the table `table`."""
        if table not in self._structs:
            self._structs[table] = ColumnStruct(table, self._folder)
            self._units[table] = {name: unit_of(name) for name in columns}
        self._structs[table].append(columns)

    def finish(self) -> list[Path]:
        """Join the columns, and return the path of the file. Raises Fault BAD_TABLE when a table is too large."""
        if not self._structs:
            self.discard()
            return []
        with replacing(self.path) as out:
            self._write(out)
        self._ending.close()
        return [self.path]

    def _write(self, out: IO[bytes]) -> None:
        out.write(file_head())
        for struct in self._structs.values():
            struct.write_to(out)
        out.write(text_struct("units", self._units))

    def discard(self) -> None:
        """Remove the unfinished file and its columns."""
        for struct in self._structs.values():
            struct.close()
        self._ending.close()


class MatTable:
    """One of several tables of a MATLAB file; the owner of the file completes it."""

    def __init__(self, file: MatFile, table: str) -> None:
        self.file = file
        self._table = table

    def append(self, columns: Columns) -> None:
        """Add rows."""
        self.file.append(self._table, columns)

    def finish(self) -> list[Path]:
        """Return an empty list: the owner of the file completes it."""
        return []

    def discard(self) -> None:
        """Remove the whole file."""
        self.file.discard()
