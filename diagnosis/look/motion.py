"""Stick-slip in a record without a force: a following error, a motor current or torque, or a position.

A slide that sticks lets each of them climb for as long as it rests, and fall as it slips. The climb is a straight line in a
following error, as the command goes on evenly, and bent in a current, where the integrator of the loop adds to it. A ripple of
the motor and a swinging loop rise and fall alike.
"""

from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.units import counted
from diagnosis.look.slips import OneWayPart, RecordSlips, find_slips
from diagnosis.look.sticks import cycles_of
from diagnosis.slips import turning_points

_FEWEST = 5  # fewest swings that show whether they are slips; start and turns of a drive give up to 3
# Smallest fall over the usual one: smaller ones are ripple between slips. 0: ripple splits the currents of 4 of 80 axes; 0.5:
# small slips in a following error are lost on 4 of 80.
_LEAST_FALL = 0.3
# Share of the drive's speed by which a slide falls behind: above _SWINGS it goes back. A slide that rests had 0.81 to 1.19, one
# that moves on 0 to 0.57, on 280 drawn servo axes. _RESTS of 0.5: 3 axes without stick-slip are called "yes".
_RESTS, _SWINGS, _FEWEST_SLOPES = 0.7, 1.5, 3
_FEWEST_OF_FALL = 3  # fewest samples of a fall; shorter ones are steps of an encoder
# Ratio of the durations of climb and fall: on 40 drawn servo axes the swings of those without stick-slip had 0.9 to 1.15, the
# currents of those with it 1.2 to 7.5. Above _SLIPS it is stick-slip even if climbs are bent; between the two it stays open.
_ALIKE, _SLIPS = 1.15, 1.3
_STRAIGHT = (
    0.5  # share of straight climbs in a following error from which it is stick-slip; 0 without it, 0.66 to 1 with it
)
# Largest share by which the periods of slips differ (inter-quartile range): swings at turns of the drive come unevenly.
_MOST_UNEVEN = 0.6
_TURN = 0.2  # share of the range of a position by which it goes back at a turn
_NEAR_TURN = 0.05  # share of a stroke at each end that the loop needs to settle


class StickSlip(NamedTuple):
    """Whether a record shows stick-slip, and why."""

    answer: Literal["yes", "no", "cannot tell"]
    why: str


def best_way(
    parts: list[OneWayPart], follows: bool, speed_mps: float | None
) -> tuple[list[OneWayPart], list[RecordSlips], StickSlip]:
    """The parts, their slips and the answer.

    Args:
        parts: the parts of the record.
        follows: a following error, which programs write with either sign.
        speed_mps: speed of the drive; None: not known.

    """
    ways = [parts]
    if follows:
        ways.append([part._replace(force_N=-part.force_N, sign=-part.sign) for part in parts])
    slips_of = [[slips for slips in map(_alike, way) if slips is not None] for way in ways]
    way = max(range(len(ways)), key=lambda i: _shape(slips_of[i])[0])
    return ways[way], slips_of[way], _answer(slips_of[way], follows, speed_mps)


def _alike(part: OneWayPart) -> RecordSlips | None:
    """The slips of a part without the ripple between them; the usual fall is the one in the middle of the sum of all falls."""
    slips = find_slips(part)
    if slips is None:
        return None
    tops, bottoms = slips.falls
    sizes = np.sort(part.force_N[tops] - part.force_N[bottoms])
    if not len(sizes):
        return slips
    usual = float(sizes[np.searchsorted(np.cumsum(sizes), 0.5 * sizes.sum())])
    return find_slips(part, _LEAST_FALL * usual) or slips


def _shape(slips: list[RecordSlips]) -> tuple[float, float, int, float]:
    """Ratio of climb to fall durations, share of straight climbs, number of swings, and duration of a fall [samples]."""
    climbs = [part.tops[1 : len(part.bottoms) + 1] - part.bottoms[: len(part.tops) - 1] for part in slips]
    falls = [part.bottoms - part.tops[: len(part.bottoms)] for part in slips]
    climb, fall = np.concatenate([*climbs, np.empty(0)]), np.concatenate([*falls, np.empty(0)])
    if not len(climb) or not len(fall):
        return 0.0, 0.0, 0, 0.0
    straight = float(np.average([part.straight for part in slips], weights=[len(part.tops) for part in slips]))
    middle = float(np.median(fall))
    return float(np.median(climb)) / max(middle, 1.0), straight, sum(len(part.tops) for part in slips), middle


