"""Tables written a batch of rows at a time: Parquet, CSV and MATLAB v5. A file appears under its name when it is whole."""

import shutil
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from bridge.tables.matfile import ColumnStruct, file_head, text_struct
from bridge.units import unit_of

Columns = dict[str, npt.NDArray[Any]]  # by name, all of one length
# 10 MB a batch of sensors: large enough to compress and encode well, small against any memory
BATCH_ROWS = 1 << 18


class TableWriter(Protocol):
    """One table being written."""

    def append(self, columns: Columns) -> None:
        """Add rows. Every call has the same columns with the same types."""
        ...

    def finish(self) -> list[Path]:
        """Make the file whole; its path, none where another table's writer makes it."""
        ...

    def discard(self) -> None:
        """Leave nothing behind."""
        ...


def _part(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def _schema(columns: Columns) -> Any:
    fields = [
        pa.field(name, pa.from_numpy_dtype(values.dtype), nullable=False, metadata={"unit": unit_of(name)})
        for name, values in columns.items()
    ]
    return pa.schema(fields)


class ArrowTable:
    """A Parquet or CSV file; Parquet columns carry their unit as metadata, CSV columns in their name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._writer: Any = None
        self._schema: Any = None
        self._waiting: list[Columns] = []
        self._waiting_rows = 0

    def append(self, columns: Columns) -> None:
        """Add rows; they go to disk a batch at a time."""
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
            if self.path.suffix == ".csv":
                options = pa_csv.WriteOptions(quoting_style="none")
                self._writer = pa_csv.CSVWriter(str(_part(self.path)), self._schema, write_options=options)
            else:
                # samples hardly ever repeat: dictionaries would be built in vain
                self._writer = pq.ParquetWriter(
                    str(_part(self.path)), self._schema, compression="zstd", compression_level=1, use_dictionary=False
                )
        batch = pa.record_batch([pa.array(values) for values in columns.values()], schema=self._schema)
        self._writer.write_batch(batch)

    def finish(self) -> list[Path]:
        """Write what waits and close; the path of the file."""
        self._flush()
        if self._writer is None:
            return []
        self._writer.close()
        _part(self.path).replace(self.path)
        return [self.path]

    def discard(self) -> None:
        """Remove the unfinished file."""
        _part(self.path).unlink(missing_ok=True)


class MatFile:
    """One MATLAB file with a struct of columns for every table, and their units in the struct `units`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._folder = path.with_name(path.name + ".columns")
        self._folder.mkdir(exist_ok=True)
        self._structs: dict[str, ColumnStruct] = {}
        self._units: dict[str, dict[str, str]] = {}

    def append(self, table: str, columns: Columns) -> None:
        """Add rows to one of the tables."""
        if table not in self._structs:
            self._structs[table] = ColumnStruct(table, self._folder)
            self._units[table] = {name: unit_of(name) for name in columns}
        self._structs[table].append(columns)

    def finish(self) -> list[Path]:
        """Put the columns together; the path of the file. Raises Fault BAD_TABLE when a table is too large."""
        if not self._structs:
            self.discard()
            return []
        part = _part(self.path)
        with part.open("wb") as out:
            self._write(out)
        part.replace(self.path)
        self._folder.rmdir()
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
        shutil.rmtree(self._folder, ignore_errors=True)
        _part(self.path).unlink(missing_ok=True)


class MatTable:
    """One table of a MATLAB file that is shared with other tables; the file itself is finished by its owner."""

    def __init__(self, file: MatFile, table: str) -> None:
        self.file = file
        self._table = table

    def append(self, columns: Columns) -> None:
        """Add rows."""
        self.file.append(self._table, columns)

    def finish(self) -> list[Path]:
        """Nothing: the file holds other tables too."""
        return []

    def discard(self) -> None:
        """Remove the whole file."""
        self.file.discard()
