"""The mean force at breakaway, from all tops of a record laid over each other.

The largest of noisy samples is too large, and a top that is smoothed, or found in noise, is too low. The mean of many tops has
little noise, so its maximum is located well; one half of the slips locates it, and the other half measures the force there.
A second smoothing cuts off as much of a top as the first (Tukey, Exploratory data analysis, 1977: twicing).
"""

from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.look.numbers import Number, mean_of
from diagnosis.look.record import smoothed
from diagnosis.look.slips import RecordSlips

_FEWEST = 4  # fewest tops: two for each half
_SMOOTHED = 3  # smallest width of the smoothing [samples]: with less, falls have too few samples to be overlaid
_STAYS = 0.5  # share of the correction by which the interval is widened
_OF_LARGEST = 2.0  # bias of the largest of some samples, in standard deviations of the noise
_BEYOND = 2  # margin on either side of the searched stretch, in widths of the smoothing


class _Tops(NamedTuple):
    """Force at breakaway, and the part of it that smoothing cuts off; [slips - 1], as the first stick is not recorded."""

    force_N: Floats
    cut_N: Floats


def breakaway_of(slips_of_parts: list[RecordSlips], each: Number) -> Number:
    """The mean force at breakaway over all parts.

    Args:
        slips_of_parts: slips of each part.
        each: the mean of the tops located one by one; returned where there are too few slips or samples, and where the falls
            differ so much that the mean of the overlaid tops is lower by more than noise.

    """
    tops = [top for top in map(_tops_of, slips_of_parts) if top is not None]
    if not tops:
        return each
    cut_N = _STAYS * abs(float(np.concatenate([top.cut_N for top in tops]).mean()))
    laid = mean_of(np.concatenate([top.force_N for top in tops]), each.unit, cut_N)
    if laid is None:
        return each
    noise_N = _OF_LARGEST * max(slips.part.noise_N for slips in slips_of_parts)
    return each if each.low - laid.high > noise_N else laid


def _tops_of(slips: RecordSlips) -> _Tops | None:
    """The tops of a part; None with too few slips or samples."""
    force_N, width = slips.part.force_N, slips.width | 1
    tops, bottoms = (ends[1:] for ends in slips.falls)
    if len(tops) < _FEWEST or width < _SMOOTHED:
        return None
    middles = slips.middles(tops, bottoms)
    usual = float(np.median(bottoms - tops))
    before = int(max(0.5 * usual, _BEYOND * width)) + _BEYOND * width
    around = np.arange(-before, before - int(0.25 * usual) + 1)
    at = (middles - np.round(np.median(middles - tops)))[:, None] + around
    at = at[(at[:, 0] >= 0) & (at[:, -1] <= len(force_N) - 1)]
    if len(at) < _FEWEST:
        return None
    once = np.array([smoothed(course, width) for course in np.interp(at, np.arange(len(force_N)), force_N)])
    twice = np.array([smoothed(course, width) for course in once])
    inner = slice(_BEYOND * width, -_BEYOND * width)
    cut_N = np.empty(len(at))
    top_N = np.empty(len(at))
    for half in (0, 1):
        measured, locating = slice(half, None, 2), slice(1 - half, None, 2)
        of_once, of_twice = (
            _BEYOND * width + int(np.argmax(courses[locating].mean(axis=0)[inner])) for courses in (once, twice)
        )
        cut_N[measured] = once[measured, of_once] - twice[measured, of_twice]
        top_N[measured] = once[measured, of_once] + cut_N[measured]
    return _Tops(top_N, cut_N)
