"""Measured data of other programs as columns, from CSV, Parquet, MATLAB v5 and TDMS. Every error names file, column and row."""

import codecs
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import scipy.io
from nptdms import TdmsFile

from bridge.faults import Fault
from bridge.files import check_file
from bridge.units import counted

# Arrow handles Ctrl-C and SIGTERM itself while it reads a CSV file, and loses a signal that comes near the end.
pa.enable_signal_handlers(False)

Floats = npt.NDArray[np.float64]
_HOW = "`stickslip log import` reads it with a map that has, under [source],"
_SHOWN = 60  # characters of a line in an error
_LONGEST_REASON = 200  # characters of what a library says
SUFFIXES = (".csv", ".parquet", ".mat", ".tdms")


class Dialect(NamedTuple):
    """How a CSV file is written."""

    delimiter: str = ","
    decimal: str = "."
    skip_rows: int = 0  # lines before the line with the names
    encoding: str = "utf-8"


class Table(NamedTuple):
    """The columns of one file, as they were stored."""

    path: Path
    columns: dict[str, Any]
    sample_rate_Hz: float | None = None  # where the file states it (TDMS)
    decimal: str = "."  # decimal sign of numbers that are stored as text

    def column(self, name: str) -> Floats:
        """One column, float64 [rows]. Raises Fault BAD_TABLE when it is missing or does not hold numbers."""
        if name not in self.columns:
            known = ", ".join(sorted(self.columns)) or "none"
            raise Fault("BAD_TABLE", f"{self.path.name}: column {name}: not in the file; known here: {known}")
        return _numbers(self.columns[name], f"{self.path.name}: column {name}", self.decimal)


def read_table(path: Path, dialect: Dialect | None = None) -> Table:
    """Read a table. Raises Fault BAD_TABLE when the file cannot be read as the format of its suffix."""
    check_file(path, "BAD_TABLE", "give the path of a file of measured data")
    if path.suffix not in SUFFIXES:
        remedy = "rename it" if path.suffix.lower() in SUFFIXES else "convert it"
        line = f"{path}: ends in {path.suffix or 'nothing'}: must be one of {', '.join(SUFFIXES)}; {remedy}"
        raise Fault("BAD_TABLE", line)
    try:
        if path.suffix == ".csv":
            dialect = _as_it_says(path, dialect or Dialect())
            _check_dialect(path, dialect)
            return Table(path, _csv(path, dialect), decimal=dialect.decimal)
        if path.suffix == ".parquet":
            table: Any = pq.read_table(path)
            return Table(path, {name: table.column(name) for name in table.column_names})
        if path.suffix == ".mat":
            return Table(path, _mat(path))
        return _tdms(path)
    except NotImplementedError:  # what scipy raises for the HDF5 of MATLAB v7.3
        line = f"{path.name}: a MATLAB v7.3 file: must be v5 to v7; save it in MATLAB with -v7"
        raise Fault("BAD_TABLE", line) from None
    except Fault:
        raise
    except Exception as error:
        reason = str(error).splitlines()[0][:_LONGEST_REASON] if str(error).strip() else type(error).__name__
        line = f"{path.name}: cannot be read as {path.suffix[1:]}: {reason}; take another copy, or export it again"
        raise Fault("BAD_TABLE", line) from None


def _as_it_says(path: Path, dialect: Dialect) -> Dialect:
    """The dialect, with UTF-16 where the first two bytes of the file mark it."""
    with path.open("rb") as file:
        mark = file.read(2)
    wide = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
    return dialect._replace(encoding=wide.get(mark, dialect.encoding))


def _check_dialect(path: Path, dialect: Dialect) -> None:
    """Raise Fault BAD_TABLE when the line of names does not fit the dialect: another encoding or delimiter."""
    lines: list[bytes] = []
    try:
        after = len("\n".encode(dialect.encoding).rpartition(b"\n")[2])  # bytes of a line's end: 1 in UTF-16
        with path.open("rb") as file:
            lines = [file.readline() + file.read(after) for _ in range(dialect.skip_rows + 1)]
        names = lines[-1].decode(dialect.encoding)
    except UnicodeDecodeError as error:
        line = (
            f"{path.name}: line {len(lines)}: is not {dialect.encoding}: {error.reason} at character {error.start + 1}"
        )
        raise Fault("BAD_TABLE", f'{line}; save it as UTF-8, or {_HOW} encoding = "latin-1"') from None
    except LookupError:
        raise Fault(
            "BAD_TABLE", f"source.encoding = {dialect.encoding!r}: is none that Python knows; try latin-1"
        ) from None
    if "\0" in names:
        line = f"{path.name}: line {len(lines)}: has zero bytes: is not {dialect.encoding}"
        raise Fault("BAD_TABLE", f'{line}; save it as UTF-8, or {_HOW} encoding = "utf-16-le"')
    other = next((mark for mark in (";", "\t", ",") if mark in names), None)
    if dialect.delimiter not in names and other is not None:
        line = f"{path.name}: line {len(lines)}: the names are separated by {other!r}, not by {dialect.delimiter!r}"
        raise Fault("BAD_TABLE", f"{line}; {_HOW} delimiter = {json.dumps(other)}, and decimal where it is no point")


