"""JSON Schemas of results, derived from the Python types of the results."""

import types
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NotRequired, Union, get_args, get_origin, get_type_hints, is_typeddict

from pydantic import ConfigDict, TypeAdapter
from typing_extensions import TypedDict  # pydantic refuses typing.TypedDict before Python 3.12


def schema_of(kind: Any) -> dict[str, Any]:
    """JSON Schema of the JSON that `tell` writes for a value of type `kind`."""
    return TypeAdapter[Any](_written(kind)).json_schema()


def table(kind: Any, more: Mapping[str, Any], left_out: tuple[str, ...] = ()) -> Any:
    """The type of an object with the fields of a named tuple, without those in `left_out` and with those in `more`.

    A field in `more` replaces the field of the same name; `NotRequired[...]` marks an optional field.
    """
    fields = {name: hint for name, hint in get_type_hints(kind).items() if name not in left_out}
    return objects(kind.__name__, fields | dict(more))


def objects(name: str, fields: Mapping[str, Any]) -> Any:
    """The type of an object with these fields and no others."""
    make: Any = TypedDict
    made = make(name, {field: _written(hint) for field, hint in fields.items()})
    made.__pydantic_config__ = ConfigDict(extra="forbid")
    return made


def _written(kind: Any) -> Any:
    """The type of the JSON for a type: an object for a named tuple, a list for a tuple, null for NaN and infinity."""
    if kind is float:
        return float | None
    if kind is Path:
        return str
    if isinstance(kind, type) and hasattr(kind, "_fields"):
        return table(kind, {})
    origin, inner = get_origin(kind), get_args(kind)
    if origin is None or origin is Literal or is_typeddict(kind):
        return kind
    if origin is tuple and inner[1:] == (Ellipsis,):
        return list[_written(inner[0])]
    plain = tuple(_written(part) for part in inner)
    if origin in (Union, types.UnionType):
        return Union[plain]  # noqa: UP007 (made of a list)
    generic: Any = origin
    return NotRequired[plain[0]] if origin is NotRequired else generic[plain]
