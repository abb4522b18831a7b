"""Strict configuration from TOML: a misspelt or out-of-range key is one clear line, never a default."""

import re
import reprlib
import tomllib
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from bridge.faults import Fault
from bridge.files import check_file
from bridge.plain import print_line

_LARGEST_BYTES = 2 << 20  # largest TOML file; hand-written files of hundreds of runs have about 100 kB
_DEEPEST = 32  # most parts of a dotted key; files of this project need 5
_MOST_PROBLEMS = 20  # most problems reported for one table
_QUOTED = re.compile(r'"[^"\\\n]*(?:\\.[^"\\\n]*)*"|\'[^\'\n]*\'')
_DOTS = re.compile(r"[ \t]*\.[ \t]*")
_CHAIN = re.compile(r"[\w-]+(?:\.[\w-]+)*")
_REPORTED: set[str] = set()  # lines about removed keys; a process prints each only once


class Strict(BaseModel):
    """Base of every configuration table: no unknown keys, no conversion between types, immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
    gone: ClassVar[dict[str, str]] = {}  # removed keys and their replacements: accepted with a message, then ignored

    @model_validator(mode="before")
    @classmethod
    def _without_gone_keys(cls, table: Any) -> Any:
        if not isinstance(table, dict):
            return table
        for key in cls.gone.keys() & table.keys():
            line = f"stickslip: {key}: is not used any more; {cls.gone[key]}"
            if line not in _REPORTED:
                _REPORTED.add(line)
                print_line(line)
        return {key: value for key, value in table.items() if key not in cls.gone}


# two numbers; not strict, as pydantic's strict mode refuses an array of TOML as a tuple
Two = Annotated[tuple[float, float], Field(strict=False)]

# Similarity (`difflib`) from which an unknown key counts as a misspelling of a known one. Smaller: distinct keys match, such as
# viscous_damping_Ns_per_m and contact_damping_Ns_per_m with 0.79. Larger: a wrong letter in a short key is missed.
_MISSPELT = 0.8
_NUMBER = re.compile(r"[-+]?[0-9.]+(e[-+]?[0-9]+)?", re.IGNORECASE)
_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")

T = TypeVar("T", bound=Strict)

# short form of a value in a message: a file may hold megabytes of text, or tables 1000 deep, on which Python's repr fails
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 200
in_short = _SHORT.repr


def read_toml(path: Path) -> dict[str, Any]:
    """Read one TOML file. Raises Fault CONFIG when it cannot be read or is not TOML."""
    # refuses a pipe too: reading one without a writer never ends
    check_file(path, "CONFIG", "give the path of a TOML file")
    text = ""
    try:
        with path.open("rb") as file:
            data = file.read(_LARGEST_BYTES + 1)
        if len(data) > _LARGEST_BYTES:
            rule = f"{path.stat().st_size / 1e6:.0f} MB: must be at most {_LARGEST_BYTES >> 20} MiB"
            raise Fault("CONFIG", f"{path}: {rule}; keep measured data in other files")
        text = data.decode("utf-8-sig")  # Notepad writes a byte order mark
        _refuse_depth(path, text)
        return tomllib.loads(text)
    except OSError as error:
        raise Fault("CONFIG", f"{path}: cannot be read: {error.strerror}; give the path of a TOML file") from None
    except UnicodeDecodeError as error:
        raise Fault("CONFIG", f"{path}: is not UTF-8 from byte {error.start + 1} on; save it as UTF-8") from None
    except (ValueError, RecursionError) as error:  # a number of 5000 digits, or brackets 1000 deep
        raise Fault("CONFIG", f"{path}: not valid TOML: {error}{_decimal_comma(text, str(error))}") from None


def _refuse_depth(path: Path, text: str) -> None:
    """Raise Fault CONFIG for a dotted key of too many parts, which would take seconds to read or fail.

    The reader itself bounds nested brackets.
    """
    keys = _DOTS.sub(".", _QUOTED.sub("q", text))
    if any(chain[0].count(".") >= _DEEPEST for chain in _CHAIN.finditer(keys)):
        raise Fault(
            "CONFIG", f"{path}: has a key of more than {_DEEPEST} parts: must be at most {_DEEPEST}; shorten it"
        )


def _decimal_comma(text: str, error: str) -> str:
    """The remedy, if the line named by a TOML error holds a number with a decimal comma; else empty."""
    at = re.search(r"at line (\d+)", error)
    line = text.split("\n")[int(at[1]) - 1] if at else ""
    comma = re.search(rf"=\s*({_COMMA.pattern})", line)
    return f"; write a decimal point: {comma[1].replace(',', '.')}" if comma else ""


def with_overrides(table: dict[str, Any], settings: Iterable[str]) -> dict[str, Any]:
    """A copy of `table` with `key.sub=value` settings applied; values are TOML (`1.1`, `true`, `"text"`, `[1, 2]`).

    A number in a key counts the entries of a list, and the next number adds an entry: `fault.0.value=0.5`.
    Raises Fault CONFIG when a setting has no `=`, or goes below a value that is not a table or list.
    """
    result = dict(table)
    for setting in settings:
        key, separator, text = setting.partition("=")
        if not separator:
            raise Fault("CONFIG", f"--set {setting}: expected key=value, for example --set rig.slide.mass_kg=1.4")
        try:
            value = tomllib.loads(f"value = {text}")["value"]
        except (ValueError, RecursionError):
            value = text
        try:
            result = _with(result, key.strip().split("."), value)
        except ValueError as error:
            raise Fault("CONFIG", f"--set {setting}: {error}") from None
    return result


def _with(below: Any, keys: Sequence[str], value: Any, place: str = "") -> Any:
    """A copy of a table or list with `value` in place of the value at `keys`. Raises ValueError."""
    key, *rest = keys
    if isinstance(below, dict):
        return below | {key: _with(below.get(key, {}), rest, value, key) if rest else value}
    if not isinstance(below, list):
        raise ValueError(f"{place} is a value, not a table; nothing lies below it")
    if not key.isdecimal() or int(key) > len(below):
        raise ValueError(f"{place}.{key}: {place} is a list: must be {place}.0 to {place}.{len(below)}; change the key")
    rows = [*below, {}]
    rows[int(key)] = _with(rows[int(key)], rest, value, key) if rest else value
    return rows if int(key) == len(below) else rows[:-1]


def made_with(make: Callable[[Sequence[str]], T], source: str, settings: Sequence[str], kept: Sequence[str] = ()) -> T:
    """The result of `make(settings)`, where the settings `kept` belong to the files.

    Raises the Fault of `make(kept)`, or else that of `make(settings)`: its lines name the settings concerned instead of `source`.
    """
    try:
        return make(settings)
    except Fault as fault:
        make(kept)
        names = {name: name.partition("=")[0].strip().rpartition(".")[2] for name in settings if name not in kept}
        lines: list[str] = []
        for line in fault.line.splitlines():
            about = [setting for setting, name in names.items() if re.search(rf"\b{re.escape(name)}\b", line)]
            place = ", ".join(f"--set {setting}" for setting in about or names)
            lines.append(line.replace(f"{source}: ", f"{place}: ", 1) if line.startswith(f"{source}: ") else line)
        raise Fault(fault.kind.code, "\n".join(lines)) from None


def validate(model: type[T], table: dict[str, Any], source: str) -> T:
    """An instance of `model` from a table. Raises Fault CONFIG, a line for each problem: source: key = value: rule; remedy."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        problems = _without_misspelt(error.errors())
        lines = [_line(model, source, problem) for problem in problems[:_MOST_PROBLEMS]]
        if len(problems) > _MOST_PROBLEMS:
            lines.append(f"{source}: and {len(problems) - _MOST_PROBLEMS} more problems")
        raise Fault("CONFIG", "\n".join(lines)) from None


