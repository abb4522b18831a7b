"""The numbers of a record in sentences."""

import math

from bridge.units import counted, fixed_digits, prefixed
from diagnosis.look.look import LookResult
from diagnosis.look.numbers import Number
from diagnosis.look.speeds import confounded, unsteady

# in the order of the output
TITLES = {
    "static_force_N": ("F_s", "force at breakaway"),
    "kinetic_force_N": ("F_k", "sliding friction in a slip"),
    "restick_force_N": ("F_min", "force at re-stick"),
    "mu_s": ("mu_s", "static friction coefficient"),
    "mu_k": ("mu_k", "kinetic friction coefficient"),
    "mu_mean": ("mu", "mean friction coefficient of the record"),
    "mu_min": ("mu_min", "coefficient at re-stick"),
    "mu_swing": ("swing", "fall of the coefficient in a slip"),
    "mu_slope_per_s": ("climb", "rise of the coefficient in a stick"),
    "mu_dwell_per_decade": ("ageing", "rise of the coefficient at breakaway per decade of stick time"),
    "swing_N": ("swing", "fall of the force in a slip"),
    "period_s": ("period", "time from breakaway to breakaway"),
    "dwell_s": ("stick", "time from re-stick to breakaway"),
    "slip_s": ("slip", "time from breakaway to re-stick"),
    "slope_N_per_s": ("climb", "rise of the force in a stick"),
    "series_N_per_m": ("in series", "rise of the force over the way of the drive: drive and contact in series"),
    "stiffness_N_per_m": ("stiffness", "stiffness of the drive, from its way in a stick"),
    "mass_kg": ("mass", "mass of the slide, from the swing in a slip and that stiffness"),
    "dwell_N_per_decade": ("ageing", "rise of the breakaway force per decade of stick time"),
}

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


def headline(seen: LookResult) -> str:
    """The result in one line."""
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
    lines: list[str] = []
    for name, (symbol, meaning) in TITLES.items():
        if name in seen.numbers:
            lines.append(f"{symbol:<10} {with_interval(seen.numbers[name])}: {meaning}")
    lines += [f"{'':<10} {text}" for text in limits_of_look(seen)]
    for at_speed in seen.at_speeds:
        top = "" if at_speed.breakaway_N is None else f", breakaway {with_interval(at_speed.breakaway_N)}"
        lines.append(
            f"{'at ' + f'{1e3 * at_speed.speed_mps:.3g} m{seen.known.speed_unit}':<14} mean {with_interval(at_speed.mean_N)}{top}"
        )
    return lines


def limits_of_look(seen: LookResult) -> list[str]:
    """A line for each missing number: the reason, and the option to add."""
    lines: list[str] = []
    if not seen.sticks:
        return lines
    example = "10mrad/s" if seen.known.torsion else "0.5mm/s"
    names = ("mu_s", "mu_k") if seen.known.coefficient else ("static_force_N", "kinetic_force_N")
    if "stiffness_N_per_m" not in seen.numbers and "slope_N_per_s" in seen.numbers:
        lines.append(f"no stiffness and no mass: the drive's speed is not known; add --speed {example}")
    if "stiffness_N_per_m" in seen.numbers and "series_N_per_m" not in seen.numbers:
        lines.append(
            "no stiffness of the contact: the sticks are straight, so the stiffness above holds for drive and contact in series"
        )
    if seen.known.unit:
        lines = []  # the reading reports that no force was measured
    elif seen.known.coefficient:
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
