"""The relations of a diagnosis in words."""

from bridge.units import decimals_of, fixed_digits, interval, name_and_unit, percent, prefixed, quantity
from diagnosis.result import Diagnosis, RelationNumber, RelationRow, Remainder, RigNumber, Share


def relation_lines(diagnosis: Diagnosis) -> list[str]:
    """Lines of the summary: every relation with its sizes and shares, omitted relations, the largest remainder."""
    lines: list[str] = []
    for row in diagnosis.relations:
        lines.append(sizes_in_words(row))
        lines += [f"  {share_in_words(share)}" for share in diagnosis.shares if share.signal == row.relation]
    lines += [f"{omitted.relation}: left out: {omitted.why}" for omitted in diagnosis.left_out]
    if diagnosis.remainder is not None:
        lines.append(remainder_in_words(diagnosis.remainder))
    return lines


def number_lines(diagnosis: Diagnosis) -> list[str]:
    """Every number that a relation or the baseline refits, next to the described number."""
    lines = [number_in_words(number) for number in diagnosis.numbers]
    lines += [rig_number_in_words(number) for number in diagnosis.rig if number.described and number.tolerance]
    return lines


def sizes_in_words(row: RelationRow) -> str:
    """Residuals of a relation for the described rig, the refitted rig and with its causes; and its noise."""
    described, refitted, left, noise = (
        _size(size, row.unit) for size in (row.described, row.refitted, row.left, row.noise)
    )
    caused = f", {left} with {' and '.join(row.causes)}" if row.causes else ""
    return f"{row.relation}: {described} as described, {refitted} refitted{caused}; noise {noise}"


def _size(size: float, unit: str) -> str:
    """A size with its best prefix, three digits: a common prefix for a whole line would write newtons as 1.93e+03 mN."""
    factor, shown = prefixed(size, unit)
    return f"{size * factor:.3g} {shown}".rstrip()


def share_in_words(share: Share) -> str:
    """A share with its interval, and the share that chance alone reaches."""
    text = f"{share.what} {_percent(share.share)}"
    if known := _between(share.interval_90):
        text += f" (90 %: {known})"
    return text if share.null_90 is None else f"{text}; chance alone shows up to {_percent(share.null_90)}"


def _between(pair: tuple[float, float] | None) -> str:
    return interval(None if pair is None else (max(pair[0], 0.0), max(pair[1], 0.0)))


def _percent(share: float) -> str:
    return percent(max(share, 0.0))


def remainder_in_words(remainder: Remainder) -> str:
    """The size and the relation of the remainder."""
    size, noise = _size(remainder.size, remainder.unit), _size(remainder.noise, remainder.unit)
    if not remainder.what:
        return f"largest remainder: {size} in the {remainder.where}, where noise is {noise}: no pattern"
    how = f"{remainder.what}" if remainder.what.startswith(("over ", "in ")) else f"({remainder.what})"
    return f"{size} remain in the {remainder.where} {how}, where noise is {noise}: nothing in the library"


def number_in_words(number: RelationNumber) -> str:
    """A number of the rig, fitted by a relation."""
    word, unit = name_and_unit(number.name)
    low, high = number.interval_90
    factor, shown = prefixed(max(abs(number.refitted), abs(number.described)), unit)
    digits = decimals_of((high - low) * factor) if high > low else None
    inside = f"{fixed_digits(low * factor, digits)} to {fixed_digits(high * factor, digits)}"
    value = fixed_digits(number.refitted * factor, digits)
    return f"{word} {value} {shown} (90 %: {inside}) by the {number.relation}, described {quantity(number.described, unit)}"


def rig_number_in_words(number: RigNumber) -> str:
    """A number of the rig in the fits."""
    word, unit = name_and_unit(number.name)
    return f"{word} {quantity(number.retuned, unit)}, described {quantity(number.described, unit)}"
