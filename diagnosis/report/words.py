"""A diagnosis in words: verdicts, numbers with their units, and the meaning of each effect on a machine."""

import math
from typing import Final

from bridge.units import decimals_of, fixed_digits, interval, name_and_unit, percent, prefixed, times
from diagnosis.hypotheses.catalogue import CATALOGUE
from diagnosis.report.latent_block import mostly
from diagnosis.result import PARAMETERS, Diagnosis, Estimate
from diagnosis.verdict.held_out import FAR_FOR_NO_GAP

EFFECT_WORDS: Final = {name: row.words for name, row in CATALOGUE.items()} | {
    "none": "the rig as described, inside its tolerances, is enough",
    "unexplained": "there is a gap, and nothing in the library closes it",
}
_BELOW_0: Final = {("drive-hardening", "ratio"): "a softening"}  # text for negative values, by effect and parameter


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
