"""A diagnosis in words: verdicts, relations, latent friction, numbers with their units, the meaning of each effect."""

import math
from collections.abc import Iterable
from typing import Final

from bridge.log.finding import Finding
from bridge.units import decimals_of, fixed_digits, interval, name_and_unit, percent, prefixed, quantity
from diagnosis.evidence.column_checks import WRONG_SIGN, WRONG_UNIT
from diagnosis.hypotheses.catalogue import CATALOGUE
from diagnosis.latent.answer import MOST
from diagnosis.latent.causes import NOISE, SCATTER
from diagnosis.latent.rows import BREAKAWAY, SLIDING
from diagnosis.result import (
    PARAMETERS,
    Diagnosis,
    Estimate,
    RelationRow,
    Remainder,
    RigNumber,
    Share,
    WrongNumber,
)  # fmt: skip
from plant.effects.library import EFFECTS

EFFECT_WORDS: Final = {name: row.words for name, row in CATALOGUE.items()} | {
    "none": "the rig as described, inside its tolerances, is enough",
}
_BELOW_0: Final = {("drive-hardening", "ratio"): "a softening"}  # text for negative values, by effect and parameter
# finding of a signal whose course may be one over place or one over time, and its text
SLOW, SLOWLY = "slow", "varies slowly: these runs cannot separate place from time"


def headline(diagnosis: Diagnosis) -> str:
    """The verdict and the answer in one line; a wrong unit or sign comes first, because the answer is then worth little."""
    wrong = dict.fromkeys(finding.where.partition(": ")[2] for finding in to_correct(diagnosis.findings))
    doubt = f"doubtful, first correct the unit or sign of {', '.join(wrong)}: " if wrong else ""
    return f"{doubt}{diagnosis.verdict}: {answer(diagnosis)}"


def to_correct(findings: Iterable[Finding]) -> list[Finding]:
    """Findings about a unit or a sign that only the operator can correct."""
    return [finding for finding in findings if finding.kind in (WRONG_UNIT, WRONG_SIGN)]


def answer(diagnosis: Diagnosis) -> str:
    """The answer in one line, without the verdict."""
    if diagnosis.verdict == "no-gap":
        return "the described rig explains these runs within its tolerances"
    most = mostly(diagnosis)
    if diagnosis.verdict == "unexplained":
        if most is not None:
            return f"{most.what} explains most of the {most.signal}, and no known effect accounts for it"
        return "these runs differ from the rig as described, and no known effect accounts for it"
    names = " and ".join(diagnosis.effects)
    if diagnosis.verdict == "partly":
        if most is not None:
            return f"{most.what} explains most of the {most.signal}, {names} another part"
        return f"{names} explains a part of the difference: {sizes_of_effects(diagnosis)}"
    if diagnosis.verdict == "described":
        return "; ".join(map(closing_number_in_words, diagnosis.numbers))
    if diagnosis.verdict == "not-finished":
        return "the work ended before any cause was tried"
    sure = sum(row.probability for row in diagnosis.candidates if row.effect in diagnosis.effects)
    return f"{names}, probability {percent(sure)}: {sizes_of_effects(diagnosis)}"


def sizes_of_effects(diagnosis: Diagnosis) -> str:
    """Size and meaning of each named effect."""
    named = [row for row in diagnosis.candidates if row.effect in diagnosis.effects]
    return "; ".join(
        ", ".join(
            [*(estimate_in_words(row.effect, *item) for item in row.parameters.items()), EFFECT_WORDS[row.effect]]
        )
        for row in named
    )


def closed_in_words(share: float) -> str:
    """Share of the gap that is closed, in percent; at most 100, also for a fit below the noise floor."""
    return percent(min(share, 1.0))


def closed_between(interval_90: tuple[float, float] | None) -> str:
    """The interval of a closed share, such as `43 to 100 %`; empty if it is not known."""
    return interval(interval_90 and (min(interval_90[0], 1.0), min(interval_90[1], 1.0)))


def who_in_words(who: str) -> str:
    """Name of a model that is compared on the held-out runs, by the glossary; an effect keeps its name."""
    return "baseline" if who == PARAMETERS else who


