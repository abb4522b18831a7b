"""Durations of slip and stick, and the force at breakaway, from all slips of a part laid over each other.

The largest of noisy samples lies somewhere on the end of the flat climb, so slips that are timed one by one are too long. The
mean course of many falls has little noise, so parabolas through few of its samples find its top and its bottom.
"""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.look.numbers import Number, groups_of, jackknifed, mean_of
from diagnosis.look.slips import RecordSlips, smoothed

_FEWEST_SLIPS, _FEWEST_SAMPLES = 3, 5  # fewest slips, and fewest samples of a fall
_BINS = 100  # bins in a fall
_REACH = 0.9  # top and bottom are searched in this share of a fall before and after its middle
# Smallest and largest half span of a parabola, in falls; between them the span reduces noise to the third share of the fall.
_LEAST, _MOST, _NOISE = 0.06, 0.2, 0.002
_LEAST_SAMPLES = 1.5  # smallest half span in samples: a span holds three samples of each slip
_RIDGE = 1e-9  # regularises spans with fewer than three instants, as where all slips are sampled at the same instants
_FEWEST_TOPS = 4  # fewest tops: two for each half
_SMOOTHED = 3  # smallest width of the smoothing [samples]: with less, falls have too few samples to be overlaid
_STAYS = 0.5  # share of the correction by which the interval is widened
_OF_LARGEST = 2.0  # bias of the largest of some samples, in standard deviations of the noise
_BEYOND = 2  # margin on either side of the searched stretch, in widths of the smoothing


def with_slip_times(numbers: dict[str, Number], slips_of_parts: list[RecordSlips]) -> dict[str, Number]:
    """Numbers with `slip_s` and `dwell_s` from the mean fall of the part with most slips, if it has slips and samples enough.

    A fall with few samples lies between the sample before and the sample after it: its interval is widened by two steps.
    """
    if "slip_s" not in numbers:
        return numbers
    slip, dwell = numbers["slip_s"], numbers.get("dwell_s")
    seen = [falls for falls in map(_falls_of, slips_of_parts) if falls is not None]
    if seen:
        mean = max(seen, key=lambda falls: falls.slips).slip_time()
        if dwell is not None:  # a slip that is shorter leaves more time to the stick
            more_s = slip.value - mean.value
            dwell = Number(dwell.value + more_s, dwell.low + more_s, dwell.high + more_s, "s")
            dwell = dwell.wider(mean.high - mean.value)
        slip = mean
    else:
        steps_s = 2.0 * max(slips.part.step_s for slips in slips_of_parts)
        slip = slip._replace(low=max(min(slip.low, slip.value - steps_s), 0.0))
        if dwell is not None:
            dwell = dwell._replace(high=max(dwell.high, dwell.value + steps_s))
    return numbers | {"slip_s": slip} | ({"dwell_s": dwell} if dwell is not None else {})


class _Falls(NamedTuple):
    """Samples of all falls by the time since their middle: their number and the sum of their forces, [groups of slips, bins]."""

    counts: Floats
    sums: Floats
    slips: int
    half_bins: int  # half span of a parabola [bins]
    bin_s: float
    step_s: float

    def slip_time(self) -> Number:
        """Time from the top of the mean course to its bottom; the error of each is half the span of a parabola."""
        counts, sums = self.counts.sum(axis=0), self.sums.sum(axis=0)
        duration_s = self._duration_s(counts, sums)
        without = [self._duration_s(counts - c, sums - s) for c, s in zip(self.counts, self.sums, strict=True)]
        sampled_s = 1.645 * self.step_s / math.sqrt(6.0)  # each end lies between two samples
        return jackknifed(duration_s, without, "s").wider(math.hypot(sampled_s, self.half_bins * self.bin_s))

    def _duration_s(self, counts: Floats, sums: Floats) -> float:
        course = _smooth(counts, sums, self.half_bins)
        middle = len(course) // 2
        reach = int(_REACH * _BINS)
        before, after = course[middle - reach : middle + 1], course[middle : middle + reach + 1]
        return self.bin_s * float(reach - np.nanargmax(before) + np.nanargmin(after))


