"""Durations of slip and stick, from all falls of a part laid over each other.

The largest of noisy samples lies somewhere on the end of the flat climb, so slips that are timed one by one are too long. The
mean course of many falls has little noise, so parabolas through few of its samples find its top and its bottom.
"""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.look.numbers import Number, groups_of, jackknifed
from diagnosis.look.slips import RecordSlips

_FEWEST_SLIPS, _FEWEST_SAMPLES = 3, 5  # fewest slips, and fewest samples of a fall
_BINS = 100  # bins in a fall
_REACH = 0.9  # top and bottom are searched in this share of a fall before and after its middle
# Smallest and largest half span of a parabola, in falls; between them the span reduces noise to the third share of the fall.
_LEAST, _MOST, _NOISE = 0.06, 0.2, 0.002
_LEAST_SAMPLES = 1.5  # smallest half span in samples: a span holds three samples of each slip
_RIDGE = 1e-9  # regularises spans with fewer than three instants, as where all slips are sampled at the same instants


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
