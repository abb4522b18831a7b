"""Maxima and minima of a record that differ by more than its noise.

In plain Python, which takes 1 ms for 10 s of force at 1 kHz: a command for a single log avoids the import of the compiler, which
takes 0.3 s. The search over thousands of records is compiled: `falls`.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats

_PIECE = 256  # samples that are passed over at once where none of them can be a turning point; 64 and 1024 are slower


def turns(values: Any, drop: float, at: Any) -> int:
    """Find maxima and minima that alternate and differ by at least `drop`; the first is a maximum.

    Args:
        values: of the record, [samples]; a list, which plain Python reads faster, or an array.
        drop: in the unit of the values.
        at: filled with the indices of the turning points, [samples].

    Returns how many there are.

    """
    count = 0
    sign = 1.0  # while the values rise
    extreme, place = -math.inf, 0
    for i in range(len(values)):
        value = sign * values[i]
        if value > extreme:
            extreme, place = value, i
        elif value < extreme - drop:
            at[count] = place
            count += 1
            sign = -sign
            extreme, place = -value, i
    return count


def long_turns(values: Floats, drop: float) -> npt.NDArray[np.int64]:
    """The turning points that `turns` finds, as indices; pieces of a record in which the values do not turn are passed over.

    Takes 50 ms for 10 min at 10 kHz, where `turns` takes 1 s.
    """
    pieces = values[: len(values) // _PIECE * _PIECE].reshape(-1, _PIECE)
    ends = {
        1.0: (pieces.max(1), pieces.min(1), pieces.argmax(1)),
        -1.0: (-pieces.min(1), -pieces.max(1), pieces.argmin(1)),
    }
    sides = {sign: [side.tolist() for side in both] for sign, both in ends.items()}
    at: list[int] = []
    sign = 1.0
    extreme, place = -math.inf, 0
    for piece in range(len(pieces) + 1):
        begin = piece * _PIECE
        if piece < len(pieces):
            highs, lows, where = sides[sign]
            if lows[piece] >= max(extreme, highs[piece]) - drop:
                if highs[piece] > extreme:
                    extreme, place = highs[piece], begin + where[piece]
                continue
        for i, sample in enumerate(values[begin : begin + _PIECE].tolist(), begin):
            value = sign * sample
            if value > extreme:
                extreme, place = value, i
            elif value < extreme - drop:
                at.append(place)
                sign = -sign
                extreme, place = -value, i
    return np.array(at, np.int64)
