"""All numbers of one measured record."""

import math
import re
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.results import in_json
from diagnosis.look.creep import limit_of
from diagnosis.look.laid_over import breakaway_of, with_slip_times
from diagnosis.look.motion import StickSlip, best_way
from diagnosis.look.numbers import Number, jackknifed, mean_of, median_of
from diagnosis.look.slip_shape import Shape, falls_of, hidden_by_damping_N, shape_of
from diagnosis.look.slips import OneWayPart, RecordSlips, find_slips, parts_of
from diagnosis.look.speeds import AtSpeed, climbs_vary, over_dwell, over_speed
from diagnosis.look.sticks import Cycle, climbs_of, cycles_of

# name of a number of the force -> name of the number of a friction coefficient
_MU = {
    "static_force_N": "mu_s",
    "kinetic_force_N": "mu_k",
    "restick_force_N": "mu_min",
    "swing_N": "mu_swing",
    "slope_N_per_s": "mu_slope_per_s",
    "dwell_N_per_decade": "mu_dwell_per_decade",
}

# numbers that belong to one speed of the drive; their mean over several speeds belongs to none
_OF_ONE_SPEED = ("period_s", "frequency_Hz", "dwell_s", "slope_N_per_s", "mu_slope_per_s")
_OF_SPRING = ("series_N_per_m", "stiffness_N_per_m", "mass_kg")  # numbers that only a force gives

# unit of a linear rig -> unit of a rotary rig
_TURNING = {"N": "N m", "N/s": "N m/s", "N/m": "N m/rad", "kg": "kg m²", "N per decade": "N m per decade"}

# Errors that all slips of a record share, so that their scatter does not show them. From 16 axes of `bench.control.drawn` at 1
# and 10 kHz and 43 rigs of `tests.look`, half with a damped drive, against the numbers of the friction law; others are in
# tests/look/test_intervals.py. Larger: wider intervals, which hold more often.
# F_s may be lower, in rises of the force until the slide is as fast as its drive (0 to 0.43 on the axes), and higher, as a share
# of F_s - F_k (creep: 0.04 in the middle, 0.5 on the softest contact).
_FALLS_SLOWLY, _CREEPS = 0.4, 0.06
# The limit of the friction from the sticks, over the force at breakaway, was 0.4 to 1 of the true one where the contact creeps:
# the sticks that are fitted end before the limit. Smaller: F_s of slow drives and soft contacts lies above its interval.
_NOT_REACHED = 2.0
# Stiffness: shares by which the correction for the contact may be too large or small (0.46 and 0.82 at most, except on 2 rigs).
_TOO_MUCH, _TOO_LITTLE = 0.5, 0.75
# Fewest samples of a stick from which a stiffness comes. At 5 to 13 it was 8 to 33 % too small on 7 drawn axes, as the ring of a
# re-stick fills the climb; from 17 on 0 to 4 % wrong. Larger: records of fast axes give none.
_FEWEST_OF_STICK = 16
_OF_A_SAMPLE = 0.25  # of a sample, by which a fall may last longer or shorter: 5 % of the mass for 10 samples


class RecordFacts(NamedTuple):
    """Numbers that the operator gives, SI units; for a rotary rig torque for force, rad for m, kg m² for kg."""

    speed_mps: float | None = None  # speed of the drive, where its position was not measured
    load_N: float | None = None  # normal load
    mass_kg: float | None = None  # mass of the slide
    coefficient: bool = False  # the record holds the force over an unknown load
    torsion: bool = False  # the rig is rotary: forces are torques, ways are angles
    unit: str = ""  # unit of a record that holds no force: a motor current, a following error; empty for a force

    @property
    def force_unit(self) -> str:
        """Unit of the record's force or coefficient."""
        return self.unit or ("1" if self.coefficient else "N m" if self.torsion else "N")

    @property
    def follows(self) -> bool:
        """Whether the record is a following error: its sign changes in each slip."""
        return self.unit in ("m", "rad")

    @property
    def speed_unit(self) -> str:
        """Unit of the drive's speed."""
        return "rad/s" if self.torsion else "m/s"


