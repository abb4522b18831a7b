"""Cells with a number and its unit, as gauges write them: `12.3 N`, and after a change of range `980 mN`."""

import re

from bridge.tables.cells import number_in
from bridge.tables.unit_words import known_unit, si_unit

_LOOKED_AT = 50  # first cells of a column that decide whether it has units
_WITH_UNIT = re.compile(r"(?P<number>[-+]?[\d.,]*\d[.,]?(?:[eE][-+]?\d+)?)\s*(?P<unit>[A-Za-zµμ°%][A-Za-zµμ°/²*·]*\d?)")


def number_and_unit(cell: str) -> tuple[str, str]:
    """The text of the number in a cell, and its unit; without a known unit, the cell itself and ""."""
    word = cell.strip()
    if not word or (word[-1].isdigit() and "/" not in word):  # a quick exit for most cells; `m/s2` ends in a digit too
        return word, ""
    match = _WITH_UNIT.fullmatch(word)
    return (match["number"], match["unit"]) if match is not None and known_unit(match["unit"]) else (word, "")


def units_apart(texts: list[str], decimal: str, thousands: str) -> tuple[list[str], str] | None:
    """The numbers of a column without their units, and the unit; None if most of its first cells have no unit.

    If the unit changes from cell to cell, the numbers are converted to the SI unit of their quantity.
    """
    first = [number_and_unit(text)[1] for text in texts[:_LOOKED_AT]]
    if 2 * sum(map(bool, first)) <= len(first):
        return None
    parts = [number_and_unit(text) for text in texts]
    factors = {unit: known_unit(unit) for _, unit in parts if unit}
    known = [factor for factor in factors.values() if factor is not None]
    if len({quantity for quantity, _ in known}) != 1:
        return None
    if len(factors) == 1:
        return [number for number, _ in parts], next(iter(factors))
    result: list[str] = []
    for number, unit in parts:
        factor, value = factors.get(unit), number_in(number, decimal, thousands)
        result.append(number if factor is None or value is None else str(value * factor[1]).replace(".", decimal))
    return result, si_unit(known[0][0])
