"""A record as even parts of one direction, and the slips of a part.

The time scale comes from the part: falls of 10 ms and of 10 s are found alike.

A fall after a straight climb is a slip; a swing without a straight climb is not a slip. A slip may take longer than the stick
before it.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from bridge.arrays import Floats, Indices
from bridge.log.watches.arrays import noise_of
from diagnosis.slips import NOISE_SPANS, turning_points

_GAP_STEPS = 10.0  # usual steps; a longer gap cuts the record, as it may hide slips
FEWEST = 16  # fewest samples of a part
_UNEVEN = 0.01  # share of a step; with a larger deviation from an even clock the record is interpolated
_BOTH_WAYS = 0.3  # share of its largest size that the force reaches with either sign on a rig that moves both ways
_TURN = 0.1  # share of that size: a force that changes sign by less has not turned
# Smallest fall as a share of the range between the 1st and the 99th percentile. Smaller: ripple counts; larger: small slips of a
# record with large ones are lost.
_SHARE = 0.04
_SMOOTH = 10  # duration of a fall in widths of the smoothing: a round peak is cut by 0.2 % of the fall
_WIDEST = 0.02  # largest width of the smoothing, as a share of the part
_NOISE_OF_MANY = 3.0  # standard deviations that the largest of many samples reaches
# Largest distance of the inner 80 % of a climb from its chord, as a share of the climb, for a straight climb. A stiff contact
# that creeps gives 0.07, a sine 0.056: a climb that lasts as long as its fall must be straighter.
_STRAIGHT, _STRAIGHTER = 0.08, 0.04
_QUICK = 3.0  # ratio of climb to fall duration above which every climb is a stick, even if creep bends it
_ALIKE = 1.15  # largest ratio of the durations of climb and fall that count as equal
_AS_QUICK = 3.0  # ratio of fall to climb duration above which the shape of the fall is not judged
_FEWEST_OF_FALL = 8  # fewest samples of a fall whose shape is judged
_POINTS = 41  # points at which the falls are averaged
_LEAST_STRAIGHT = 0.5  # smallest share of straight climbs in stick-slip; below it the force swings


class OneWayPart(NamedTuple):
    """An even stretch in which the drive goes one way. Arrays are [samples]; the force is positive along the motion."""

    t_s: Floats
    force_N: Floats
    position_m: Floats | None  # position of the drive, rising along the motion
    sign: float  # sign of the measured force
    noise_N: float  # standard deviation of the force from sample to sample

    @property
    def step_s(self) -> float:
        """Seconds between samples."""
        return float(self.t_s[-1] - self.t_s[0]) / (len(self.t_s) - 1)


def parts_of(t_s: Floats, force_N: Floats, position_m: Floats | None = None, turns: bool = True) -> list[OneWayPart]:
    """The even parts of a record, [samples] each, without samples that hold no number or go back in time.

    `turns`: the force changes its sign where the drive turns.
    """
    columns = [t_s, force_N] if position_m is None else [t_s, force_N, position_m]
    columns = [column[np.isfinite(columns).all(axis=0)] for column in columns]
    latest_s = np.maximum.accumulate(np.concatenate([[-np.inf], columns[0]]))
    t_s, force_N, *positions = (column[columns[0] > latest_s[:-1]] for column in columns)
    position_m = positions[0] if positions else None
    if len(t_s) < FEWEST:
        return []
    step_s = float(np.median(np.diff(t_s)))
    gaps = np.flatnonzero(np.diff(t_s) > _GAP_STEPS * step_s) + 1
    edges = np.unique(np.concatenate([[0], gaps, [len(t_s)]]))
    edges = np.unique(np.concatenate([edges, _turns(force_N)])) if turns else edges
    parts: list[OneWayPart] = []
    for first, last in pairwise(edges.tolist()):
        if last - first < FEWEST:
            continue
        inside = slice(first, last)
        sign = -1.0 if float(np.median(force_N[inside])) < 0.0 else 1.0
        position = None if position_m is None else position_m[inside]
        if position is not None and position[-1] < position[0]:
            position = -position
        parts.append(_even(t_s[inside], sign * force_N[inside], position, sign))
    return parts


def _turns(force_N: Floats) -> npt.NDArray[np.int64]:
    """Indices where the direction turns; empty for a rig that moves one way."""
    size = float(np.quantile(np.abs(force_N), 0.99))
    if min(np.quantile(force_N, 0.95), -np.quantile(force_N, 0.05)) < _BOTH_WAYS * size:
        return np.zeros(0, np.int64)
    side = np.where(force_N > _TURN * size, 1, np.where(force_N < -_TURN * size, -1, 0))
    known = np.flatnonzero(side)
    turned = np.flatnonzero(np.diff(side[known])) + 1
    return known[turned]


def _even(t_s: Floats, force_N: Floats, position_m: Floats | None, sign: float) -> OneWayPart:
    step_s = float(t_s[-1] - t_s[0]) / (len(t_s) - 1)
    even_s = t_s[0] + step_s * np.arange(len(t_s))
    if np.abs(t_s - even_s).max() > _UNEVEN * step_s:
        force_N = np.interp(even_s, t_s, force_N)
        position_m = None if position_m is None else np.interp(even_s, t_s, position_m)
    return OneWayPart(even_s, force_N, position_m, sign, float(noise_of(force_N)))


def smoothed(values: Floats, width: int) -> Floats:
    """Moving mean over `width` samples, [samples]; an even width is made odd."""
    width = width | 1
    return values if width <= 1 else np.asarray(uniform_filter1d(values, width, mode="mirror"), np.float64)


class RecordSlips(NamedTuple):
    """Slips of a part, indices of samples, [slips] each; `bottoms` may be one shorter."""

    part: OneWayPart
    tops: Indices  # breakaways
    bottoms: Indices  # re-sticks
    width: int  # width of the smoothing [samples]
    straight: float  # share of climbs that are straight; 0 without a climb

    @property
    def sticks(self) -> bool:
        """Whether the climbs are straight, as a spring loads on a slide at rest."""
        return self.straight >= _LEAST_STRAIGHT

    @property
    def falls(self) -> tuple[Indices, Indices]:
        """Begin and end of each complete fall, [falls]."""
        count = min(len(self.tops), len(self.bottoms))
        return self.tops[:count], self.bottoms[:count]

    def middles(self, tops: Indices, bottoms: Indices) -> Floats:
        """The instants [samples] at which each force has fallen by half, from lines through the samples around them."""
        falls = zip(tops.tolist(), bottoms.tolist(), strict=True)
        return np.array([_half_done(self.part.force_N, top, bottom, self.width) for top, bottom in falls])


def find_slips(part: OneWayPart, least_N: float = 0.0) -> RecordSlips | None:
    """The slips of a part with falls of `least_N` or more; None where no fall exceeds the noise."""
    width = 1
    widest = max(1, int(_WIDEST * len(part.force_N)))
    result: tuple[Indices, Indices] | None = None
    noise_N = part.noise_N
    while width <= widest:
        tops, bottoms = _turning(part.force_N, width, noise_N, least_N)
        if len(tops):
            result = tops, bottoms
            falls = bottoms - tops[: len(bottoms)]
            wanted = min(max(1, int(np.median(falls)) // _SMOOTH), widest) if len(falls) else width
            if wanted <= width:
                break
            width = min(wanted, 4 * width)
            continue
        width *= 2
    if result is None:
        return None
    width = min(width, widest)
    tops, bottoms = result
    return RecordSlips(part, tops, bottoms, width, _straight(part, tops, bottoms, width, noise_N))


def _turning(force_N: Floats, width: int, noise_N: float, least_N: float) -> tuple[Indices, Indices]:
    """Alternating maxima and minima of the smoothed force that differ by more than its noise."""
    smooth = smoothed(force_N, width)
    low, high = np.quantile(smooth, (0.01, 0.99))
    drop_N = max(NOISE_SPANS * noise_N / (width | 1) ** 0.5, _SHARE * float(high - low), least_N)
    if drop_N <= 0.0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    at = turning_points(smooth, drop_N)
    return at[::2], at[1::2]


def _straight(part: OneWayPart, tops: Indices, bottoms: Indices, width: int, sample_noise_N: float) -> float:
    """Share of straight climbs, each from a re-stick to the next breakaway; with a single slip the climb before it counts."""
    smooth = smoothed(part.force_N, width)
    noise_N = _NOISE_OF_MANY * sample_noise_N / (width | 1) ** 0.5
    begins = bottoms[: len(tops) - 1]
    limit = _STRAIGHT
    if len(begins):
        ratio = float(np.median(tops[1 : len(begins) + 1] - begins)) / float(np.median(begins - tops[: len(begins)]))
        if ratio > _QUICK:
            return 1.0
        if ratio > 1.0 / _AS_QUICK and _falls_straight(smooth, tops, begins):
            return 0.0
        limit = _STRAIGHTER if 1.0 / _ALIKE < ratio < _ALIKE else _STRAIGHT
    elif not len(bottoms):  # the fall goes on to the end, where the drive turned: no re-stick
        return 0.0
    climbs = list(zip(begins.tolist(), tops[1 : len(begins) + 1].tolist(), strict=True))
    if not climbs:
        climbs = [(0, int(tops[0]))]
    straight = 0
    for first, last in climbs:
        rise = smooth[first : last + 1]
        height = float(rise[-1] - rise[0])
        if len(rise) < 4 or height <= 0.0:
            continue
        # the ends are rounded by the smoothing and by the ring of a re-stick
        cut = max(1, len(rise) // 10)
        inner = rise[cut:-cut] if len(rise) > 3 * cut else rise
        chord = np.linspace(inner[0], inner[-1], len(inner))
        straight += bool(np.abs(inner - chord).max() < limit * height + noise_N)
    return straight / len(climbs)


def _falls_straight(smooth: Floats, tops: Indices, bottoms: Indices) -> bool:
    """Whether the mean fall is a straight line, as in a triangle wave: a slip is bent, as a free slide swings."""
    falls = [smooth[top : bottom + 1] for top, bottom in zip(tops.tolist(), bottoms.tolist(), strict=False)]
    falls = [fall for fall in falls if len(fall) >= _FEWEST_OF_FALL and fall[0] > fall[-1]]
    if not falls:
        return False
    at = np.linspace(0.1, 0.9, _POINTS)
    shares = [
        (np.interp(at * (len(fall) - 1), np.arange(len(fall)), fall) - fall[-1]) / (fall[0] - fall[-1])
        for fall in falls
    ]
    mean = np.mean(shares, axis=0)
    return float(np.abs(mean - np.linspace(mean[0], mean[-1], _POINTS)).max()) < _STRAIGHTER


def _half_done(force_N: Floats, top: int, bottom: int, width: int) -> float:
    around = slice(max(top - width, 0), top + width + 1), slice(max(bottom - width, 0), bottom + width + 1)
    half = 0.5 * (float(force_N[around[0]].mean()) + float(force_N[around[1]].mean()))
    inside = np.arange(top, bottom + 1)
    near = inside[np.abs(force_N[inside] - half) < 0.25 * abs(force_N[top] - force_N[bottom])]
    if len(near) < 2:
        near = inside
    x = near - near.mean()
    y = force_N[near]
    slope = float(x @ (y - y.mean())) / max(float(x @ x), 1e-300)
    return float(near.mean()) + (half - float(y.mean())) / slope if slope < 0.0 else float(near.mean())
