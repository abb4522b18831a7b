"""A diagnosis in words: verdicts, numbers with their units, and what each effect means on a machine."""

import math
from typing import Final

from bridge.units import decimals_of, fixed_digits, name_and_unit, percent, prefixed, times
from diagnosis.result import Diagnosis, Estimate

EFFECT_WORDS: Final = {
    "static-friction-ageing": "the longer the contact rests, the more force it takes to break it away",
    "frictional-lag": "friction follows a change of speed a little late",
    "viscous-friction": "friction grows with speed, as with thick oil",
    "position-dependent-friction": "friction changes along the way, and is the same again at the same place",
    "direction-dependent-friction": "friction differs between forward and backward",
    "normal-load-fluctuation": "what presses the surfaces together goes up and down",
    "friction-drift": "friction wanders slowly over the run, as with running in or warming up",
    "coulomb-level": "sliding friction is further from the described value than its tolerance allows",
    "static-level": "breakaway friction is further from the described value than its tolerance allows",
    "stribeck-velocity": "the speed over which friction falls is further from the described value than its tolerance allows",
    "drive-damping": "the drive damps its own oscillation, as a rubber coupling does",
    "drive-stiffness": "the drive is stiffer or softer than its tolerance allows",
    "drive-hardening": "the drive becomes stiffer or softer the further it is loaded",
    "drive-backlash": "play in the drive: it moves a little without any force when the load changes sign",
    "drive-speed-ripple": "the drive runs unevenly, for example once a turn of its screw",
    "frame-compliance": "what holds the drive yields and swings",
    "base-compliance": "what holds the base yields and swings",
    "piezo-roll-off": "the piezo moves less than commanded at high frequency",
    "piezo-resonance": "the piezo moves more than commanded near its own resonance",
    "piezo-sag": "the piezo moves less than commanded under load or when warm",
    "force-sensor-gain": "the force sensor reads too much or too little by a constant share",
    "force-sensor-bias": "the force sensor reads too much or too little by a constant force",
    "force-sensor-drift": "the zero of the force sensor wanders",
    "force-sensor-lag": "the force sensor smooths: its reading creeps after the force",
    "force-sensor-delay": "the force reading comes late but unchanged",
    "accelerometer-gain": "the accelerometer reads too much or too little by a constant share",
    "none": "the rig as described, inside its tolerances, is enough",
    "unexplained": "there is a gap, and nothing in the library closes it",
}
# Noise floors that the baseline may leave on held-out runs for an answer of "no gap". Too small: a good "no gap" is doubted.
# Too large: a gap that shows only on held-out runs is not told. Counted: docs/method/report.md.
_FAR_FOR_NO_GAP = 2.0


def headline(diagnosis: Diagnosis) -> str:
    """The verdict and the answer in one line."""
    return f"{diagnosis.verdict}: {answer(diagnosis)}"


def cannot_tell(diagnosis: Diagnosis) -> bool:
    """Whether the fitted runs show no gap and the held-out runs do."""
    gap = diagnosis.gap
    return diagnosis.verdict == "no-gap" and bool(gap.runs) and gap.retuned > _FAR_FOR_NO_GAP


def answer(diagnosis: Diagnosis) -> str:
    """The answer in one line, without the word of the verdict."""
    if diagnosis.verdict == "no-gap":
        if cannot_tell(diagnosis):
            return f"these runs cannot tell, the held-out runs are {times(diagnosis.gap.retuned)} noise floors off"
        return "the rig as described explains these runs"
    if diagnosis.verdict == "unexplained":
        return "these runs differ from the rig as described, and no known effect accounts for it"
    names = " and ".join(diagnosis.effects)
    sure = sum(one.probability for one in diagnosis.candidates if one.effect in diagnosis.effects)
    others = [one for group in diagnosis.not_distinguishable if {*group} & {*diagnosis.effects} for one in group]
    others = [one for one in dict.fromkeys(others) if one not in diagnosis.effects]
    alike = f"; or {', '.join(others)}, which would explain these runs nearly as well" if others else ""
    return f"{names}, probability {percent(sure)}{alike}"


def estimate_in_words(name: str, estimate: Estimate) -> str:
    """A parameter in words, such as `gap 81 µm (90 %: 76 to 86)`; an interval that is not finite is left out."""
    word, unit = name_and_unit(name)
    low, high = estimate.interval_90
    known = math.isfinite(low) and math.isfinite(high)
    sizes = [abs(number) for number in ((estimate.value, low, high) if known else (estimate.value,))]
    factor, shown = prefixed(max(sizes), unit)
    digits = decimals_of((high - low) * factor) if known and high > low else None
    text = f"{word} {fixed_digits(estimate.value * factor, digits)} {shown}".rstrip()
    return (
        f"{text} (90 %: {fixed_digits(low * factor, digits)} to {fixed_digits(high * factor, digits)})"
        if known
        else text
    )
