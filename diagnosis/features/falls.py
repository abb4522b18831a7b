"""Falls of a record, compiled: where each begins, where it ends, and when half of it is done."""

import numpy as np

from bridge.arrays import Floats, Indices
from bridge.kernel import kernel
from diagnosis.look.turns import turns

_turns = kernel(turns)


def turning_points(force_N: Floats, drop_N: float) -> tuple[Indices, Indices]:
    """Indices of maxima and of minima that alternate and differ by at least `drop_N`; the first is a maximum.

    Two arrays; the second is one shorter when the record ends in a fall.
    """
    at = np.empty(len(force_N), np.int64)
    count = _turns(force_N, drop_N, at)
    return at[:count:2], at[1:count:2]


@kernel
def half_fallen(falling: Floats, tops: Indices, bottoms: Indices) -> Floats:
    """Instant, in samples, at which half of each fall is done, [falls]; interpolated between two samples."""
    middles = np.empty(len(tops))
    for fall in range(len(tops)):
        half = 0.5 * (falling[tops[fall]] + falling[bottoms[fall]])
        under = tops[fall]
        while falling[under] > half:
            under += 1
        step = falling[under - 1] - falling[under]
        middles[fall] = under - (half - falling[under]) / step if step > 0.0 else under
    return middles
