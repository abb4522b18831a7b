"""Units and numbers: the unit in the name of a column; quantities as text."""

import math
import re
from typing import SupportsInt


def counted(number: SupportsInt, singular: str, plural: str = "") -> str:
    """A number of things: `1 gap`, `2 gaps`; `plural` is needed only if it is not `singular` with an s."""
    return f"{number} {singular if number == 1 else plural or f'{singular}s'}"


def unit_of(name: str) -> str:
    """Unit of `name`, such as `N` for `drive_force_N`; `1` for a number without a unit, such as a count or a code."""
    return (name_and_unit(name)[1] or "1").replace("²", "^2")


_UNIT = re.compile(r"^(?:(.*?)_)?((?:Ns2|Ns|N|mps2|mps|m2|m|ns|s|kg|Hz|rad)(?:_per_(?:N|m2|m|s))?|per_s)$")
_SYMBOLS = {"mps2": "m/s²", "mps": "m/s", "Ns2": "N s²", "Ns": "N s", "m2": "m²", "per": "1"}
_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M"}
_SCIENTISTS = {"coulomb", "stribeck"}
_WITHOUT_PREFIX = {"", "%", "kg", "rad", "1/s"}


def signal_name(column: str) -> str:
    """The name of a column as words: `mass_accel_mps2` is `mass acceleration`."""
    return name_and_unit(column)[0].replace("accel", "acceleration")


def name_and_unit(name: str) -> tuple[str, str]:
    """A parameter as words, and its unit: `gap_m` is ("gap", "m").

    `ratio` alone is a relative change in percent; other numbers without a unit have the unit "".
    `phase_rad of run-02.csv` is ("phase in run-02.csv", "rad").
    """
    name, _, file = name.partition(" of ")
    if file:
        word, unit = name_and_unit(name)
        return f"{word} in {file}", unit
    if name == "ratio":
        return "relative change", "%"
    match = _UNIT.match(name)
    if match is None:
        return _words(name), ""
    top, _, bottom = match[2].partition("_per_")
    if top.startswith("per_"):
        top, bottom = "per", top.removeprefix("per_")
    unit = _SYMBOLS.get(top, top) + (f"/{_SYMBOLS.get(bottom, bottom)}" if bottom else "")
    return _words(match[1] or name), unit


def _words(name: str) -> str:
    """Parts of a name as words; names of scientists have a capital."""
    return " ".join(part.capitalize() if part in _SCIENTISTS else part for part in name.split("_"))


def quantity(value: float, unit: str) -> str:
    """A number with its unit: four significant digits, and a prefix for large and small numbers."""
    factor, shown = prefixed(abs(value), unit)
    return f"{fixed_digits(value * factor, None)} {shown}".rstrip()


def percent(share: float | None) -> str:
    """A share or a probability as text; a share below 1 is never shown as 100 %, and one above 0 never as 0 %."""
    if share is None or not math.isfinite(share):
        return "unknown"
    if 0.0 < share < 0.001:
        return "< 0.1 %"
    if 0.999 < share < 1.0:
        return "> 99.9 %"
    if 0.0 < share < 0.01 or 0.99 < share < 1.0:
        return f"{100.0 * share:.1f} %"
    return f"{round(100.0 * share)} %"


def times(value: float | None) -> str:
    """A ratio as text, such as a gap in noise floors: three significant digits."""
    return "unknown" if value is None or not math.isfinite(value) else f"{value:.3g}"


def interval(pair: tuple[float, float] | None) -> str:
    """Two shares as text, `95 % to 98 %`; empty without an interval."""
    if pair is None or not (math.isfinite(pair[0]) and math.isfinite(pair[1])):
        return ""
    return f"{percent(pair[0])} to {percent(pair[1])}"


def band(edges_Hz: tuple[float, float]) -> str:
    """A band as text, `0 to 20 Hz`; `above 20 Hz` if the upper end is not finite."""
    low_Hz, high_Hz = edges_Hz
    return f"{low_Hz:g} to {high_Hz:g} Hz" if math.isfinite(high_Hz) else f"above {low_Hz:g} Hz"


def prefixed(size: float, unit: str) -> tuple[float, str]:
    """Factor and prefixed unit for a number of this size: 0.1 to 1000 stays, others become 1 to 1000; a share becomes percent."""
    if unit == "%":
        return 100.0, unit
    if unit in _WITHOUT_PREFIX or not math.isfinite(size) or size == 0.0 or 0.1 <= size < 1000.0:
        return 1.0, unit
    exponent = min(max(3 * math.floor(math.log10(size) / 3.0), -9), 6)
    return 10.0**-exponent, _PREFIXES[exponent] + unit


def decimals_of(width: float) -> int:
    """Decimals for a number whose interval is `width` wide: two digits of the width."""
    return min(max(1 - math.floor(math.log10(width)), 0), 6)


def fixed_digits(value: float, digits: int | None) -> str:
    """A number as text with `digits` decimals; with None, four significant digits."""
    if not math.isfinite(value):
        return "unknown"
    return f"{value:.4g}" if digits is None else f"{value:.{digits}f}"
