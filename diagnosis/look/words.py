"""The numbers of a record in sentences."""

import math
import re

import numpy as np

from bridge.units import counted, fixed_digits, prefixed
from diagnosis.look.look import LookResult
from diagnosis.look.numbers import Number
from diagnosis.look.speeds import confounded, unsteady
from diagnosis.slips import NOISE_SPANS

# in the order of the output
TITLES = {
    "static_force_N": ("F_s", "force at breakaway"),
    "kinetic_force_N": ("F_k", "sliding friction in a slip"),
    "restick_force_N": ("F_min", "force at re-stick"),
    "mu_s": ("mu_s", "static friction coefficient"),
    "mu_k": ("mu_k", "kinetic friction coefficient"),
    "mu_mean": ("mu", "mean friction coefficient while the slide moves, slips included"),
    "mu_min": ("mu_min", "coefficient at re-stick"),
    "mu_swing": ("swing", "fall of the coefficient in a slip"),
    "mu_slope_per_s": ("climb", "rise of the coefficient in a stick"),
    "mu_dwell_per_decade": ("ageing", "rise of the coefficient at breakaway per decade of stick time"),
    "swing_N": ("swing", "fall of the force in a slip"),
    "period_s": ("period", "time from breakaway to breakaway"),
    "frequency_Hz": ("frequency", "slips per second"),
    "dwell_s": ("stick", "time from re-stick to breakaway"),
    "slip_s": ("slip", "time from breakaway to re-stick"),
    "slope_N_per_s": ("climb", "rise of the force in a stick"),
    "series_N_per_m": ("in series", "rise of the force over the way of the drive: drive and contact in series"),
    "stiffness_N_per_m": ("stiffness", "stiffness of the drive, from its way in a stick"),
    "mass_kg": ("mass", "mass of the slide, from the swing in a slip and that stiffness"),
    "dwell_N_per_decade": ("ageing", "rise of the breakaway force per decade of stick time"),
}

_OTHER_SYMBOLS = {"static_force_N": "breakaway", "kinetic_force_N": "sliding", "restick_force_N": "re-stick"}
_SAMPLES_OF_SLIP = 20  # samples of a slip that show how the force falls
# units that take a prefix; a unit of the file, such as counts, takes none
_WITH_PREFIX = {"N", "N m", "m", "s", "A", "V", "Pa", "kg", "kg m²", "rad"}


def with_interval(number: Number) -> str:
    """A number with its unit and its interval of 90 %."""
    factor, unit = (1.0, "") if number.unit == "1" else (1.0, number.unit)
    if number.unit.partition("/")[0].partition(" per ")[0] in _WITH_PREFIX:
        factor, unit = prefixed(abs(number.value), number.unit)
    value, low, high = number.value * factor, number.low * factor, number.high * factor
    digits = _digits(value, high - low)
    if not math.isfinite(low):
        return f"{fixed_digits(value, None)} {unit}".rstrip() + " (single value: no interval)"
    return f"{value:.{digits}f} {unit}".rstrip() + f" ({low:.{digits}f} to {high:.{digits}f})"


def _digits(value: float, width: float) -> int:
    """Decimals: two digits of the interval, and at most six digits of the number."""
    most = 5 - math.floor(math.log10(abs(value))) if value else 3
    if not math.isfinite(width) or width <= 0.0:
        return min(max(most - 1, 0), 6)
    return min(max(1 - math.floor(math.log10(width)), 0), max(most, 0), 6)


def symbol_of(name: str, seen: LookResult) -> str:
    """The symbol of a number; F is a force, so a record without one has words."""
    return _OTHER_SYMBOLS.get(name, TITLES[name][0]) if seen.known.unit else TITLES[name][0]


def meaning_of(name: str, seen: LookResult) -> str:
    """The meaning of a number; a value in place of a force in a record without one."""
    meaning = TITLES[name][1]
    return re.sub(r"force|sliding friction", "value", meaning) if seen.known.unit else meaning


def headline(seen: LookResult) -> str:
    """The result in one line."""
    return _headline(seen) if seen.answer is None else f"stick-slip: {seen.answer.answer}: {_headline(seen)}"


def _headline(seen: LookResult) -> str:
    if not seen.cycles:
        known = seen.known
        quantity = "friction coefficient" if known.coefficient else "torque" if known.torsion else "force"
        quantity = "mean" if known.unit else quantity
        unit = "" if known.coefficient else f" {known.force_unit}"
        level = f"the {quantity} is {seen.mean_force_N:.4g}{unit} on average, with {seen.noise_N:.2g}{unit} of noise"
        return f"no slip in {seen.seconds:.3g} s: {level}"
    if not seen.sticks:
        swings = f"{counted(len(seen.cycles), 'swing')} in {seen.seconds:.3g} s"
        both_ways = len({part.sign for part in seen.parts}) > 1
        tared = (
            "; if the force was tared to a mean of zero, restore its zero by an offset in a map" if both_ways else ""
        )
        return f"{swings} without a straight climb: the force swings without a stick{tared}"
    rate = 60.0 * seen.slips / seen.seconds
    text = f"{counted(seen.slips, 'slip')} in {seen.seconds:.3g} s, {rate:.3g} per minute"
    period = seen.numbers.get("period_s")
    return text + (f", every {with_interval(period)}" if period is not None else "")