def _uneven(slips: list[RecordSlips]) -> float:
    """Inter-quartile range of the times between breakaways, as a share of their median."""
    spans = np.concatenate([np.diff(part.tops) for part in slips])
    if not len(spans):
        return np.inf
    low, middle, high = np.quantile(spans, (0.25, 0.5, 0.75))
    return float((high - low) / middle)


def _at_rest(slips: list[RecordSlips], speed_mps: float) -> StickSlip:
    """Stick-slip in a following error at a known speed: a slide at rest falls behind by the way of its drive."""
    slopes = [cycle.slope_N_per_s for part in slips for cycle in cycles_of(part, None)]
    slopes = [slope for slope in slopes if np.isfinite(slope)]
    if not slopes:
        return StickSlip("no", "0 swings above the noise, without the start and the turns of the drive")
    share = float(np.median(slopes)) / speed_mps
    why = f"between slips the slide falls behind at {100.0 * share:.0f} % of the drive's speed"
    if share < _RESTS:
        return StickSlip("no", f"{why}: it moves on")
    if len(slopes) < _FEWEST_SLOPES:
        return StickSlip("cannot tell", f"{why} in {counted(len(slopes), 'stick')}: too few; record for longer")
    return StickSlip("yes", f"{why}: it rests") if share < _SWINGS else StickSlip("no", f"{why}: it swings")


def _answer(slips: list[RecordSlips], follows: bool, speed_mps: float | None) -> StickSlip:
    ratio, straight, swings, fall = _shape(slips)
    at_rest = _at_rest(slips, speed_mps) if follows and speed_mps else None
    if swings < _FEWEST and at_rest is None:
        return StickSlip("no", f"{swings} swings above the noise: start and turns of the drive give as many")
    if 0 < fall < _FEWEST_OF_FALL and (at_rest is None or at_rest.answer == "yes"):
        return StickSlip(
            "cannot tell", f"a fall has {fall:.0f} samples: record at a higher rate, or with a finer encoder"
        )
    if at_rest is not None:
        return at_rest
    times = f"climbs take {ratio:.2g} times as long as falls"
    if ratio > _SLIPS or (follows and straight >= _STRAIGHT):
        if not follows and (uneven := _uneven(slips)) > _MOST_UNEVEN:
            return StickSlip(
                "cannot tell", f"{times}, but their periods differ by {100.0 * uneven:.0f} %: record for longer"
            )
        return StickSlip("yes", f"{times}, {100.0 * straight:.0f} % of them straight")
    if ratio > _ALIKE:
        return StickSlip("cannot tell", f"{times}, and are bent: record the following error or the position too")
    return StickSlip("no", f"{times}: a ripple or a swinging loop, as a slide that rests lets them last longer")


def lag_of(t_s: Floats, position: Floats) -> tuple[Floats, float | None]:
    """How far a position lies behind an even motion in each of its strokes, [samples], NaN near the turns; and its speed."""
    known = np.flatnonzero(np.isfinite(t_s + position))
    result = np.full(len(position), np.nan)
    values = position[known]
    if not len(known) or not np.ptp(values) > 0.0:
        return result, None
    turns = [0, *turning_points(values, _TURN * float(np.ptp(values))).tolist(), len(values)]
    speeds: list[float] = []
    for first, end in pairwise(turns):
        cut = int(_NEAR_TURN * (end - first))
        rows = known[first + cut : end - cut]
        if len(rows) < 2:
            continue
        line = np.polynomial.Polynomial.fit(t_s[rows], position[rows], 1)(t_s[rows])
        result[rows] = np.sign(line[-1] - line[0]) * (line - position[rows])
        speeds.append(abs(float(line[-1] - line[0])) / float(t_s[rows[-1]] - t_s[rows[0]]))
    return result, float(np.median(speeds)) if speeds else None