def _falls_of(slips: RecordSlips) -> _Falls | None:
    """The falls of a part; None for too few slips or samples."""
    part, (tops, bottoms) = slips.part, slips.falls
    if len(tops) < _FEWEST_SLIPS or float(np.median(bottoms - tops)) < _FEWEST_SAMPLES:
        return None
    usual = float(np.median(bottoms - tops))
    middles = slips.middles(tops, bottoms)
    reach = int((_REACH + _MOST) * usual) + 2
    at = np.round(middles).astype(np.int64)[:, None] + np.arange(-reach, reach + 1)
    inside = (at[:, 0] >= 0) & (at[:, -1] < len(part.force_N))
    at, middles = at[inside], middles[inside]
    if len(at) < _FEWEST_SLIPS:
        return None
    drop_N = float((part.force_N[tops] - part.force_N[bottoms]).mean())
    needed = (part.noise_N / (_NOISE * max(drop_N, 1e-300))) ** 2
    half = max(_LEAST * usual, _LEAST_SAMPLES, min(needed / (2.0 * len(at)), _MOST * usual))
    each_side = math.ceil((reach + 1) * _BINS / usual)
    number = np.round((at - middles[:, None]) * _BINS / usual).astype(np.int64) + each_side
    groups = groups_of(len(at))
    counts, sums = np.zeros((2, len(groups), 2 * each_side + 1))
    for row, group in enumerate(groups):
        np.add.at(counts[row], number[group], 1.0)
        np.add.at(sums[row], number[group], part.force_N[at[group]])
    step_s = part.step_s
    return _Falls(counts, sums, len(at), math.ceil(half * _BINS / usual), usual / _BINS * step_s, step_s)


def _smooth(counts: Floats, sums: Floats, half_bins: int) -> Floats:
    """The value in each bin of a parabola through the samples around it, [bins]; NaN without a sample in its span.

    Weights fall to zero at the ends of the span (W. Cleveland, Robust locally weighted regression, 1979).
    """
    x = np.arange(-half_bins, half_bins + 1) / (half_bins + 1)
    weight = (1.0 - x**2) ** 2
    moments = np.array([np.convolve(counts, (weight * x**k)[::-1], "same") for k in range(5)])
    sides = np.array([np.convolve(sums, (weight * x**k)[::-1], "same") for k in range(3)])
    i, k = np.indices((3, 3))
    matrices = moments[i + k].transpose(2, 0, 1)
    near = moments[0] > 0.0
    matrices[near] += _RIDGE * moments[0][near][:, None, None] * np.eye(3)
    course = np.full(len(counts), np.nan)
    course[near] = np.linalg.solve(matrices[near], sides.T[near][:, :, None])[:, 0, 0]
    return course


def breakaway_of(slips_of_parts: list[RecordSlips], each: Number) -> Number:
    """The mean force at breakaway over all parts.

    The largest of noisy samples is too large, and a top that is smoothed, or found in noise, is too low. The mean of many tops
    has little noise, so its maximum is located well; one half of the slips locates it, and the other half measures the force
    there. A second smoothing cuts off as much of a top as the first (Tukey, Exploratory data analysis, 1977: twicing).

    Args:
        slips_of_parts: slips of each part.
        each: the mean of the tops located one by one; returned where there are too few slips or samples, and where the falls
            differ so much that the mean of the overlaid tops is lower by more than noise.

    """
    tops = [top for top in map(_tops_of, slips_of_parts) if top is not None]
    if not tops:
        return each
    cut_N = _STAYS * abs(float(np.concatenate([cut_N for _, cut_N in tops]).mean()))
    laid = mean_of(np.concatenate([top_N for top_N, _ in tops]), each.unit, cut_N)
    if laid is None:
        return each
    noise_N = _OF_LARGEST * max(slips.part.noise_N for slips in slips_of_parts)
    return each if each.low - laid.high > noise_N else laid


def _tops_of(slips: RecordSlips) -> tuple[Floats, Floats] | None:
    """Force at each breakaway, and the part of it that smoothing cuts off; None with too few slips or samples.

    [slips - 1], as the first stick is not recorded.
    """
    force_N, width = slips.part.force_N, slips.width | 1
    tops, bottoms = (ends[1:] for ends in slips.falls)
    if len(tops) < _FEWEST_TOPS or width < _SMOOTHED:
        return None
    middles = slips.middles(tops, bottoms)
    usual = float(np.median(bottoms - tops))
    before = int(max(0.5 * usual, _BEYOND * width)) + _BEYOND * width
    around = np.arange(-before, before - int(0.25 * usual) + 1)
    at = (middles - np.round(np.median(middles - tops)))[:, None] + around
    at = at[(at[:, 0] >= 0) & (at[:, -1] <= len(force_N) - 1)]
    if len(at) < _FEWEST_TOPS:
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
    return top_N, cut_N