def _csv(path: Path, dialect: Dialect) -> dict[str, Any]:
    def read(threads: bool) -> Any:
        return pa_csv.read_csv(
            path,
            read_options=pa_csv.ReadOptions(
                skip_rows=dialect.skip_rows, encoding=dialect.encoding, use_threads=threads
            ),
            parse_options=pa_csv.ParseOptions(delimiter=dialect.delimiter),
            convert_options=pa_csv.ConvertOptions(decimal_point=dialect.decimal),
        )

    try:
        table = read(threads=True)
    except pa.ArrowInvalid:
        try:
            table = read(threads=False)  # without threads the error names the line
        except pa.ArrowInvalid as error:
            raise _wrong_line(path, dialect, str(error)) or error from None
    return {name.strip(): table.column(name) for name in table.column_names}


def _wrong_line(path: Path, dialect: Dialect, error: str) -> Fault | None:
    """What Arrow says of a line with too few or too many cells, as a fault; None for what it says of anything else."""
    found = re.search(r"Row #(\d+): Expected (\d+) columns, got (\d+): (.*)", error)
    if found is None:
        return None
    number, names, cells = map(int, found.groups()[:3])
    under_the_names = number == dialect.skip_rows + 2  # then the line of names may be another one
    remedy = f"if the names come later, {_HOW} skip_rows" if under_the_names else "delete the line"
    line = f"line {number} = {found[4][:_SHOWN]!r}: has {counted(cells, 'cell')}: must have {names}, as many as there are names"
    return Fault("BAD_TABLE", f"{path.name}: {line}; {remedy}")


def _loaded(path: Path) -> dict[str, Any]:
    """The variables of a MATLAB file, read first in a process of its own: a damaged file may crash SciPy's compiled reader."""
    trial = "import sys, scipy.io; scipy.io.loadmat(sys.argv[1])"
    status = subprocess.run([sys.executable, "-P", "-c", trial, str(path)], capture_output=True, check=False).returncode
    if status < 0:
        raise ValueError(f"it is damaged: its reader died of signal {-status}")
    try:
        return scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    except (UnboundLocalError, ArithmeticError, MemoryError) as error:  # an unknown type, or an impossible size
        raise ValueError(f"it is damaged: {error}") from None


def _mat(path: Path) -> dict[str, Any]:
    """Columns of a MATLAB file: `NAME` for a vector, `NAME.FIELD` for a struct, `NAME[0]`, `NAME[1]`... for a matrix."""
    variables = _loaded(path)
    columns: dict[str, Any] = {}
    for name, value in variables.items():
        if name.startswith("__"):
            continue
        fields = getattr(value, "_fieldnames", None)
        found = {name: value} if fields is None else {f"{name}.{field}": getattr(value, field) for field in fields}
        for key, array in found.items():
            values = np.atleast_1d(np.asarray(array))
            if values.ndim == 2:
                columns |= {f"{key}[{i}]": values[:, i] for i in range(values.shape[1])}
            elif values.ndim == 1:
                columns[key] = values
    return columns


def _tdms(path: Path) -> Table:
    """Channels of a TDMS file as `GROUP/CHANNEL`, and as `CHANNEL` where only one group has a channel of that name."""
    file: Any = TdmsFile.read(path)
    columns: dict[str, Any] = {}
    names: list[str] = []
    rates_Hz: set[float] = set()
    for group in file.groups():
        for channel in group.channels():
            columns[f"{group.name}/{channel.name}"] = channel[:]
            names.append(channel.name)
            step_s = float(channel.properties.get("wf_increment", 0.0))
            if step_s > 0.0:
                rates_Hz.add(1.0 / step_s)
    short = {key.split("/", 1)[1]: values for key, values in columns.items() if names.count(key.split("/", 1)[1]) == 1}
    return Table(path, columns | short, rates_Hz.pop() if len(rates_Hz) == 1 else None)


def _numbers(values: Any, where: str, decimal: str) -> Floats:
    """A column as float64 [rows]; an empty cell is NaN. Raises Fault BAD_TABLE with the first row that is not a number."""
    if isinstance(values, pa.ChunkedArray):
        column: Any = values
        if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
            # rows as a person counts them: the first row under the names is 1
            for row, text in enumerate(column.to_pylist(), 1):
                if text is not None and not _is_number(text, decimal):
                    line = f"{where}: row {row} = {text!r}: must be a number; remove the row or name another column"
                    raise Fault("BAD_TABLE", line)
        if pa.types.is_binary(column.type) or pa.types.is_large_binary(column.type):
            for row, data in enumerate(column.to_pylist(), 1):
                if data is not None and data.decode(errors="replace") != data.decode(errors="ignore"):
                    line = f"{where}: row {row} = {data!r}: must be a number, and is no UTF-8"
                    raise Fault("BAD_TABLE", f"{line}; remove the row or name another column")
        try:
            return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), np.float64)
        except pa.ArrowException:
            raise Fault("BAD_TABLE", f"{where}: is {column.type}: must be numbers; name another column") from None
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise Fault("BAD_TABLE", f"{where}: is {array.dtype}: must be numbers; name another column")
    return array.astype(np.float64)


def _is_number(text: str, decimal: str) -> bool:
    try:
        float(text if decimal == "." else text.replace(decimal, "."))
    except ValueError:
        return False
    return True
