"""Maxima and minima of a record that differ by more than noise does.

In plain Python, which takes 1 ms for 10 s of force at 1 kHz: what judges one log does without the compiler, whose import takes
0.3 s. What looks at thousands of records has it compiled: `falls`.
"""

import math
from typing import Any


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
    extreme, here = -math.inf, 0
    for i in range(len(values)):
        value = sign * values[i]
        if value > extreme:
            extreme, here = value, i
        elif value < extreme - drop:
            at[count] = here
            count += 1
            sign = -sign
            extreme, here = -value, i
    return count
