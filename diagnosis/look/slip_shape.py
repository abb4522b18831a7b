"""Sliding friction and frequency of the swing, from all falls of a record laid over each other.

While the slide slips, m x'' = F - F_k and F = k (s - x), so F = F_k + A cos(w t + phase): the middle of the fall lies at F_k, for
any start and end of the slip. Damping lets it decay.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from bridge.arrays import Floats
from diagnosis.look.numbers import groups_of, jackknifed
from diagnosis.look.slips import RecordSlips

# Share of the fall at either end that is not fitted: it belongs to breakaway and re-stick. A second fit with the smaller share
# shows the influence of this choice.
_FIRST, _LESS = 0.12, 0.06
_MOST_SAMPLES = 4000  # most samples that are fitted
_FEWEST = 5  # fewest samples of a fall
# Lower bounds, upper bounds and scales of the fits. _EVEN: level and size as shares of the fall, angular frequency and instant
# in lengths of the fall. _DECAYING: decay over frequency, frequency, instant.
_EVEN = [0.0, 0.2, 1.0, -0.5], [1.0, 2.0, 6.0, 0.5], [0.1, 0.1, 1.0, 0.1]
_DECAYING = [-0.5, 1.0, -0.5], [1.5, 6.0, 0.5], [0.1, 1.0, 0.1]
# Smallest decay, as a share of the frequency and in half intervals of 90 %. On 127 rigs creep and slowly falling friction looked
# like a decay of up to 0.041.
_LEAST_DECAY, _SURE = 0.05, 1.6
_FEWEST_FOR_SCATTER = 3


class Shape(NamedTuple):
    """The mean fall of several slips."""

    force_N: float  # sliding friction
    omega_rad_per_s: float  # angular frequency of the slide on the drive's spring
    ratio: float  # decay over frequency
    parameters: tuple[float, ...]  # solution of the fit; start of the fits of subsets
    is_swing: bool = True  # False: no decay fits, as where friction and not the mass sets the speed of the fall


class StackedFalls(NamedTuple):
    """All whole falls of a part laid over each other: samples [n] and the number of their slip [n]."""

    since_s: Floats  # time since half of the fall
    force_N: Floats
    slip: npt.NDArray[np.int64]
    slips: int
    length_s: float  # median duration of a fall, from breakaway to re-stick
    top_N: float  # mean force at breakaway
    bottom_N: float  # mean force at re-stick

    def without(self, group: npt.NDArray[np.int64]) -> "StackedFalls":
        """The samples that do not belong to a group of slips."""
        kept = ~np.isin(self.slip, group)
        return self._replace(since_s=self.since_s[kept], force_N=self.force_N[kept], slip=self.slip[kept])


def falls_of(slips: RecordSlips, top_N: float, bottom_N: float) -> StackedFalls | None:
    """The falls of a part; None where they have too few samples. `top_N`, `bottom_N`: mean forces at breakaway and re-stick."""
    part, (tops, bottoms) = slips.part, slips.falls
    lengths = bottoms - tops
    if not len(lengths) or float(np.median(lengths)) < _FEWEST:
        return None
    usual = float(np.median(lengths))
    good = (lengths > 0.5 * usual) & (lengths < 2.0 * usual)
    middles = slips.middles(tops[good], bottoms[good])
    reach = math.ceil(0.5 * usual)
    at = middles.astype(np.int64)[:, None] + np.arange(-reach, reach + 1)
    every = max(1, int(usual * len(middles) / _MOST_SAMPLES))
    kept = (
        (at >= 0) & (at < len(part.force_N)) & ((np.arange(2 * reach + 1) - np.arange(len(at))[:, None]) % every == 0)
    )
    since_s, number = (at - middles[:, None]) * part.step_s, np.nonzero(kept)[0]
    return StackedFalls(
        since_s[kept], part.force_N[at[kept]], number, len(middles), usual * part.step_s, top_N, bottom_N
    )


def shape_of(falls: StackedFalls) -> tuple[Shape | None, list[Shape], Shape | None]:
    """The swing, the swings without one group of falls each, and an alternative that may be as good; None: no fit.

    The swing decays where the falls show a decay beyond its interval. Then the alternative is the swing without a decay, as
    slowly falling friction and a creeping contact bend a fall alike; else it is the swing of a longer part of the falls.
    """
    groups = groups_of(falls.slips) if falls.slips >= _FEWEST_FOR_SCATTER else []

    def fitted(fit: Callable[[StackedFalls, Shape | None], Shape | None]) -> tuple[Shape | None, list[Shape]]:
        shape = fit(falls, None)
        partials = [fit(falls.without(group), shape) for group in groups] if shape is not None else []
        return shape, [partial for partial in partials if partial is not None]

    (even, even_partials), (decaying, partials) = fitted(_even), fitted(_decaying)
    if even is None:
        return None, [], None
    if decaying is not None and len(partials) >= _FEWEST_FOR_SCATTER and decaying.ratio > _LEAST_DECAY:
        ratio = jackknifed(decaying.ratio, [partial.ratio for partial in partials], "1")
        if ratio.value > _SURE * (ratio.high - ratio.value):
            return decaying, partials, even
    return even._replace(is_swing=decaying is not None), even_partials, _even(falls, even, _LESS)


def hidden_by_damping_N(falls: StackedFalls, shape: Shape) -> float:
    """By how much the sliding friction may be lower than the middle of a fall: a decay below `_LEAST_DECAY` is not seen."""
    return 0.0 if shape.ratio else (0.5 - _level(_LEAST_DECAY)) * (falls.top_N - falls.bottom_N)


def _decaying(falls: StackedFalls, near: Shape | None) -> Shape | None:
    """The swing with a decay that begins at rest at the mean breakaway and ends at rest at the mean re-stick; None: no fit.

    With these ends the decay alone determines level and size, so it can be estimated in more noise.
    """

    def swing(t: Floats, ratio: float, w: float, middle: float) -> Floats:
        level = _level(ratio)
        phase = w * (t - middle) + 0.5 * math.pi
        return level + (1.0 - level) * np.exp(-ratio * phase) * (np.cos(phase) + ratio * np.sin(phase))

    fitted = _fitted(falls, swing, [0.05, math.pi, 0.0], _DECAYING, near, _FIRST)
    if fitted is None or fitted.active_mask.any():  # a parameter at its bound is not determined by the falls
        return None
    ratio, w, _ = fitted.x.tolist()
    return _shape(falls, _level(ratio), w, ratio, fitted)


def _level(ratio: float) -> float:
    """Level between the lower (0) and upper (1) end of a decaying swing that is at rest at both; 0.5 without a decay."""
    return 1.0 / (1.0 + math.exp(math.pi * ratio))


def _even(falls: StackedFalls, near: Shape | None, first: float = _FIRST) -> Shape | None:
    """The swing without a decay; None where it does not fit. `first`: share of the fall at either end that is not fitted."""

    def swing(t: Floats, level: float, size: float, w: float, middle: float) -> Floats:
        return level - size * np.sin(w * (t - middle))

    fitted = _fitted(falls, swing, [0.5, 0.5, math.pi, 0.0], _EVEN, near, first)
    if fitted is None or not 0.05 < fitted.x[0] < 0.95:
        return None
    return _shape(falls, float(fitted.x[0]), float(fitted.x[2]), 0.0, fitted)


def _fitted(
    falls: StackedFalls,
    swing: Callable[..., Floats],
    start: Sequence[float],
    bounds: Any,
    near: Shape | None,
    first: float,
) -> Any:
    """SciPy's fit of a swing to the falls; None without a fit."""
    drop_N = falls.top_N - falls.bottom_N
    if drop_N <= 0.0:
        return None
    margin = math.acos(1.0 - 2.0 * first) / math.pi  # share of the fall's duration at either end
    inside = np.abs(falls.since_s) < (0.5 - margin) * falls.length_s
    t, y = falls.since_s[inside] / falls.length_s, (falls.force_N[inside] - falls.bottom_N) / drop_N
    if len(t) < 2 * len(start):
        return None

    def residual(p: Floats) -> Floats:
        return swing(t, *p) - y

    begin = start if near is None else near.parameters
    fitted = least_squares(residual, begin, bounds=bounds[:2], x_scale=bounds[2], xtol=1e-6, ftol=1e-8)
    return fitted if fitted.success else None


def _shape(falls: StackedFalls, level: float, w: float, ratio: float, fitted: Any) -> Shape:
    force_N = falls.bottom_N + (falls.top_N - falls.bottom_N) * level
    return Shape(force_N, w / falls.length_s, ratio, tuple(fitted.x.tolist()))