class LookResult(NamedTuple):
    """The numbers of a record. Numbers that it does not show are missing from `numbers`."""

    seconds: float
    rate_Hz: float
    noise_N: float
    cycles: list[Cycle]
    sticks: bool  # False: the force swings without straight climbs, or does not swing
    numbers: dict[str, Number]
    at_speeds: list[AtSpeed]
    parts: list[OneWayPart]
    known: RecordFacts
    mean_force_N: float
    answer: StickSlip | None  # whether a record without a force shows stick-slip; None for a force
    JSON_HIDDEN = "cycles", "sticks", "parts", "known", "answer"

    @in_json
    def stick_slip(self) -> str:
        """Whether the record shows stick-slip."""
        return self.answer.answer if self.answer is not None else "yes" if self.sticks else "no"

    @in_json
    def swings_without_stick(self) -> int:
        """Number of swings of the force in a record without sticks; 0 in a record with sticks."""
        return 0 if self.sticks else len(self.cycles)

    @in_json
    def slips(self) -> int:
        """Number of slips that began; 0 in a record without sticks."""
        return len(self.cycles) if self.sticks else 0


def look(
    t_s: Floats, force_N: Floats, position_m: Floats | None = None, known: RecordFacts | None = None
) -> LookResult | None:
    """Look at a record: time, force and drive position, [samples] each, SI units. None where it is too short."""
    known = known or RecordFacts()
    parts = parts_of(t_s, force_N, position_m, not known.follows)
    if not parts:
        return None
    slips_of_parts = [slips for slips in (find_slips(part) for part in parts) if slips is not None]
    answer = None
    if known.unit:
        parts, slips_of_parts, answer = best_way(parts, known.follows, known.speed_mps)
    limit = limit_of([climb for slips in slips_of_parts for climb in climbs_of(slips)])
    ratio = limit.value if limit is not None else 1.0
    cycles = [cycle for slips in slips_of_parts for cycle in cycles_of(slips, known.speed_mps, ratio)]
    weights = [len(slips.tops) for slips in slips_of_parts]
    straight = [slips.straight for slips in slips_of_parts]
    sticks = bool(slips_of_parts) and float(np.average(straight, weights=weights)) >= 0.5
    sticks = sticks if answer is None else answer.answer == "yes"
    seconds = sum(float(part.t_s[-1] - part.t_s[0]) for part in parts)
    step_s = float(np.median([part.step_s for part in parts]))
    numbers: dict[str, Number] = {}
    if sticks:
        numbers |= _of_cycles(slips_of_parts, cycles, step_s)
        numbers |= _of_falls(slips_of_parts, numbers, limit)
        numbers |= _between_samples(numbers, step_s)
        if (dwell := over_dwell(cycles)) is not None:
            numbers["dwell_N_per_decade"] = dwell
    if known.load_N:
        numbers |= {
            f"mu_{name}": numbers[f"{key}_force_N"].times(1.0 / known.load_N, "1")
            for name, key in (("s", "static"), ("k", "kinetic"))
            if f"{key}_force_N" in numbers
        }
    mean_N = _mean_N(parts, slips_of_parts)
    if known.coefficient or known.unit:
        numbers = {
            (_MU.get(name, name) if known.coefficient else name): number._replace(
                unit=re.sub(r"^N\b", known.force_unit, number.unit)
            )
            for name, number in numbers.items()
            if name not in _OF_SPRING
        }
    if known.unit:
        # the mean would hold the times over turns and starts of the drive too
        if sticks and (period := median_of(_periods(slips_of_parts), "s")) is not None:
            numbers["period_s"] = period.wider(step_s / math.sqrt(6.0))
            numbers["frequency_Hz"] = Number(1.0 / period.value, 1.0 / period.high, 1.0 / period.low, "Hz")
    elif known.torsion:
        numbers = {
            name: number._replace(unit=_TURNING.get(number.unit, number.unit)) for name, number in numbers.items()
        }
    at_speeds = over_speed(parts, cycles if sticks else [], known.force_unit)
    if at_speeds or climbs_vary(cycles):
        gone = _OF_ONE_SPEED if at_speeds else (*_OF_ONE_SPEED, *_OF_SPRING)
        numbers = {name: number for name, number in numbers.items() if name not in gone}
    if known.load_N:
        numbers["mu_mean"] = Number(mean_N / known.load_N, math.nan, math.nan, "1")
    return LookResult(
        seconds,
        1.0 / step_s,
        float(np.median([part.noise_N for part in parts])),
        cycles,
        sticks,
        numbers,
        at_speeds,
        parts,
        known,
        mean_N,
        answer,
    )


