"""Measured data of other programs as columns. Every error names file, column and row; every assumption is a finding."""

from collections.abc import Callable
from pathlib import Path

from bridge.faults import Fault
from bridge.files import check_file
from bridge.tables.json_table import read_json
from bridge.tables.kinds import Kind, kind_of
from bridge.tables.long_form import pivoted
from bridge.tables.mat import read_hdf5, read_mat
from bridge.tables.message_log import read_message_log
from bridge.tables.own_times import with_own_times
from bridge.tables.sheet import read_sheet
from bridge.tables.table import Table
from bridge.tables.tdms import read_tdms
from bridge.tables.text.dialect import Dialect
from bridge.tables.text.text_table import read_text

__all__ = ["Dialect", "Table", "read_table"]
_LONGEST_REASON = 200  # longest quotation of a library's message [characters]


def read_table(path: Path, dialect: Dialect | None = None, kind: Kind | None = None) -> Table:
    """Read a table.

    Args:
        path: a file of any suffix: its first bytes decide on the format.
        dialect: known properties of a text or a sheet.
        kind: the format, instead of the first bytes.

    Raises Fault BAD_TABLE if the file cannot be read in its format.

    """
    check_file(path, "BAD_TABLE", "give the path of a file of measured data")
    given = dialect or Dialect()
    kind = kind or kind_of(path)
    readers: dict[Kind, Callable[[], Table]] = {
        "text": lambda: read_text(path, given),
        "parquet": lambda: _read_parquet(path),
        "mat": lambda: read_mat(path),
        "hdf5": lambda: read_hdf5(path),
        "tdms": lambda: read_tdms(path),
        "sheet": lambda: read_sheet(path, given),
        "mcap": lambda: read_message_log(path),
        "json": lambda: read_json(path, given),
    }
    try:
        table = readers[kind]()
        return with_own_times(pivoted(table)) if kind in ("text", "sheet") else table
    except (Fault, ModuleNotFoundError):
        raise
    except Exception as error:
        reason = str(error).splitlines()[0][:_LONGEST_REASON] if str(error).strip() else type(error).__name__
        line = f"{path.name}: cannot be read as {kind}: {reason}; take another copy, or export it again"
        raise Fault("BAD_TABLE", line) from None


def _read_parquet(path: Path) -> Table:
    """The columns of a Parquet file; fields of structs as `NAME.FIELD`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pq.read_table(path)
    while any(pa.types.is_struct(field.type) for field in table.schema):
        table = table.flatten()
    units = {
        field.name: field.metadata[b"unit"].decode()
        for field in table.schema
        if field.metadata and b"unit" in field.metadata
    }
    return pivoted(Table(path, {name: table.column(name) for name in table.column_names}, units=units))
