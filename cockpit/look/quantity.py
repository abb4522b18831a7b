"""A quantity of the command line: a number with its unit."""

import math
import re

from bridge.faults import Fault
from bridge.tables.unit_words import known_unit, si_unit

_EXAMPLES = {"velocity": "0.5mm/s", "force": "94.5N", "mass": "1.5kg", "frequency": "1kHz", "time": "30s"}
_GRAMS = {"g": 1e-3, "mg": 1e-6}  # for a mass, g means gram and not acceleration
# by quantity of a sliding rig: the quantity of a turning rig that is accepted in its place
_TURNING = {"velocity": "angular velocity", "mass": "inertia"}


def turns(text: str) -> bool:
    """True for a quantity of a turning rig: rad/s, rpm, kg m²."""
    unit = re.search(r"[^-+.\deE\s].*", text)
    return unit is not None and (known_unit(unit[0]) or ("",))[0] in _TURNING.values()


def quantity(option: str, text: str, kind: str) -> float | None:
    """The value in SI units, above 0; None for an empty text. Raises Fault CONFIG for a text that is not of this kind."""
    if not text:
        return None
    match = re.fullmatch(r"\s*([-+.\d]+(?:[eE][-+]?\d+)?)\s*(.*?)\s*", text)
    example = f"write for example {option} {_EXAMPLES[kind]}"
    try:
        value = float(match[1]) if match is not None else math.nan
    except ValueError:
        value = math.nan
    unit = "" if match is None else match[2]
    known = (kind, _GRAMS[unit]) if kind == "mass" and unit in _GRAMS else known_unit(unit)
    if not unit:
        raise Fault("CONFIG", f"{option} {text}: has no unit, such as {si_unit(kind)}; {example}")
    if not value > 0.0 or not math.isfinite(value) or known is None or known[0] not in (kind, _TURNING.get(kind)):
        raise Fault("CONFIG", f"{option} {text}: must be a {kind} above 0; {example}")
    return value * known[1]
