"""Sliding friction and frequency of the swing, from all falls of a record laid over each other.

While the slide slips, m x'' = F - F_k and F = k (s - x), so F = F_k + A cos(w t + phase): the middle of the fall lies at F_k, for
any start and end of the slip. A decay represents damping.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from bridge.arrays import Floats
from diagnosis.look.slips import RecordSlips

# Share of the fall at either end that is not fitted: it belongs to breakaway and re-stick. No other share was counted.
FIRST, LESS = 0.12, 0.06
_MOST_SAMPLES = 4000  # that are fitted
_FEWEST = 5  # samples of a fall
# of level and size over the fall, and of frequency, instant and decay over its length
_LOWEST, _HIGHEST = [0.0, 0.2, 1.0, -0.5, -3.0], [1.0, 2.0, 6.0, 0.5, 3.0]


class Shape(NamedTuple):
    """The mean fall of several slips."""

    force_N: float  # of sliding
    omega_rad_per_s: float  # of the slide on the drive's spring
    decay_per_s: float
    found: tuple[float, ...]  # from which another fit begins

    def level_of_ends(self) -> float:
        """Where the level lies between the lower and the upper end of a swing with this decay, at rest at both; 0.5 without."""
        return 1.0 / (1.0 + math.exp(math.pi * self.decay_per_s / self.omega_rad_per_s))


class StackedFalls(NamedTuple):
    """All whole falls of a part laid over each other: samples [n] and the number of their slip [n]."""

    since_s: Floats  # since half of the fall was done
    force_N: Floats
    slip: npt.NDArray[np.int64]
    slips: int
    length_s: float  # of the usual fall, from breakaway to re-stick
    top_N: float  # mean
    bottom_N: float
    step_s: float

    def without(self, group: npt.NDArray[np.int64]) -> "StackedFalls":
        """Those that do not belong to some slips."""
        kept = ~np.isin(self.slip, group)
        return self._replace(since_s=self.since_s[kept], force_N=self.force_N[kept], slip=self.slip[kept])


def falls_of(slips: RecordSlips, top_N: float, bottom_N: float) -> StackedFalls | None:
    """The falls of a part, whose mean forces at breakaway and re-stick are known; None where they are too quick to be seen."""
    part, tops, bottoms = slips.part, slips.tops, slips.bottoms
    whole = min(len(tops), len(bottoms))
    lengths = bottoms[:whole] - tops[:whole]
    if not whole or float(np.median(lengths)) < _FEWEST:
        return None
    usual = float(np.median(lengths))
    good = np.flatnonzero((lengths > 0.5 * usual) & (lengths < 2.0 * usual))
    every = max(1, int(usual * len(good) / _MOST_SAMPLES))
    since: list[Floats] = []
    force: list[Floats] = []
    number: list[npt.NDArray[np.int64]] = []
    for count, i in enumerate(good.tolist()):
        top, bottom = int(tops[i]), int(bottoms[i])
        middle = half_done(part.force_N, top, bottom, slips.width)
        first, last = max(int(middle - 0.5 * usual), 0), min(int(middle + 0.5 * usual) + 1, len(part.force_N))
        at = np.arange(first + count % every, last, every)
        since.append(((at - middle) * part.step_s).astype(np.float64))
        force.append(part.force_N[at])
        number.append(np.full(len(at), count, np.int64))
    return StackedFalls(
        np.concatenate(since), np.concatenate(force), np.concatenate(number), len(good), usual * part.step_s, top_N, bottom_N,
        part.step_s,
    )  # fmt: skip


def half_done(force_N: Floats, top: int, bottom: int, width: int) -> float:
    """The instant, in samples, at which half of a fall is done, from a line through the samples around it."""
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


def fit_from_rest(falls: StackedFalls, near: Shape | None = None, first: float = FIRST) -> Shape | None:
    """The swing with a decay that begins at rest at the mean breakaway and ends at rest at the mean re-stick; None: no fit.

    These ends tie the level and the size to the decay, which is seen through more noise then. Friction that falls slowly after
    the breakaway does not swing from rest, and gives no decay here or one below 0.
    """
    t, y = _inside(falls, first)

    def rest(p: Floats) -> Floats:
        ratio, w, middle = p
        level = 1.0 / (1.0 + math.exp(math.pi * ratio))
        phase = w * (t - middle) + 0.5 * math.pi
        return level + (1.0 - level) * np.exp(-ratio * phase) * (np.cos(phase) + ratio * np.sin(phase)) - y

    if len(t) < 6:
        return None
    start = list(near.found) if near is not None else [0.05, math.pi, 0.0]
    ends = [-0.5, 1.0, -0.5], [1.5, 6.0, 0.5]
    fitted = least_squares(rest, start, bounds=ends, x_scale=[0.1, 1.0, 0.1], xtol=1e-6, ftol=1e-8)
    ratio, w, _ = (float(parameter) for parameter in fitted.x)
    level = 1.0 / (1.0 + math.exp(math.pi * ratio))
    force_N = falls.bottom_N + (falls.top_N - falls.bottom_N) * level
    return Shape(force_N, w / falls.length_s, ratio * w / falls.length_s, tuple(fitted.x)) if fitted.success else None


def _inside(falls: StackedFalls, first: float) -> tuple[Floats, Floats]:
    """Times over the length of a fall and forces over its height, without a share `first` of the height at either end."""
    reach_s = math.acos(1.0 - 2.0 * first) / math.pi  # of the fall before its ends
    inside = np.abs(falls.since_s) < (0.5 - reach_s) * falls.length_s
    drop_N = falls.top_N - falls.bottom_N
    return falls.since_s[inside] / falls.length_s, (falls.force_N[inside] - falls.bottom_N) / drop_N


def fit_shape(falls: StackedFalls, damped: bool, near: Shape | None = None, first: float = FIRST) -> Shape | None:
    """The swing in all falls, with a decay or without, fitted from the shape `near`; None where it does not fit.

    `first`: share of the fall at either end that is not fitted.
    """
    drop_N, length_s = falls.top_N - falls.bottom_N, falls.length_s
    if drop_N <= 0.0:
        return None
    t, y = _inside(falls, first)
    count = 5 if damped else 4
    if len(t) < 2 * count:
        return None

    def rest(p: Floats) -> Floats:
        level, size, w, middle = p[:4]
        decay = p[4] if damped else 0.0
        u = t - middle
        return level - size * np.exp(-decay * u) * np.sin(w * u) - y

    start = list(near.found) if near is not None else [0.5, 0.5, math.pi, 0.0, 0.0][:count]
    scale = [0.1, 0.1, 1.0, 0.1, 1.0][:count]
    fitted = least_squares(rest, start, bounds=(_LOWEST[:count], _HIGHEST[:count]), x_scale=scale, xtol=1e-6, ftol=1e-8)
    level, size, w = (float(parameter) for parameter in fitted.x[:3])
    decay = float(fitted.x[4]) if damped else 0.0
    sound = fitted.success and size > 0.0 and 0.05 < level < 0.95
    parameters = tuple(float(parameter) for parameter in fitted.x)
    return Shape(falls.bottom_N + drop_N * level, w / length_s, decay / length_s, parameters) if sound else None
