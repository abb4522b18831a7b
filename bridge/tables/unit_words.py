"""Units in their usual spellings: `kN`, `mm/s`, `[N]`, `Nm`, `°`; and units in the names of columns."""

import re
import tomllib
from pathlib import Path
from typing import Any

_POUND_kg, _KILOGRAM_N = 0.45359237, 9.80665
_TABLE: dict[str, Any] = tomllib.loads(Path(__file__).with_name("units.toml").read_text(encoding="utf-8"))
# by quantity: its SI unit, and the factors of units without a prefix
_UNITS: dict[str, tuple[str, dict[str, float]]] = {name: (row["si"], row["factors"]) for name, row in _TABLE.items()}
_PREFIXES = {"n": 1e-9, "µ": 1e-6, "u": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "k": 1e3, "M": 1e6, "G": 1e9}
# units that take a prefix; `min` is not a milli-inch
_PREFIXED = {"s", "N", "m", "m/s", "m/s2", "Hz", "g", "Nm", "rad", "rad/s", "V", "A", "Pa", "bar", "gn"}
_SAME = str.maketrans(
    {"μ": "µ", "²": "2", "·": "", "*": "", " ": "", "^": "", "−": "-", "⁻": "-", "¹": "1", "\xa0": "", "º": "°"}
)
_WORDS = {
    "m/sec2": "m/s2",
    "m/sec": "m/s",
    "m/s/s": "m/s2",
    "ms-2": "m/s2",
    "ms-1": "m/s",
    "newtons": "newton",
    "Umin": "U/min",
    "KN": "kN",  # from programs that write capitals only
    "MM": "mm",
}
# a unit after a name: `Force [N]`, `Force (N)`, `Force / N`, `Force/N`, `Force, N`, `Force in N`, `Force_N`
_BEHIND = re.compile(
    r"^(?P<name>.*?\S)\s*(?:\[(?P<a>[^\][]*)\]|\((?P<b>[^()]*)\)|\s/\s*(?P<c>\S+)|/(?P<g>[^\s/]+(?:/[^\s/]+)?)|,\s*(?P<d>\S+)|\s+in\s+(?P<e>\S+)|_(?P<f>[^\W_]+))\s*$"
)

# units accepted after an underscore: `x_t` and `force_p` have no unit
_AFTER_UNDERSCORE = {
    *("s", "ms", "us", "ns", "N", "kN", "mN", "m", "mm", "um", "µm", "nm", "cm", "micron", "daN", "Nmm"),
    *("Hz", "kHz", "Nm", "rad", "deg", "g", "rpm"),
}
# units that are symbols of quantities too: distance, time, height, mass, voltage
_ALSO_SYMBOLS = {"s", "t", "h", "m", "U"}
_OF_TIME = re.compile(r"t|.*(?:time|zeit).*", re.IGNORECASE)
_INDEX = re.compile(r".*\S\[\d+\]")  # `data[1]` is an element of an array; a unit of 1 follows a blank, as in `mu [1]`
_LONGEST_UNIT = 8  # longest unknown unit [characters]


def known_unit(text: str) -> tuple[str, float] | None:
    """The quantity of a unit, and its factor to SI: ("force", 1000.0) for `kN`; None for an unknown unit."""
    word = text.strip().strip("[](){}").translate(_SAME)
    word = _WORDS.get(word, word)
    for quantity, (_, units) in _UNITS.items():
        for spelling in (word, word.lower()):
            if spelling in units and (len(spelling) > 2 or spelling == word):
                return quantity, units[spelling]
    prefix, rest = word[:1], _WORDS.get(word[1:], word[1:])
    if prefix in _PREFIXES and rest in _PREFIXED:
        if rest == "g" and prefix == "k":
            return "mass", 1.0
        for quantity, (_, units) in _UNITS.items():
            if rest in units:
                return quantity, _PREFIXES[prefix] * units[rest]
    return None


def weight_unit(text: str) -> tuple[str, float] | None:
    """The quantity of a unit, and its factor to SI, in a column of forces: gram, kilogram and pound are weights there."""
    known = known_unit(text)
    word = text.strip().strip("[](){}").translate(_SAME)
    grams = {"g": 1e-3, "kg": 1.0, "mg": 1e-6, "t": 1e3, "lb": _POUND_kg, "lbs": _POUND_kg}.get(word)
    return ("force", _KILOGRAM_N * grams) if grams is not None else known


def si_unit(quantity: str) -> str:
    """The SI unit of a quantity, such as `N` for `force`."""
    return _UNITS[quantity][0]


def unit_in_name(name: str) -> str:
    """The unit at the end of a column's name, as written there; empty without a known unit."""
    match = None if _INDEX.fullmatch(name) else _BEHIND.match(name)
    if match is None:
        return ""
    unit = next((text for key in "abcdefg" if (text := match[key]) is not None), "").strip()
    if match["f"] is not None and unit not in _AFTER_UNDERSCORE:
        return ""
    if match["g"] is not None and not _is_slash_before_unit(name, match["name"], unit):
        return ""
    return unit if known_unit(unit) else ""


def in_brackets(name: str) -> str:
    """The text in brackets at the end of a column's name, the place of a unit; empty without brackets."""
    match = None if _INDEX.fullmatch(name) else _BEHIND.match(name)
    return (match["a"] or match["b"] or "").strip() if match is not None else ""


def _is_slash_before_unit(name: str, before: str, unit: str) -> bool:
    """Whether the name is a quantity over its unit, as `Kraft/N`, and not a path, unit or rate: `log/t`, `N/mm`, `kN/s`."""
    if "/" in before or known_unit(name) or unit in ("t", "U") or (known_unit(before) and before not in _ALSO_SYMBOLS):
        return False
    return (known_unit(unit) or ("",))[0] != "time" or _OF_TIME.fullmatch(before) is not None


def bare_name(name: str) -> str:
    """A column's name without the unit at its end, and with single blanks."""
    name = re.sub(r"\s+", " ", name).strip()
    match = None if _INDEX.fullmatch(name) else _BEHIND.match(name)
    brackets = match is not None and (match["a"] is not None or match["b"] is not None)
    return match["name"] if match is not None and (brackets or unit_in_name(name)) else name


def is_unit_row(cells: list[str]) -> bool:
    """Whether the non-empty cells are units: most of them known, the rest short words that may be units too."""
    words = [cell.strip() for cell in cells if cell.strip()]
    units = [known_unit(word) is not None or re.fullmatch(r"\[.*\]|\(.*\)", word) is not None for word in words]
    rest = [word for word, unit in zip(words, units, strict=True) if not unit]
    return sum(units) > len(rest) and all(len(word) <= _LONGEST_UNIT and not word[0].isdigit() for word in rest)


def unknown_units(units: dict[str, str]) -> str:
    """The unknown units and their columns, as text; empty if all are known."""
    return ", ".join(f"{unit!r} of column {name}" for name, unit in units.items() if known_unit(unit) is None)
