"""Range, clipping and dead stretches of a signal, found sample by sample with a memory of a few numbers."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.kernel import kernel

# A clipped signal meets its limit at full slope; a real peak slows down. A parabola that leaves a run of L equal samples with the
# slope s would rise by s L / 4 above them. A signal is clipped when this rise is more than the following share of its range.
# Too small: round peaks count as clipped; too large: flat clipping stays unseen.
_OVERSHOOT_SHARE = 1e-3
_LONGEST_DWELL = 40.0  # samples that a run of a position counts at most, as a position may rest at an end of its range
_SHORTEST_RUN = 3.0  # equal samples at the limit; noise alone hardly ever makes three
_STEPS_OF_RESOLUTION = 2.5  # smallest step into a clipped run, in resolutions; a real peak ends in steps of 1 or 2

# state: 0 samples, 1 last value, 2 run of equal values, 3 longest such run, 4 its end, 5 smallest step, 6 not finite,
# 7 first sample not finite; then for the top and, mirrored, for the bottom: 8 extreme, 9 run, 10 step into the run,
# 11 samples in runs, 12 largest overshoot, 13 run that the signal begins with, 14 step out of it; 22 longest run that counts
_SIDE = 8
_PER_SIDE = 7
_LONGEST = _SIDE + 2 * _PER_SIDE
_STATE_SIZE = _LONGEST + 1


class SignalLook(NamedTuple):
    """Range and faults of one signal; values in its unit, others in samples."""

    samples: int
    lowest: float
    highest: float
    not_finite: int
    first_not_finite: int  # index of the sample; -1: none
    clipped_high: int  # samples at the upper limit; 0: not clipped there
    clipped_low: int
    longest_run: int  # of equal samples
    longest_run_end: int  # index of its last sample

    @property
    def constant(self) -> bool:
        """Whether all finite samples, at least two, are equal."""
        return self.samples - self.not_finite > 1 and self.lowest == self.highest


@kernel
def _count(state: npt.NDArray[np.float64], side: int, run: float, step: float, length: float) -> None:
    if run >= _SHORTEST_RUN and step >= _STEPS_OF_RESOLUTION * state[5]:
        if math.isfinite(step):
            state[side + 4] = max(state[side + 4], step * length / 4.0)
        state[side + 3] += run


@kernel
def _end_run(state: npt.NDArray[np.float64], side: int, step_out: float) -> None:
    run, step_in = state[side + 1], state[side + 2]
    # a run at the very beginning or end of the signal has one flank only, and is counted by its step alone
    if math.isinf(step_in) and math.isfinite(step_out):
        # at the beginning the resolution is not known yet: the run is judged when the signal has ended
        state[side + 5] = run
        state[side + 6] = step_out
    else:
        one_flank = math.isinf(step_in) or math.isinf(step_out)
        _count(state, side, run, min(step_in, step_out), 4.0 if one_flank else min(run, state[_LONGEST]))
    state[side + 1] = 0.0


@kernel
def _look(values: npt.NDArray[Any], state: npt.NDArray[np.float64]) -> None:
    for i in range(values.shape[0]):
        value = float(values[i])
        at = state[0]
        state[0] += 1.0
        if not math.isfinite(value):
            if state[6] == 0.0:
                state[7] = at
            state[6] += 1.0
            continue
        first = at == state[6]
        last = state[1]
        if not first and value == last:
            state[2] += 1.0
        else:
            state[2] = 1.0
            if not first:
                state[5] = min(state[5], abs(value - last))
        if state[2] > state[3]:
            state[3] = state[2]
            state[4] = at
        for mirrored in range(2):
            side = _SIDE + _PER_SIDE * mirrored
            sign = 1.0 - 2.0 * mirrored
            v = sign * value
            if first or v > state[side]:
                state[side] = v
                state[side + 1] = 1.0
                state[side + 2] = math.inf if first else v - sign * last
                state[side + 3] = 0.0
                state[side + 4] = 0.0
                state[side + 5] = 0.0
            elif v == state[side]:
                if state[side + 1] == 0.0:
                    state[side + 2] = v - sign * last
                state[side + 1] += 1.0
            elif state[side + 1] > 0.0:
                _end_run(state, side, state[side] - v)
        state[1] = value


class Signal:
    """A signal that is checked piece by piece; a signal that `dwells`, such as a position, may rest at its extremes."""

    def __init__(self, dwells: bool) -> None:
        self._dwells = dwells
        self._state = np.zeros(_STATE_SIZE)
        self._state[5] = np.inf
        self._state[7] = -1.0
        self._state[_LONGEST] = _LONGEST_DWELL if dwells else np.inf

    def add(self, values: npt.NDArray[Any]) -> None:
        """Check the next samples, [samples]."""
        _look(values, self._state)

    def result(self) -> SignalLook:
        """Range and faults of all samples so far."""
        state = self._state.copy()
        sides = (_SIDE, _SIDE + _PER_SIDE)
        for side in sides:
            _end_run(state, side, math.inf)
            if not self._dwells:  # a position rests before it moves, so its first run is not clipping
                _count(state, side, float(state[side + 5]), float(state[side + 6]), 4.0)
        high, low = float(state[_SIDE]), -float(state[_SIDE + _PER_SIDE])
        limit = max(_OVERSHOOT_SHARE * (high - low), 0.0)
        clipped = [int(state[side + 3]) if high > low and state[side + 4] > limit else 0 for side in sides]
        # a unipolar sensor at rest clips its noise at 0: the end of its scale, but no signal is lost
        if low == 0.0:
            clipped[1] = 0
        if high == 0.0:
            clipped[0] = 0
        return SignalLook(
            int(state[0]), low, high, int(state[6]), int(state[7]), clipped[0], clipped[1], int(state[3]), int(state[4])
        )


def look(values: npt.NDArray[Any], dwells: bool) -> SignalLook:
    """Range and faults of a whole signal, [samples]; see `Signal`."""
    signal = Signal(dwells)
    signal.add(values)
    return signal.result()
