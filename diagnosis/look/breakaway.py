"""The mean force at breakaway, from all tops of a record laid over each other.

The largest of noisy samples is too large, and a top that is smoothed, or found in noise, is too low. The mean of many tops has
little noise, so that a place on it is found well; one half of the slips finds the place, and the other half measures it.
What a smoothing cuts off a top is what a second one cuts off again (Tukey, Exploratory data analysis, 1977: twicing).
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.look.numbers import Number, mean_of
from diagnosis.look.record import smoothed
from diagnosis.look.slip_shape import half_done
from diagnosis.look.slips import Slips

Floats = npt.NDArray[np.float64]
_FEWEST = 4  # tops: two for each half
_SMOOTHED = 3  # samples of a smoothing from which the falls have samples enough to be laid over each other
_STAYS = 0.5  # share of what is mended that may stay
_OF_LARGEST = 2.0  # standard deviations of noise that the largest of some samples is too large by
_BEYOND = 2  # widths of the smoothing, beside the place that is looked for


class _Tops(NamedTuple):
    """Force at breakaway of each slip but the first, whose stick is not seen, [slips - 1]; and what the smoothing took."""

    force_N: Floats
    cut_N: Floats


def breakaway_of(found: list[Slips], each: Number) -> Number:
    """The mean force at breakaway over all parts.

    Args:
        found: slips of each part.
        each: the mean of the tops that are found one by one; it stands where there are too few slips or samples, and where the
            falls are so unlike that tops laid over each other are surely lower.

    """
    tops = [one for one in map(_tops_of, found) if one is not None]
    if not tops:
        return each
    cut_N = _STAYS * abs(float(np.concatenate([one.cut_N for one in tops]).mean()))
    laid = mean_of(np.concatenate([one.force_N for one in tops]), each.unit, cut_N)
    if laid is None:
        return each
    noise_N = _OF_LARGEST * max(slips.part.noise_N for slips in found)
    return each if each.low - laid.high > noise_N else laid


def _tops_of(slips: Slips) -> _Tops | None:
    """The tops of a part; None for too few."""
    force_N, width = slips.part.force_N, slips.width | 1
    whole = min(len(slips.tops), len(slips.bottoms))
    tops, bottoms = slips.tops[1:whole], slips.bottoms[1:whole]
    if len(tops) < _FEWEST or width < _SMOOTHED:
        return None
    middles = np.array([half_done(force_N, int(a), int(b), slips.width) for a, b in zip(tops, bottoms, strict=True)])
    usual = float(np.median(bottoms - tops))
    before = int(max(0.5 * usual, _BEYOND * width)) + _BEYOND * width
    around = np.arange(-before, before - int(0.25 * usual) + 1)
    at = (middles - np.round(np.median(middles - tops)))[:, None] + around
    at = at[(at[:, 0] >= 0) & (at[:, -1] <= len(force_N) - 1)]
    if len(at) < _FEWEST:
        return None
    once = np.array([smoothed(one, width) for one in np.interp(at, np.arange(len(force_N)), force_N)])
    twice = np.array([smoothed(one, width) for one in once])
    inner = slice(_BEYOND * width, -_BEYOND * width)
    cut_N = np.empty(len(at))
    top_N = np.empty(len(at))
    for half in (0, 1):
        own, other = slice(half, None, 2), slice(1 - half, None, 2)
        of_once, of_twice = (
            _BEYOND * width + int(np.argmax(courses[other].mean(axis=0)[inner])) for courses in (once, twice)
        )
        cut_N[own] = once[own, of_once] - twice[own, of_twice]
        top_N[own] = once[own, of_once] + cut_N[own]
    return _Tops(top_N, cut_N)