def _mean_N(parts: list[OneWayPart], slips_of_parts: list[RecordSlips]) -> float:
    """Mean force while the slide slides or slips: over whole periods, else from the first time the force reaches its median."""
    tops_of = {id(slips.part): slips.tops for slips in slips_of_parts}
    moving: list[Floats] = []
    for part in parts:
        tops = tops_of.get(id(part), ())
        first = tops[0] if len(tops) > 1 else np.argmax(part.force_N >= np.median(part.force_N))
        moving.append(part.force_N[first : tops[-1] if len(tops) > 1 else None])
    return float(np.concatenate(moving).mean())


def _periods(slips_of_parts: list[RecordSlips]) -> Floats:
    """Times between breakaways of a part [s]."""
    return np.concatenate([np.diff(slips.part.t_s[slips.tops]) for slips in slips_of_parts])


def _of_cycles(slips_of_parts: list[RecordSlips], cycles: list[Cycle], step_s: float) -> dict[str, Number]:
    """Means over the slips."""
    periods = _periods(slips_of_parts)
    stuck = [cycle for cycle in cycles if math.isfinite(cycle.dwell_s)] or cycles
    drops = [cycle.breakaway_force_N - cycle.restick_force_N for cycle in stuck]
    durations = [cycle.restick_t_s - cycle.breakaway_t_s for cycle in cycles]
    tops = [cycle.breakaway_force_N for cycle in stuck]
    numbers = {
        "static_force_N": mean_of(tops, "N"),
        "restick_force_N": mean_of([cycle.restick_force_N for cycle in stuck], "N"),
        "swing_N": mean_of(drops, "N"),
        # a breakaway lies between two samples
        "period_s": mean_of(periods, "s", step_s / math.sqrt(6.0) / max(len(periods), 1)),
        "dwell_s": mean_of([cycle.dwell_s for cycle in stuck], "s", 0.3 * step_s),
        "slip_s": mean_of(durations, "s", 0.3 * step_s),
        "slope_N_per_s": mean_of([cycle.slope_N_per_s for cycle in stuck], "N/s"),
    } | _stiffness(stuck, step_s)
    if numbers["static_force_N"] is not None:
        numbers["static_force_N"] = breakaway_of(slips_of_parts, numbers["static_force_N"])
    return with_slip_times({name: number for name, number in numbers.items() if number is not None}, slips_of_parts)


def _stiffness(stuck: list[Cycle], step_s: float) -> dict[str, Number | None]:
    """Stiffness of the drive, and stiffness of drive and contact in series; the latter alone where sticks hide the contact.

    The contact's compliance comes from a formula, so the interval is widened by shares of its correction; where the sticks do
    not resolve it, by the largest compliance that they allow.
    """
    if not float(np.median([cycle.dwell_s for cycle in stuck])) >= _FEWEST_OF_STICK * step_s:
        return {}
    series = mean_of([cycle.stiffness_N_per_m for cycle in stuck], "N/m")
    drive = mean_of([cycle.drive_m_per_N for cycle in stuck], "m/N")
    if series is None or not series.low > 0.0:  # aliased swings
        return {}
    if drive is None or not drive.low > 0.0:
        return {"stiffness_N_per_m": series}
    # below 2 half intervals the scatter of the contact's compliance exceeds half of its correction
    if not 1.0 / series.value - drive.value > 2.0 * (drive.high - drive.value):
        return {"stiffness_N_per_m": series._replace(high=max(series.high, 1.0 / drive.low))}
    value = 1.0 / drive.value
    correction = abs(value - series.value)
    low, high = 1.0 / drive.high - _TOO_MUCH * correction, 1.0 / drive.low + _TOO_LITTLE * correction
    stiffness = Number(value, low, high, "N/m")
    return {"series_N_per_m": series, "stiffness_N_per_m": stiffness}


