"""Range, clipping and dead stretches of a signal, found piece by piece with a memory of a few numbers."""

import math
from copy import copy
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats

# A clipped signal meets its limit at full slope; a real peak slows down. A parabola that leaves a run of L equal samples with the
# slope s would rise by s L / 4 above them. A signal is clipped if this rise exceeds the following share of its range.
# Smaller: round peaks count as clipped; larger: flat clipping passes.
_OVERSHOOT_SHARE = 1e-3
_LONGEST_DWELL = 40.0  # most samples counted in a run of a position, which may rest at an end of its range
_SHORTEST_RUN = 3.0  # fewest equal samples at the limit that count; noise alone rarely makes three
_STEPS_OF_RESOLUTION = 2.5  # smallest step into a clipped run, in resolutions; a real peak ends in steps of 1 or 2


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
        self.runs = self.overshoot = 0.0  # samples in runs that count; the largest overshoot
        # the first run of the signal: its length, and the step out of it
        self.begin: tuple[float, float] | None = None
        # length of the run that has not ended, and the step into it
        self._open: tuple[float, float] | None = None

    def add(self, values: Floats, before: float | None, resolution: float) -> None:
        """Add finite samples, at least one; `before` is the sample before them, `resolution` the smallest step so far."""
        highest = float(values.max())
        if highest > self.extreme:
            self.extreme = highest
            self.at_extreme = 0
            self.runs = self.overshoot = 0.0
            self.begin = self._open = None
        elif highest < self.extreme:
            self.end_run(self.extreme - float(values[0]), resolution)
            return
        at = np.flatnonzero(values == self.extreme)
        self.at_extreme += len(at)
        if at[0] > 0:
            self.end_run(self.extreme - float(values[0]), resolution)
        apart = np.diff(at) > 1
        firsts, ends = at[np.concatenate([[True], apart])], at[np.concatenate([apart, [True]])] + 1
        # shorter runs do not count, and a channel that rests at its end has thousands; runs at the ends may go on in other pieces
        kept = (ends - firsts >= _SHORTEST_RUN) | (firsts == 0) | (ends == len(values))
        for first, end in zip(firsts[kept].tolist(), ends[kept].tolist(), strict=True):
            if first == 0 and self._open is not None:
                self._open = self._open[0] + end, self._open[1]
            else:
                last = before if first == 0 else float(values[first - 1])
                self._open = float(end - first), math.inf if last is None else self.extreme - last
            if end < len(values):
                self.end_run(self.extreme - float(values[end]), resolution)

    def end_run(self, step_out: float, resolution: float) -> None:
        """End the open run, if any, with this step."""
        if self._open is None:
            return
        (length, step_in), self._open = self._open, None
        # a run at the very beginning or end of the signal has one flank only, and is counted by its step alone
        if math.isinf(step_in) and math.isfinite(step_out):
            # at the beginning the resolution is not known yet: the run is judged when the signal has ended
            self.begin = length, step_out
            return
        one_flank = math.isinf(step_in) or math.isinf(step_out)
        self.count(length, min(step_in, step_out), 4.0 if one_flank else min(length, self._longest), resolution)

    def count(self, length: float, step: float, flank: float, resolution: float) -> None:
        """Count a run if it is long and its step is large enough."""
        if length >= _SHORTEST_RUN and step >= _STEPS_OF_RESOLUTION * resolution:
            if math.isfinite(step):
                self.overshoot = max(self.overshoot, step * flank / 4.0)
            self.runs += length

    def clipped(self, resolution: float, begins: bool, limit: float) -> int:
        """Number of samples in runs at the extreme; `begins`: whether the first run of the signal counts."""
        side = copy(self)
        side.end_run(math.inf, resolution)
        if begins and side.begin is not None:
            side.count(*side.begin, 4.0, resolution)
        return int(side.runs) if side.overshoot > limit else 0


class CheckedSignal:
    """A signal that is checked piece by piece; a signal that `dwells`, such as a position, may rest at its extremes."""

    def __init__(self, dwells: bool) -> None:
        self._dwells = dwells
        longest = _LONGEST_DWELL if dwells else math.inf
        self._sides = _Side(longest), _Side(longest)  # the top, and mirrored the bottom
        self._samples = self._not_finite = 0
        self._first_not_finite = -1
        self._last: float | None = None
        self._resolution = math.inf
        self._run = self._longest_run = self._longest_run_end = 0

    def add(self, values: npt.NDArray[Any]) -> None:
        """Check the next samples, [samples]."""
        at = self._samples
        self._samples += len(values)
        finite = np.isfinite(values)
        places: npt.NDArray[np.int64] | None = None
        if not finite.all():
            self._not_finite += int(np.count_nonzero(~finite))
            if self._first_not_finite < 0:
                self._first_not_finite = at + int(np.argmin(finite))
            places = np.flatnonzero(finite)
            values = values[places]
        if not len(values):
            return
        self._runs_of_equals(values, at, places)
        self._sides[0].add(values, self._last, self._resolution)
        self._sides[1].add(-values, None if self._last is None else -self._last, self._resolution)
        self._last = float(values[-1])

    def _runs_of_equals(self, values: Floats, at: int, places: npt.NDArray[np.int64] | None) -> None:
        """Update the longest run of equal samples and the smallest step; `places`: indices of finite samples, if not all are."""
        steps = np.abs(np.diff(values, prepend=values[:1] if self._last is None else values.dtype.type(self._last)))
        changes = np.flatnonzero(steps)
        if len(changes):
            self._resolution = min(self._resolution, float(steps[changes].min()))
        begins = changes if self._last is not None else np.concatenate([[0], changes])
        lengths = np.diff(begins, append=len(values))
        # number of samples that continue the last run of the previous piece
        before = int(begins[0]) if len(begins) else len(values)
        runs = np.concatenate([[self._run + before], lengths]) if self._last is not None else lengths
        ends = np.concatenate([[before], begins[1:], [len(values)]])[-len(runs) :] - 1
        longest = int(np.argmax(runs))
        if runs[longest] > self._longest_run:
            self._longest_run = int(runs[longest])
            end = int(ends[longest])
            self._longest_run_end = at + (end if places is None else int(places[end]))
        self._run = int(runs[-1])

    def result(self) -> SignalLook:
        """Range and faults of all samples so far."""
        high, low = self._sides[0].extreme, -self._sides[1].extreme
        limit = max(_OVERSHOOT_SHARE * (high - low), 0.0)
        # a position rests before it moves, so its first run is not clipping
        clipped = [side.clipped(self._resolution, not self._dwells, limit) if high > low else 0 for side in self._sides]
        # a unipolar sensor at rest clips its noise at 0: the end of its scale, but no signal is lost
        if low == 0.0:
            clipped[1] = 0
        if high == 0.0:
            clipped[0] = 0
        return SignalLook(
            self._samples,
            low,
            high,
            self._not_finite,
            self._first_not_finite,
            clipped[0],
            clipped[1],
            self._longest_run,
            self._longest_run_end,
            self._sides[0].at_extreme,
            self._sides[1].at_extreme,
        )


def look(values: npt.NDArray[Any], dwells: bool) -> SignalLook:
    """Range and faults of a whole signal, [samples]; see `CheckedSignal`."""
    signal = CheckedSignal(dwells)
    signal.add(values)
    return signal.result()