def _without_misspelt(problems: Sequence[Any]) -> list[Any]:
    """The problems without missing keys that are misspelt: the unknown key in the same table is reported already."""
    unknown = [problem["loc"] for problem in problems if problem["type"] == "extra_forbidden"]

    def misspelt(table: tuple[str | int, ...], name: str) -> bool:
        siblings = [key[-1] for key in unknown if key[:-1] == table]
        return bool(get_close_matches(name, siblings, 1, _MISSPELT))

    return [item for item in problems if item["type"] != "missing" or not misspelt(item["loc"][:-1], item["loc"][-1])]


def unknown_key(name: str, known: Sequence[str]) -> str:
    """The rule and the remedy for a key that is not one of `known`."""
    near = get_close_matches(name, known, 1, _MISSPELT)
    return f"unknown key; {f'perhaps {near[0]}; ' if near else ''}known here: {', '.join(known) or 'none'}"


def _line(model: type[Strict], source: str, problem: Any) -> str:
    path = [str(part) for part in problem["loc"]]
    key = ".".join(path) or "(file)"
    kind: str = problem["type"]
    if kind == "extra_forbidden":
        known = sorted(_fields(_model_at(model, path[:-1])))
        return f"{source}: {key} = {in_short(problem['input'])}: {unknown_key(path[-1], known)}"
    if kind == "missing":
        return f"{source}: {key}: missing; add it"
    message: str = problem["msg"].removeprefix("Value error, ")
    if kind == "value_error":
        return f"{source}: {key}: {message}" if path else f"{source}: {message}"
    if kind in {"float_type", "int_type"} and isinstance(problem["input"], str):
        comma = _COMMA.fullmatch(problem["input"].strip())
        remedy = (
            "write it without quotes" if _NUMBER.fullmatch(problem["input"].strip()) else "write digits, such as 1.5"
        )
        if comma:
            remedy = f"write a decimal point: {comma[0].replace(',', '.')}"
        return f"{source}: {key} = {in_short(problem['input'])}: must be a number; {remedy}"
    if kind in {"model_type", "dict_type"}:
        needed = [name for name, field in _fields(_model_at(model, path)).items() if field.is_required()]
        inside = ", ".join(f"{name} = VALUE" for name in needed or ["KEY"])
        name = path[-1] if path else "it"
        return f"{source}: {key} = {in_short(problem['input'])}: must be a table; write {name} = {{ {inside} }}"
    if kind == "list_type" and isinstance(problem["input"], dict):
        return f"{source}: {key}: is one table: must be a list of them; write [[{key}]] above each"
    if kind == "string_pattern_mismatch" and (like := _fields(_model_at(model, path[:-1]))[path[-1]].default):
        return f"{source}: {key} = {in_short(problem['input'])}: must have the form of {like!r}; change the value"
    rule = message[:1].lower() + message[1:]
    rule = rule.replace("input should be", "must be")
    return f"{source}: {key} = {in_short(problem['input'])}: {rule}; change the value"


def _fields(model: Any) -> dict[str, Any]:
    return getattr(model, "model_fields", {})


def _model_at(model: type[Strict], path: list[str]) -> Any:
    """The type of the value at `path`."""
    at: Any = model
    for part in path:
        if hasattr(at, "model_fields"):
            field = at.model_fields.get(part)
            at = field.annotation if field else None
        else:  # `part` is an index of a list or a name in a dict: the last argument is the type of the values
            at = (get_args(at) or (None,))[-1]
    return at