def _of_falls(slips_of_parts: list[RecordSlips], numbers: dict[str, Number], limit: Number | None) -> dict[str, Number]:
    """Sliding friction, mass and the force at which the slide breaks away, from the falls laid over each other."""
    if "restick_force_N" not in numbers:
        return {}
    top, bottom = numbers["static_force_N"], numbers["restick_force_N"]
    stacks = [
        falls for falls in (falls_of(slips, top.value, bottom.value) for slips in slips_of_parts) if falls is not None
    ]
    midway = 0.5 * (top.value + bottom.value)
    # sliding friction lies in the middle of an undamped fall, near the re-stick of a heavily damped one
    guess = Number(midway, midway - 0.5 * (top.value - bottom.value), midway + 0.25 * (top.value - bottom.value), "N")
    if not stacks:
        return {"kinetic_force_N": guess}
    falls = max(stacks, key=lambda stack: stack.slips)
    shape, partials, alternative = shape_of(falls)
    if shape is None:
        return {"kinetic_force_N": guess}
    kinetic = jackknifed(shape.force_N, [partial.force_N for partial in partials], "N")
    omega = jackknifed(shape.omega_rad_per_s, [partial.omega_rad_per_s for partial in partials], "rad/s")
    if alternative is not None:
        kinetic = kinetic.wider(alternative.force_N - shape.force_N)
        omega = omega.wider(alternative.omega_rad_per_s - shape.omega_rad_per_s)
    kinetic = kinetic._replace(low=kinetic.low - hidden_by_damping_N(falls, shape))
    step_s = max(slips.part.step_s for slips in slips_of_parts)
    omega = omega.wider(_OF_A_SAMPLE * shape.omega_rad_per_s * step_s / falls.length_s)
    result = {
        "kinetic_force_N": kinetic,
        "omega_rad_per_s": omega,
        "static_force_N": _breakaway(shape, numbers, step_s, limit),
    }
    if "stiffness_N_per_m" in numbers and shape.is_swing:
        stiffness = numbers["stiffness_N_per_m"]
        mass_kg = stiffness.value / omega.value**2
        share = math.hypot(
            (stiffness.high - stiffness.value) / stiffness.value, 2.0 * (omega.high - omega.value) / omega.value
        )
        result["mass_kg"] = Number(mass_kg, mass_kg * (1.0 - share), mass_kg * (1.0 + share), "kg")
    return result


def _breakaway(shape: Shape, numbers: dict[str, Number], step_s: float, limit: Number | None) -> Number:
    """The mean force at breakaway; the interval holds the static friction of a friction law too.

    The force rises further until the slide is as fast as its drive. For friction that falls at once
    (top - F_k)^2 = (F_s - F_k)^2 + (slope / w)^2; for friction that falls slowly, and where the drive damps, F_s is lower. It is
    higher where the contact creeps before it breaks away, and where the peak lies between two samples.
    """
    top = numbers["static_force_N"]
    above = top.value - shape.force_N
    rise = numbers["slope_N_per_s"].value / shape.omega_rad_per_s if "slope_N_per_s" in numbers else 0.0
    least = shape.force_N + math.sqrt(max(above**2 - rise**2, 0.0)) - _FALLS_SLOWLY * rise
    between = above * (shape.omega_rad_per_s * step_s) ** 2 / 8.0
    higher = top.high + _CREEPS * above + between
    if limit is not None:
        higher += _NOT_REACHED * (limit.high - 1.0) * top.value
    return top._replace(low=min(top.low, least - (top.value - top.low)), high=higher)


def _between_samples(numbers: dict[str, Number], step_s: float) -> dict[str, Number]:
    """F_s and F_k, their intervals widened by the climb of the force in one sample time: breakaways lie between samples."""
    if "slope_N_per_s" not in numbers:
        return {}
    more = abs(numbers["slope_N_per_s"].value) * step_s
    names = (name for name in ("static_force_N", "kinetic_force_N") if name in numbers)
    return {
        name: numbers[name]._replace(low=numbers[name].low - more, high=numbers[name].high + more) for name in names
    }
