"""JSON Schemas of results, derived from the Python types of the results."""

import types
from functools import cache
from pathlib import Path
from typing import Any, Literal, NotRequired, Union, get_args, get_origin, get_type_hints

from pydantic import ConfigDict, TypeAdapter
from typing_extensions import TypedDict  # pydantic refuses typing.TypedDict before Python 3.12

from bridge.results import json_names


def schema_of(kind: Any) -> dict[str, Any]:
    """JSON Schema of the JSON that `bridge.results.strict_json` makes of a value of type `kind`."""
    return TypeAdapter[Any](_written(kind)).json_schema()


def _written(kind: Any) -> Any:
    """The type of the JSON for a type: an object for a named tuple, a list for a tuple, null for NaN and infinity."""
    if kind is float:
        return float | None
    if kind is Path:
        return str
    if hasattr(kind, "_fields"):
        return _object(kind)
    origin, inner = get_origin(kind), get_args(kind)
    if origin is None or origin is Literal:
        return kind
    if origin is tuple and inner[1:] == (Ellipsis,):
        return list[_written(inner[0])]
    plain = tuple(_written(part) for part in inner)
    if origin in (Union, types.UnionType):
        return Union[plain]  # noqa: UP007 (made of a list)
    generic: Any = origin
    return generic[plain]


@cache
def _object(kind: Any) -> Any:
    make: Any = TypedDict
    made = make(kind.__name__, _entries(kind))
    made.__pydantic_config__ = ConfigDict(extra="forbid")
    return made


def _entries(kind: Any) -> dict[str, Any]:
    """Types of the entries of a named tuple's JSON, by name."""
    hints = get_type_hints(kind)
    optional, merged = getattr(kind, "JSON_OPTIONAL", ()), getattr(kind, "JSON_MERGED", "")
    entries = _entries(hints[merged]) if merged else {}
    for name in json_names(kind):
        hint = hints[name] if name in hints else get_type_hints(getattr(kind, name).fget)["return"]
        if name in optional:
            present = [part for part in get_args(hint) if part is not types.NoneType]
            entries[name] = NotRequired[_written(present[0] if types.NoneType in get_args(hint) else hint)]
        else:
            entries[name] = _written(hint)
    return entries
