"""Units in their usual spellings: `kN`, `mm/s`, `[N]`, `kgf·cm`, `°`; and units in the names of columns."""

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

_KILOGRAM_N = 9.80665
_TABLE: dict[str, Any] = tomllib.loads(Path(__file__).with_name("units.toml").read_text(encoding="utf-8"))
# by quantity: its SI unit, and the factors of units without a prefix
_UNITS: dict[str, tuple[str, dict[str, float]]] = {name: (row["si"], row["factors"]) for name, row in _TABLE.items()}
_PREFIXES = {"n": 1e-9, "µ": 1e-6, "u": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "k": 1e3, "M": 1e6, "G": 1e9}
# units that take a prefix; `min` is not a milli-inch
_PREFIXED = {"s", "N", "m", "m/s", "m/s2", "Hz", "g", "Nm", "rad", "rad/s", "V", "A", "Pa", "bar", "gn", "lbf", "mps"}
_SAME = str.maketrans(
    {"μ": "µ", "²": "2", "·": "", "*": "", " ": "", "^": "", "−": "-", "⁻": "-", "¹": "1", "\xa0": "", "º": "°"}
    | dict(zip("сНмкгВАиноб", "sNmkgVAinob", strict=True))  # Cyrillic symbols: мм, кН, об/мин
)
_WORDS = {
    "m/sec2": "m/s2",
    "m/s/s": "m/s2",
    "ms-2": "m/s2",
    "ms-1": "m/s",
    "newtons": "newton",
    "mkm": "µm",  # Cyrillic мкм
    "KN": "kN",  # from programs that write capitals only
    "MM": "mm",
}
# quantities over a time, and the quantity of the quotient
_RATES = {
    "length": "velocity",
    "angle": "angular velocity",
    "velocity": "acceleration",
    "angular velocity": "angular acceleration",
}
_TORQUE = re.compile(
    r"(?P<force>[kmcµ]?N|daN|kgf|kp|gf|lbf|ozf|kg|lbs?|oz)(?P<length>[mcµ]?m|in|ft)|(?P<l>in|ft|cm|m)(?P<f>[kmcµ]?N|kgf|lbf|ozf|lbs?|oz)"
)
# a unit after a name: `Force [N]`, `Force (N)`, `Force / N`, `Force/N`, `Force, N`, `Force in N`, `Force_N`, `Force kN`
_BEHIND = re.compile(
    r"^(?P<name>.*?\S)\s*(?:\[(?P<a>[^\][]*)\]|\((?P<b>[^()]*)\)|\s/\s*(?P<c>\S+)|/(?P<g>[^\s/]+(?:/[^\s/]+)?)|,\s*(?P<d>\S+)"
    r"|\s+in\s+(?P<e>\S+)|_(?P<f>[^\W_]+)|\s+(?P<h>\S{2,}))\s*$"
)

# units that after an underscore or a blank are words or symbols: `x_t`, `F_min`, `pos_in`, `force_p`, `axis_C`
_NOT_BEHIND = {"t", "U", "C", "K", "p", "in", "mil", "rev", "1", "-"}
# after an underscore these may number a channel or be a word: `force_A`, `F_min`; they are units in names of the quantity
_OF_QUANTITY = {
    "min": re.compile(r"time|zeit|elapsed|dauer", re.IGNORECASE),
    "h": re.compile(r"time|zeit|elapsed|dauer", re.IGNORECASE),
    "A": re.compile(r"current|strom|amp|(^|[^a-z])i[a-z]?([^a-z]|$)", re.IGNORECASE),
    "V": re.compile(r"volt|spannung|signal|sensor|cell|zelle|bridge|(^|[^a-z])(u|v|out|in)([^a-z]|$)", re.IGNORECASE),
}
# units that are symbols of quantities too: distance, time, height, mass, voltage
_ALSO_SYMBOLS = {"s", "t", "h", "m", "U"}
_OF_TIME = re.compile(r"t|.*(?:time|zeit).*", re.IGNORECASE)
_INDEX = re.compile(r".*\S\[\d+\]")  # `data[1]` is an element of an array; a unit of 1 follows a blank, as in `mu [1]`
_LONGEST_UNIT = 8  # longest unknown unit [characters]


@cache
def known_unit(text: str) -> tuple[str, float] | None:
    """The quantity of a unit, and its factor to SI: ("force", 1000.0) for `kN`; None for an unknown unit."""
    bare = text.strip().strip("[](){}")
    word = bare.translate(_SAME)
    return _listed(word) or _quotient(word) or _torque(word, bare)


def _listed(word: str) -> tuple[str, float] | None:
    """A unit of the table, with or without a prefix."""
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


def _quotient(word: str) -> tuple[str, float] | None:
    """A length, an angle or a velocity over a time or its square: `in/min`, `ft/s2`."""
    over, mark, below = word.rpartition("/")
    squared = len(below) > 1 and below.endswith("2")
    above, time = known_unit(over) if mark else None, _listed(below.removesuffix("2") if squared else below)
    if above is None or time is None or time[0] != "time":
        return None
    quantity = _RATES.get(above[0], "")
    if squared:
        quantity = _RATES.get(quantity, "")
    return (quantity, above[1] / time[1] ** (2 if squared else 1)) if quantity else None


def _torque(word: str, written: str) -> tuple[str, float] | None:
    """A force times a length, in either order: `kgf·cm`, `oz-in`, `ft.lb`; a mass is a weight there."""
    match = _TORQUE.fullmatch(re.sub(r"[-.\s·*⋅]", "", written).translate(_SAME))
    if match is None or (_listed(word) is not None):
        return None
    force, length = weight_unit(match["force"] or match["f"]), _listed(match["length"] or match["l"])
    return ("torque", force[1] * length[1]) if force and length else None


def weight_unit(text: str) -> tuple[str, float] | None:
    """The quantity of a unit, and its factor to SI, in a column of forces: gram, kilogram, ounce and pound are weights there."""
    word = text.strip().strip("[](){}").translate(_SAME)
    grams = {"g": 1e-3, "kg": 1.0, "mg": 1e-6, "t": 1e3}.get(word)
    if grams is not None:
        return "force", _KILOGRAM_N * grams
    known = known_unit(text)
    return ("force", _KILOGRAM_N * known[1]) if known is not None and known[0] == "mass" else known


def si_unit(quantity: str) -> str:
    """The SI unit of a quantity, such as `N` for `force`."""
    return _UNITS[quantity][0]


def unit_in_name(name: str) -> str:
    """The unit at the end of a column's name, as written there; empty without a known unit. `millis` is a name and its unit."""
    match = None if _INDEX.fullmatch(name) else _BEHIND.match(name)
    if match is None:
        word = name.strip().removeprefix("in ")  # Rohde & Schwarz writes `in s`
        is_word = word in _NOT_BEHIND or word in _OF_QUANTITY
        is_time = len(name.strip()) > 1 and not is_word and (known_unit(word) or ("",))[0] == "time"
        return word if is_time else ""
    unit = next((text for key in "abcdefgh" if (text := match[key]) is not None), "").strip()
    if (match["f"] or match["h"]) is not None and (unit in _NOT_BEHIND or not _fits(match["name"], unit)):
        return ""
    if match["g"] is not None and not _is_slash_before_unit(name, match["name"], unit):
        return ""
    return unit if known_unit(unit) else ""


def _fits(name: str, unit: str) -> bool:
    return unit not in _OF_QUANTITY or _OF_QUANTITY[unit].search(name) is not None


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
