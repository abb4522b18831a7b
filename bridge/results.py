"""The JSON of results: a named tuple becomes an object of its fields.

Its class declares each difference from the fields: a property marked `in_json` is in the object too; `JSON_MERGED` names a
field whose own entries replace it, `JSON_OPTIONAL` the fields that are left out while they are empty, `JSON_HIDDEN` the fields
that are always left out. `cockpit.commands.as_json.schemas` derives the JSON Schema from the same declarations.
"""

import json
import math
from functools import cache
from pathlib import Path
from typing import Any

from bridge.files import shown, write_whole


class in_json(property):  # noqa: N801 (used as a decorator)
    """A property of a named tuple that belongs to its JSON."""


@cache
def json_names(kind: Any) -> list[str]:
    """Names of the entries of a named tuple's JSON, without those of a merged field."""
    left_out = {getattr(kind, "JSON_MERGED", ""), *getattr(kind, "JSON_HIDDEN", ())}
    marked = [name for name, member in vars(kind).items() if isinstance(member, in_json)]
    return [*marked, *(name for name in kind._fields if name not in left_out)]


def strict_json(value: Any) -> Any:
    """`value` in JSON types: a named tuple is an object, a path a text, NaN and infinity are null."""
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        kind = type(value)
        optional, merged = getattr(kind, "JSON_OPTIONAL", ()), getattr(kind, "JSON_MERGED", "")
        entries = {name: getattr(value, name) for name in json_names(kind)}
        direct = {name: strict_json(inner) for name, inner in entries.items() if inner or name not in optional}
        return strict_json(getattr(value, merged)) | direct if merged else direct
    if isinstance(value, dict):
        return {key: strict_json(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [strict_json(inner) for inner in value]
    if isinstance(value, Path):
        return shown(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_json(path: Path, value: Any) -> None:
    """Write `value` as strict JSON, completely or not at all, and create the folder. Raises OSError."""
    write_whole(path, json.dumps(strict_json(value), allow_nan=False, indent=1) + "\n")
