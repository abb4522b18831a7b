"""Friction over the speed of the drive and over the dwell before a slip; whether breakaway or speed drifts over the record."""

from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.log.watches.arrays import noise_of
from bridge.units import prefixed
from diagnosis.look.numbers import Number, mean_of, slope_of
from diagnosis.look.slips import OneWayPart, smoothed
from diagnosis.look.sticks import Cycle

VARIES = 1.3  # ratio of largest to smallest speed above which friction is reported over speed
_BINS_A_DECADE = 8.0
_WINDOWS = 200  # number of windows in which speed and force between slips are averaged
_STANDS = 4.0  # a drive slower than this many standard deviations of its speed noise counts as at rest
_FEWEST_IN_BIN = 3
_FEWEST_DWELLS = 5
_MOST_INFLATED = 10.0  # Marquardt's bound: largest inflation of the slope's variance by the other regressor
_ENOUGH = 0.1  # a rate that varies less than this share of the dwell's variation makes at most a tenth of the slope
_DWELLS = 1.25  # ratio of largest to smallest dwell (of nine in ten slips) above which breakaway is reported over dwell
_ASIDE = 0.05  # share of the dwells at each end that this ratio leaves out; at least one slip
_FEWEST_FOR_DRIFT = 8  # fewest slips: fewer show a drift by chance
_SURE_DRIFT = 2.5  # smallest drift that is reported, in half intervals of 90 %
_OF_SWING = 0.1  # smallest drift, as a share of the fall in a slip: less changes no number beyond its reading accuracy


class AtSpeed(NamedTuple):
    """Friction at one speed of the drive."""

    speed_mps: float
    times: int  # number of slips, or of windows without slips
    mean_N: Number
    breakaway_N: Number | None  # None: the slide moves evenly
    period_s: Number | None  # time from breakaway to breakaway
    sliding: bool
    JSON_HIDDEN = ("sliding",)


def over_speed(parts: list[OneWayPart], cycles: list[Cycle], unit: str = "N") -> list[AtSpeed]:
    """Friction at each speed, lowest speed first; empty where the speed is not known or does not vary."""
    speeds = np.array([cycle.speed_mps for cycle in cycles])
    means = np.array([cycle.mean_force_N for cycle in cycles])
    tops = np.array([(cycle.breakaway_force_N, cycle.period_s) for cycle in cycles]).reshape(-1, 2)
    slipping = np.ones(len(cycles), np.bool_)
    for part in parts:
        in_part = [cycle for cycle in cycles if part.t_s[0] <= cycle.breakaway_t_s <= part.t_s[-1]]
        more_speed, more_mean = _windows(part, in_part)
        speeds, means = np.concatenate([speeds, more_speed]), np.concatenate([means, more_mean])
        tops = np.concatenate([tops, np.full((len(more_speed), 2), np.nan)])
        slipping = np.concatenate([slipping, np.zeros(len(more_speed), np.bool_)])
    good = np.isfinite(speeds) & np.isfinite(means) & (speeds > 0.0)
    speeds, means, tops, slipping = speeds[good], means[good], tops[good], slipping[good]
    if len(speeds) < 2 * _FEWEST_IN_BIN or speeds.max() < VARIES * speeds.min():
        return []
    result: list[AtSpeed] = []
    bins = np.round(np.log10(speeds) * _BINS_A_DECADE).astype(int)
    for number in np.unique(bins):
        own_bin = bins == number
        mean = mean_of(means[own_bin], unit)
        if own_bin.sum() < _FEWEST_IN_BIN or mean is None:
            continue
        slips = tops[own_bin & slipping]
        top, period = mean_of(slips[:, 0], unit), mean_of(slips[:, 1], "s")
        speed_mps = float(np.exp(np.log(speeds[own_bin]).mean()))
        result.append(AtSpeed(speed_mps, int(own_bin.sum()), mean, top, period, top is None))
    return result if len(result) > 1 else []