def estimate_in_words(effect: str, name: str, estimate: Estimate) -> str:
    """A parameter in words, such as `gap 81 µm (90 %: 76 to 86)`; an interval that is not finite is left out.

    A negative number whose effect is named after the opposite gets an explanation, such as "a softening".
    """
    word, unit = name_and_unit(name)
    low, high = estimate.interval_90
    known = math.isfinite(low) and math.isfinite(high)
    sizes = [abs(number) for number in ((estimate.value, low, high) if known else (estimate.value,))]
    factor, shown = prefixed(max(sizes), unit)
    digits = decimals_of((high - low) * factor) if known and high > low else None
    text = f"{word} {fixed_digits(estimate.value * factor, digits)} {shown}".rstrip()
    if known:
        text += f" (90 %: {fixed_digits(low * factor, digits)} to {fixed_digits(high * factor, digits)})"
    below = _BELOW_0.get((effect, name))
    return f"{text}, {below}" if below and estimate.value < 0.0 else text


def relation_lines(diagnosis: Diagnosis) -> list[str]:
    """Every relation with its sizes and the shares beyond chance; omitted relations."""
    lines: list[str] = []
    for row in diagnosis.relations:
        lines.append(sizes_in_words(row))
        of_row = [share for share in diagnosis.shares if share.signal == row.relation]
        lines += [f"  {share_in_words(share)}" for share in of_row if share.null_90 is None or share.beyond_chance]
    return [*lines, *(f"{omitted.relation}: left out: {omitted.why}" for omitted in diagnosis.left_out)]


def number_lines(diagnosis: Diagnosis) -> list[str]:
    """Every refitted number, next to the described number."""
    return [rig_number_in_words(number) for number in diagnosis.rig if number.described and number.tolerance]


def sizes_in_words(row: RelationRow) -> str:
    """Residuals of a relation for the described rig and for the refitted rig; and its noise."""
    described, refitted, noise = (_size(size, row.unit) for size in (row.described, row.refitted, row.noise))
    return f"{row.relation}: {described} as described, {refitted} refitted, noise {noise}"


def _size(size: float, unit: str) -> str:
    """A size with its best prefix, three digits: a common prefix for a whole line would write newtons as 1.93e+03 mN."""
    factor, shown = prefixed(size, unit)
    return f"{size * factor:.3g} {shown}".rstrip()


def share_in_words(share: Share) -> str:
    """A share with its interval, and the share that chance alone reaches."""
    text = f"{share.what} {percent(share.share)}"
    if known := interval(share.interval_90):
        text += f" (90 %: {known})"
    return text if share.null_90 is None else f"{text}; chance alone shows up to {percent(share.null_90)}"


def remainder_in_words(remainder: Remainder) -> str:
    """The size and the relation of the remainder."""
    size, noise = _size(remainder.size, remainder.unit), _size(remainder.noise, remainder.unit)
    if not remainder.what:
        return f"largest remainder: {size} in the {remainder.where}, where noise is {noise}: no pattern"
    how = f"{remainder.what}" if remainder.what.startswith(("over ", "in ")) else f"({remainder.what})"
    return f"{size} remain in the {remainder.where} {how}, where noise is {noise}: nothing in the library"


def wrong_number_in_words(number: WrongNumber) -> str:
    """A number that was found, and the described one."""
    value = estimate_in_words("", number.name, Estimate(number.found, number.interval_90))
    off = "" if number.off is None else f" ({number.off:.1f} tolerances off)"
    return f"{value}, described {quantity(number.described, name_and_unit(number.name)[1])}{off}"


def rig_number_in_words(number: RigNumber) -> str:
    """A number of the rig in the fits."""
    word, unit = name_and_unit(number.name)
    return f"{word} {quantity(number.retuned, unit)}, described {quantity(number.described, unit)}"


def closing_number_in_words(number: WrongNumber) -> str:
    """A number that was found, the described one, and the share of the gap that it closes."""
    closes = "" if number.share is None else f", closes {closed_in_words(number.share)} of the gap"
    return f"{wrong_number_in_words(number)}{closes}"


def mostly(diagnosis: Diagnosis) -> Share | None:
    """A cause outside the verdict that explains most of a signal, with an interval above chance; None without such a cause."""
    sure = [
        share
        for share in diagnosis.shares
        if share.signal in (BREAKAWAY, SLIDING)
        and share.what not in (SCATTER, NOISE, *diagnosis.effects)
        and share.share > MOST
        and share.beyond_chance
    ]
    return max(sure, key=lambda share: share.share, default=None)


def latent_answer(diagnosis: Diagnosis) -> str:
    """The share of `mostly` as a sentence; empty without such a cause."""
    top = mostly(diagnosis)
    if top is None:
        return ""
    why = "it is not certain enough to be named" if top.what in EFFECTS else "the library has no effect for it"
    return f"Largest cause in the {top.signal}: {share_in_words(top)}; {why}."
