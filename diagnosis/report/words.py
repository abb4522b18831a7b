"""A diagnosis in words: verdicts, relations, latent friction, numbers with their units, the meaning of each effect."""

import math
from collections.abc import Sequence
from typing import Final

from bridge.units import decimals_of, fixed_digits, interval, name_and_unit, percent, prefixed, quantity, times
from diagnosis.hypotheses.catalogue import CATALOGUE
from diagnosis.latent.answer import LatentSignal
from diagnosis.latent.causes import NOISE, SCATTER
from diagnosis.latent.rows import BREAKAWAY, SLIDING
from diagnosis.result import PARAMETERS, Diagnosis, Estimate, RelationNumber, RelationRow, Remainder, RigNumber, Share
from diagnosis.verdict.by_latent import MOST
from diagnosis.verdict.held_out import FAR_FOR_NO_GAP
from plant.effects.library import EFFECTS

EFFECT_WORDS: Final = {name: row.words for name, row in CATALOGUE.items()} | {
    "none": "the rig as described, inside its tolerances, is enough",
    "unexplained": "there is a gap, and nothing in the library closes it",
}
_BELOW_0: Final = {("drive-hardening", "ratio"): "a softening"}  # text for negative values, by effect and parameter
# finding of a signal whose course may be one over place or one over time, and its text
SLOW, SLOWLY = "slow", "varies slowly: these runs cannot tell place from time"
_MOST_IN_SENTENCE = 3  # most causes in a sentence


def headline(diagnosis: Diagnosis) -> str:
    """The verdict and the answer in one line."""
    return f"{diagnosis.verdict}: {answer(diagnosis)}"


def is_undecided(diagnosis: Diagnosis) -> bool:
    """Whether the fitted runs show no gap and the held-out runs do."""
    gap = diagnosis.gap
    return diagnosis.verdict == "no-gap" and bool(gap.files) and gap.retuned > FAR_FOR_NO_GAP


def answer(diagnosis: Diagnosis) -> str:
    """The answer in one line, without the verdict."""
    if diagnosis.verdict == "no-gap":
        if is_undecided(diagnosis):
            return f"the fitted runs show no gap, but the held-out runs are {times(diagnosis.gap.retuned)} noise floors off"
        return "the rig as described explains these runs"
    most = mostly(diagnosis)
    if diagnosis.verdict == "unexplained":
        if most is not None:
            return f"{most.what} explains most of the {most.signal}, and no known effect accounts for it"
        return "these runs differ from the rig as described, and no known effect accounts for it"
    names = " and ".join(diagnosis.effects)
    if diagnosis.verdict == "partly":
        if most is not None:
            return f"{most.what} explains most of the {most.signal}, {names} another part"
        return f"{names} explains a part of the difference; the rest is not explained"
    sure = sum(candidate.probability for candidate in diagnosis.candidates if candidate.effect in diagnosis.effects)
    others = [name for group in diagnosis.not_distinguishable if {*group} & {*diagnosis.effects} for name in group]
    others = [name for name in dict.fromkeys(others) if name not in diagnosis.effects]
    alike = f"; or {', '.join(others)}, which would explain these runs nearly as well" if others else ""
    return f"{names}, probability {percent(sure)}{alike}"


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


def latent_line(latent: Sequence[LatentSignal]) -> str:
    """The largest share whose interval exceeds chance, as a progress message; empty without such a share."""
    candidates = [
        (share.share, latent_signal.signal, share)
        for latent_signal in latent
        for share in latent_signal.shares
        if share.beyond_chance
    ]
    if not candidates:
        return ""
    _, signal, share = max(candidates, key=lambda candidate: candidate[0])
    return f"{signal}: {share_in_words(Share(signal, share.what, share.share, share.interval_90, share.null_90))}"


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


def latent_sentences(diagnosis: Diagnosis, kept: str) -> list[str]:
    """One sentence per signal: the size of the difference, and the share that each cause explains."""
    sentences: list[str] = []
    slow = {finding.where for finding in diagnosis.findings if finding.kind == SLOW}
    for row in diagnosis.relations:
        if row.relation not in (BREAKAWAY, SLIDING):
            continue
        shares = [share for share in diagnosis.shares if share.signal == row.relation and share.what in row.causes]
        largest = sorted((share for share in shares if share.what != NOISE), key=lambda share: -share.share)
        listed = "; ".join(share_in_words(share) for share in largest[:_MOST_IN_SENTENCE])
        off = f"The {row.relation}{kept} is off by {quantity(row.refitted, row.unit)} rms"
        sentences.append(f"{off}: {listed}." if listed else f"{off}; no cause explains it better than chance.")
        if row.relation in slow:
            sentences.append(f"It {SLOWLY}.")
    return sentences
