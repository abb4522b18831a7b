"""Whether a position column belongs to the drive or to the slide: in the sticks the drive moves and the slide rests."""

import numpy as np

from bridge.arrays import Floats
from diagnosis.look.record import parts_of
from diagnosis.look.slips import find_slips
from diagnosis.look.sticks import cycles_of

# Speed in a stick over the mean speed around it: 1 for a drive; for a slide 0, and a few hundredths where its contact gives way.
_LEAST_OF_DRIVE = 0.5
_ENOUGH = 1 << 20  # samples that are looked at: a hundred slips of a slow rig at 10 kHz


def is_of_slide(t_s: Floats, force_N: Floats, position_m: Floats) -> bool:
    """Whether a position belongs to the slide, [samples] each, SI units. False where no stick shows it."""
    few = slice(_ENOUGH)
    t_s, force_N, position_m = t_s[few], force_N[few], position_m[few]
    shares: list[float] = []
    for part in parts_of(t_s, force_N, position_m):
        slips = find_slips(part)
        if slips is None or not slips.sticks or part.position_m is None:
            continue
        tops = slips.tops.tolist()
        for first, last, cycle in zip(tops[:-1], tops[1:], cycles_of(slips, None)[1:], strict=True):
            mean_mps = float(part.position_m[last] - part.position_m[first]) / ((last - first) * part.step_s)
            if mean_mps > 0.0 and np.isfinite(cycle.speed_mps):
                shares.append(cycle.speed_mps / mean_mps)
    return bool(shares) and float(np.median(shares)) < _LEAST_OF_DRIVE