def _windows(part: OneWayPart, cycles: list[Cycle]) -> tuple[Floats, Floats]:
    """Speed and mean force in windows without a slip, [windows] each; empty where the drive's position is not known."""
    if part.position_m is None:
        return np.zeros(0), np.zeros(0)
    width = max(len(part.t_s) // _WINDOWS, 8)
    windows = len(part.t_s) // width
    edges_s = part.t_s[: windows * width : width]
    length_s = width * part.step_s
    over = max(width // 4, 1)
    position = smoothed(part.position_m, over)[: windows * width].reshape(-1, width)
    speed = (position[:, -1] - position[:, 0]) / (length_s - part.step_s)
    of_noise = noise_of(part.position_m) * (2.0 / over) ** 0.5 / (length_s - part.step_s)
    mean = part.force_N[: windows * width].reshape(-1, width).mean(axis=1)
    free = speed > _STANDS * of_noise
    for cycle in cycles:
        dwell = cycle.dwell_s if np.isfinite(cycle.dwell_s) else cycle.breakaway_t_s - part.t_s[0]
        end = cycle.restick_t_s if np.isfinite(cycle.restick_t_s) else part.t_s[-1]
        free &= (edges_s + length_s < cycle.breakaway_t_s - dwell) | (edges_s > end)
    if cycles:  # the climb after the last slip is a stick that has not ended
        free &= edges_s < max(cycle.breakaway_t_s for cycle in cycles)
    return speed[free], mean[free]


def over_dwell(cycles: list[Cycle]) -> Number | None:
    """Rise of the breakaway force per decade of dwell [N]; None where all dwells are alike, or depend on the speed."""
    rows = _dwells(cycles)
    if rows is None or confounded(cycles):
        return None
    return slope_of(np.log10(rows[:, 0]), rows[:, 1], "N per decade")


def confounded(cycles: list[Cycle]) -> bool:
    """Whether dwells are long where the force climbs slowly, so that a slope over the dwell may be an effect of the speed.

    The criterion is the variance inflation of the two logarithms as regressors (Marquardt, Technometrics 12, 1970), where the
    rate varies enough to imitate the dwell.
    """
    rows = _dwells(cycles)
    if rows is None:
        return False
    dwell, loading = np.log(rows[:, 0]), np.log(rows[:, 2])
    if not float(loading.std()) > _ENOUGH * float(dwell.std()):
        return False
    return 1.0 / max(1.0 - float(np.corrcoef(dwell, loading)[0, 1]) ** 2, 1e-12) > _MOST_INFLATED


def _dwells(cycles: list[Cycle]) -> Floats | None:
    """Dwell, breakaway force and rate of loading, [slips, 3]; None where all dwells are alike, or few."""
    rows = np.array(
        [
            (cycle.dwell_s, cycle.breakaway_force_N, cycle.loading_N_per_s)
            for cycle in cycles
            if cycle.dwell_s > 0.0 and cycle.loading_N_per_s > 0.0
        ]
    ).reshape(-1, 3)
    if len(rows) < _FEWEST_DWELLS:
        return None
    dwells = np.sort(rows[:, 0])
    aside = max(round(_ASIDE * len(dwells)), 1)  # one slip alone shows no dependence
    return None if dwells[-1 - aside] < _DWELLS * dwells[aside] else rows


def unsteady(cycles: list[Cycle], unit: str) -> list[str]:
    """A message on a breakaway that drifts, and a message on sticks of several speeds where only one speed is known.

    Args:
        cycles: every slip of the record.
        unit: unit of the force; "1" for a coefficient.

    """
    tops = [cycle for cycle in cycles if np.isfinite(cycle.restick_force_N)]
    drifts = _drift(tops, "" if unit == "1" else unit) if len(tops) >= _FEWEST_FOR_DRIFT else []
    if (climbs := climbs_vary(cycles)) is None:
        return drifts
    return [
        *drifts,
        f"no single speed: sticks climb by {climbs[0]:.3g} to {climbs[1]:.3g} a second, so period, "
        "stiffness and mass would be mixtures; give the drive's position, or look at a part with one speed",
    ]


def _drift(tops: list[Cycle], unit: str) -> list[str]:
    t_s = np.array([cycle.breakaway_t_s for cycle in tops])
    rate = slope_of(t_s, np.array([cycle.breakaway_force_N for cycle in tops]), f"{unit}/s")
    drift = rate.value * float(np.ptp(t_s)) if rate is not None else 0.0
    swing = float(np.median([cycle.breakaway_force_N - cycle.restick_force_N for cycle in tops]))
    if rate is None or abs(rate.value) < _SURE_DRIFT * (rate.high - rate.value) or abs(drift) < _OF_SWING * swing:
        return []
    factor, shown = prefixed(abs(drift), unit) if unit else (1.0, "")
    verb, size = "rises" if drift > 0.0 else "falls", f"{abs(drift) * factor:.3g} {shown}".rstrip()
    return [
        f"no steady level: the breakaway {verb} by {size} over the record (running in, heat, zero of the sensor), and the "
        "numbers are means over it; look at a part of the record"
    ]


def climbs_vary(cycles: list[Cycle]) -> tuple[float, float] | None:
    """Slowest and fastest climb of the sticks (of eight in ten) in a record of several speeds where at most one is known."""
    sticks = [cycle for cycle in cycles if np.isfinite(cycle.slope_N_per_s)]
    if len(sticks) < _FEWEST_FOR_DRIFT:
        return None
    speeds = [cycle.speed_mps for cycle in sticks if np.isfinite(cycle.speed_mps)]
    low, high = np.quantile([cycle.slope_N_per_s for cycle in sticks], [0.1, 0.9])
    one_speed = (speeds and max(speeds) > VARIES * min(speeds)) or not 0.0 < VARIES * low < high
    return None if one_speed else (float(low), float(high))
