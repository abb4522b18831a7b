"""A measured force as evenly sampled parts of one direction, each with its noise."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from bridge.arrays import Floats
from bridge.log.watches.arrays import noise_of

_GAP_STEPS = 10.0  # usual steps; a longer gap cuts the record, as it may hide slips
FEWEST = 16  # fewest samples of a part
_UNEVEN = 0.01  # share of a step; with a larger deviation from an even clock the record is interpolated
_BOTH_WAYS = 0.3  # share of its largest size that the force reaches with either sign on a rig that moves both ways
_TURN = 0.1  # share of that size: a force that changes sign by less has not turned


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


def parts_of(t_s: Floats, force_N: Floats, position_m: Floats | None = None) -> list[OneWayPart]:
    """The even parts of a record, [samples] each, without samples that hold no number or go back in time."""
    good = np.isfinite(t_s) & np.isfinite(force_N)
    if position_m is not None:
        good &= np.isfinite(position_m)
    t_s, force_N = t_s[good], force_N[good]
    position_m = None if position_m is None else position_m[good]
    forward = np.concatenate([[True], t_s[1:] > np.maximum.accumulate(t_s)[:-1]]) if len(t_s) else np.zeros(0, np.bool_)
    t_s, force_N = t_s[forward], force_N[forward]
    position_m = None if position_m is None else position_m[forward]
    if len(t_s) < FEWEST:
        return []
    step_s = float(np.median(np.diff(t_s)))
    gaps = np.flatnonzero(np.diff(t_s) > _GAP_STEPS * step_s) + 1
    edges = np.unique(np.concatenate([[0], gaps, [len(t_s)]]))
    edges = np.unique(np.concatenate([edges, _turns(force_N)]))
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