def sentences(seen: LookResult) -> list[str]:
    """A line for each number, and a line for each number that the record cannot give."""
    lines = [
        f"{symbol_of(name, seen):<10} {with_interval(seen.numbers[name])}: {meaning_of(name, seen)}"
        for name in TITLES
        if name in seen.numbers
    ]
    lines += [f"{'':<10} {text}" for text in limits_of_look(seen)]
    for at_speed in seen.at_speeds:
        text = (
            f"{f'at {1e3 * at_speed.speed_mps:.3g} m{seen.known.speed_unit}':<14} mean {with_interval(at_speed.mean_N)}"
        )
        if at_speed.breakaway_N is not None and at_speed.period_s is not None:
            text += (
                f", breakaway {with_interval(at_speed.breakaway_N)}, a slip every {with_interval(at_speed.period_s)}"
            )
        lines.append(text)
    return lines


def _why_no_stiffness(seen: LookResult, example: str) -> str:
    if not any(cycle.speed_mps > 0.0 for cycle in seen.cycles):
        return f"no stiffness and no mass: the drive's speed is not known; add --speed {example}"
    samples = seen.numbers["dwell_s"].value * seen.rate_Hz if "dwell_s" in seen.numbers else 0.0
    return (
        f"no stiffness and no mass: a stick has {samples:.0f} samples; record at {_SAMPLES_OF_SLIP} or more, or slower"
    )


def _why_no_mass(seen: LookResult) -> str:
    if "omega_rad_per_s" in seen.numbers:
        return "no mass: the force falls slower than a free mass swings, by friction or damping; weigh the slide"
    slip_s = seen.numbers["slip_s"].value
    least_Hz = _SAMPLES_OF_SLIP / slip_s
    samples = counted(round(slip_s * seen.rate_Hz), "sample")
    return f"no mass: a slip has {samples}; record at {least_Hz:.2g} Hz or more"


def _why_no_slip(seen: LookResult) -> str:
    """Why a record shows no stick-slip, and how to record it."""
    unit = "" if seen.known.coefficient else f" {seen.known.force_unit}"
    if seen.cycles:
        spans_s = np.diff([cycle.breakaway_t_s for cycle in seen.cycles])
        period_s = float(np.median(spans_s)) if len(spans_s) else seen.seconds
        line = (
            f"no stick: the force swings every {period_s * 1e3:.3g} ms and its climbs are bent, or as long as its falls"
        )
        least_Hz = 2.0 * _SAMPLES_OF_SLIP / period_s
        rate = f", at {least_Hz:.2g} Hz or more" if seen.rate_Hz < least_Hz else ""
        return f"{line}; a slide that rests shows it at a fifth of the speed: record there{rate}"
    least = NOISE_SPANS * seen.noise_N
    line = f"no fall of the force above {least:.2g}{unit}, {NOISE_SPANS:g} times its noise, and above 4 % of its range"
    return f"{line}: smaller slips are not seen; record with less noise, or at a lower speed, which lets slips grow"


def limits_of_look(seen: LookResult) -> list[str]:
    """A line for each missing number: the reason, and the option to add."""
    lines: list[str] = []
    if seen.answer is not None:
        return [seen.answer.why]
    if not seen.sticks:
        return [_why_no_slip(seen)]
    example = "10mrad/s" if seen.known.torsion else "0.5mm/s"
    names = ("mu_s", "mu_k") if seen.known.coefficient else ("static_force_N", "kinetic_force_N")
    if "stiffness_N_per_m" not in seen.numbers and "slope_N_per_s" in seen.numbers:
        lines.append(_why_no_stiffness(seen, example))
    if "stiffness_N_per_m" in seen.numbers and "mass_kg" not in seen.numbers:
        lines.append(_why_no_mass(seen))
    if "stiffness_N_per_m" in seen.numbers and "series_N_per_m" not in seen.numbers:
        lines.append(
            "no stiffness of the contact: the sticks are straight, so the stiffness above holds for drive and contact in series"
        )
    if seen.known.coefficient:
        lines.append("no force: the normal load is not known; add --load 94.5N")
    elif seen.known.load_N is None and not seen.known.torsion:
        lines.append("no friction coefficient: the normal load is not known; add --load 94.5N")
    if seen.slips >= 2 and not {"dwell_N_per_decade", "mu_dwell_per_decade"} & seen.numbers.keys():
        why = "all sticks last alike"
        if confounded(seen.cycles):
            why = "sticks last long where the force climbs slowly, so the speed may be the cause"
        lines.append(f"no dependence on the stick time: {why}; stop the drive for different times, at one speed")
    lines += unsteady(seen.cycles, seen.known.force_unit)
    static = seen.numbers[names[0]]
    if names[1] in seen.numbers and static.value - static.low > 0.1 * (static.value - seen.numbers[names[1]].value):
        lines.append(
            "F_s may be lower than the force at breakaway: the force rises further while the slide starts slowly"
        )
    return lines
