"""JSON as a table: one object a line, a list of objects, or an object of columns."""

import json
from pathlib import Path
from typing import Any

from bridge.faults import Fault
from bridge.tables.mat import table_of
from bridge.tables.table import Table
from bridge.tables.text.dialect import Dialect
from bridge.tables.text.encoding import decoded

_FEWEST = 4  # fewest equally long objects that are rows


def read_json(path: Path, given: Dialect) -> Table:
    """Columns by the keys of the objects, nested ones as `KEY.KEY`. Raises Fault BAD_TABLE for no JSON or no columns."""
    text, _ = decoded(path.read_bytes(), given.encoding, path.name)
    try:
        value = json.loads(text)
    except json.JSONDecodeError:
        lines = [line for line in text.splitlines() if line.strip()]
        try:
            value = [json.loads(line) for line in lines[:-1]]
            value += [json.loads(lines[-1])] if lines[-1].rstrip().endswith("}") else []  # a cut last line
        except json.JSONDecodeError as error:
            raise Fault("BAD_TABLE", f"{path.name}: is not valid JSON: {error}; export it as CSV") from None
    if not isinstance(value, dict):
        return table_of(path, columns_of(value))
    rows = next(
        (part for part in value.values() if isinstance(part, list) and part and isinstance(part[0], dict)), None
    )
    return table_of(path, value if rows is None or len(rows) < _FEWEST else columns_of(rows))


def columns_of(rows: list[Any]) -> dict[str, Any]:
    """The columns of a list of objects or of lists, a row each; None for a missing value."""
    if rows and isinstance(rows[0], list):
        return {str(i + 1): [row[i] if i < len(row) else None for row in rows] for i in range(len(rows[0]))}
    flat = [_flat(row) for row in rows if isinstance(row, dict)]
    return {name: [row.get(name) for row in flat] for name in dict.fromkeys(name for row in flat for name in row)}


def _flat(row: dict[str, Any], before: str = "") -> dict[str, Any]:
    """A nested object as one level: `KEY.KEY`."""
    result: dict[str, Any] = {}
    for key, value in row.items():
        if isinstance(value, dict):
            result |= _flat(value, f"{before}{key}.")
        elif not isinstance(value, list):
            result[f"{before}{key}"] = value
    return result
