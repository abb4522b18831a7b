"""Range, clipping and dead stretches of a signal, found piece by piece with a memory of a few numbers."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats

# A clipped signal meets its limit at full slope; a real peak slows down. A parabola that leaves a run of L equal samples with the
# slope s would rise by s L / 4 above them. A signal is clipped if this rise exceeds the following share of its range.
# Smaller: round peaks count as clipped; larger: flat clipping passes.
_OVERSHOOT_SHARE = 1e-3
_LONGEST_DWELL = 40.0  # a position may rest at an end: at most so many samples of a run count for its overshoot
_SHORTEST_RUN = 3.0  # fewest equal samples at the limit that count; noise alone rarely makes three
_STEPS_OF_RESOLUTION = 2.5  # smallest step into and out of a clipped run, in resolutions; real peaks have 1 or 2


class SignalLook(NamedTuple):
    """Range and faults of one signal; the extremes in its unit, all other numbers in samples."""

    samples: int
    lowest: float
    highest: float
    not_finite: int
    first_not_finite: int  # index of the sample; -1: none
    clipped_high: int  # samples at the upper limit; 0: not clipped there
    clipped_low: int
    longest_run: int  # length of the longest run of equal samples
    longest_run_end: int  # index of the last sample of that run
    at_highest: int  # samples equal to the largest; many of them on a noisy signal mean clipping
    at_lowest: int

    @property
    def constant(self) -> bool:
        """Whether all finite samples, at least two, are equal."""
        return self.samples - self.not_finite > 1 and self.lowest == self.highest


class _Side:
    """The runs of equal samples at one extreme of a signal; the lower extreme is handled on the mirrored signal."""

    def __init__(self, longest: float) -> None:
        self.extreme = -math.inf
        self.at_extreme = 0  # number of samples equal to the extreme
        self._longest = longest
        self._runs = self._overshoot = 0.0  # samples in runs that count; their largest overshoot
        # the first run of the signal: its length, and the step out of it
        self._first: tuple[float, float] | None = None

    def add(self, values: Floats, ended: Floats, lengths: Floats, steps: Floats, resolution: float) -> None:
        """Add finite samples, at least one, and the runs that ended with them.

        `ended`: their values; `lengths`; `steps` into each and out of the last; `resolution`: the smallest step so far.
        """
        highest = float(values.max())
        if highest > self.extreme:
            self.extreme, self.at_extreme, self._first = highest, 0, None
            self._runs = self._overshoot = 0.0
        if highest == self.extreme:
            self.at_extreme += int(np.count_nonzero(values == highest))
        # shorter runs do not count, and a channel that rests at its end has thousands
        for run in np.flatnonzero((ended == self.extreme) & (lengths >= _SHORTEST_RUN)).tolist():
            length, step_in, step_out = float(lengths[run]), float(steps[run]), float(steps[run + 1])
            if math.isinf(step_in):
                # at the beginning the resolution is not known yet: the run is judged when the signal has ended
                self._first = length, step_out
            else:
                self._count(length, min(step_in, step_out), min(length, self._longest), resolution)

    def _count(self, length: float, step: float, flank: float, resolution: float) -> None:
        """Count a run if it is long and its step is large enough."""
        if length >= _SHORTEST_RUN and step >= _STEPS_OF_RESOLUTION * resolution:
            if math.isfinite(step):
                self._overshoot = max(self._overshoot, step * flank / 4.0)
            self._runs += length

    def clipped(self, last: tuple[float, float, float], resolution: float, limit: float, begins: bool) -> int:
        """Number of samples in runs at the extreme; `begins`: whether the first run of the signal counts.

        The first and the `last` run (value, length, step into it) have one flank, and are counted by its step alone.
        """
        runs, overshoot = self._runs, self._overshoot
        if last[0] == self.extreme:
            self._count(*last[1:], 4.0, resolution)
        if begins and self._first is not None:
            self._count(*self._first, 4.0, resolution)
        result = int(self._runs) if self._overshoot > limit else 0
        self._runs, self._overshoot = runs, overshoot  # restored: the signal may go on
        return result


class CheckedSignal:
    """A signal that is checked piece by piece; a signal that `dwells`, such as a position, may rest at its extremes."""

    def __init__(self, dwells: bool) -> None:
        self._dwells = dwells
        longest = _LONGEST_DWELL if dwells else math.inf
        self._sides = _Side(longest), _Side(longest)  # the top, and mirrored the bottom
        self._samples = self._not_finite = 0
        self._first_not_finite = -1
        self._last = math.nan, 0.0, math.inf  # the run that has not ended: value, length, step into it
        self._resolution = math.inf
        self._longest_run = self._longest_run_end = 0

    def add(self, values: npt.NDArray[Any]) -> None:
        """Check the next samples, [samples]."""
        at, places = self._samples, None  # places: indices of the finite samples, if not all are
        self._samples += len(values)
        finite = np.isfinite(values)
        if not finite.all():
            self._not_finite += int(np.count_nonzero(~finite))
            if self._first_not_finite < 0:
                self._first_not_finite = at + int(np.argmin(finite))
            places = np.flatnonzero(finite)
            values = values[places]
        if not len(values):
            return
        value, length, step_in = self._last
        begins = np.flatnonzero(np.diff(values, prepend=values.dtype.type(value)) != 0.0)
        ends = np.append(begins, len(values))
        runs, lengths = np.append(value, values[begins]), np.diff(ends, prepend=-length)
        steps = np.append(step_in, np.abs(np.diff(runs)))
        if not length:  # no run came before
            runs, lengths, ends, steps = runs[1:], lengths[1:], ends[1:], np.append(math.inf, steps[2:])
        self._resolution = min(self._resolution, float(steps[1:].min(initial=math.inf)))
        longest = int(np.argmax(lengths))
        if lengths[longest] > self._longest_run:
            end = int(ends[longest]) - 1
            self._longest_run = int(lengths[longest])
            self._longest_run_end = at + int(end if places is None else places[end])
        self._sides[0].add(values, runs[:-1], lengths[:-1], steps, self._resolution)
        self._sides[1].add(-values, -runs[:-1], lengths[:-1], steps, self._resolution)
        self._last = float(runs[-1]), float(lengths[-1]), float(steps[-1])

    def result(self) -> SignalLook:
        """Range and faults of all samples so far."""
        high, low = self._sides[0].extreme, -self._sides[1].extreme
        limit = max(_OVERSHOOT_SHARE * (high - low), 0.0)
        value, length, step_in = self._last
        # a position rests before it moves, so its first run is not clipping; a unipolar sensor at rest clips its noise at 0: the
        # end of its scale, but no signal is lost
        clipped_high, clipped_low = (
            side.clipped((last, length, step_in), self._resolution, limit, begins=not self._dwells)
            if high > low and end
            else 0
            for side, last, end in zip(self._sides, (value, -value), (high, low), strict=True)
        )
        return SignalLook(
            *(self._samples, low, high, self._not_finite, self._first_not_finite, clipped_high, clipped_low),
            *(self._longest_run, self._longest_run_end, self._sides[0].at_extreme, self._sides[1].at_extreme),
        )


def look(values: npt.NDArray[Any], dwells: bool) -> SignalLook:
    """Range and faults of a whole signal, [samples]; see `CheckedSignal`."""
    signal = CheckedSignal(dwells)
    signal.add(values)
    return signal.result()
