"""Noise that grows many times: the windows learn it again, as with the old value noise would look like motion.

More slips than the spring could wind up for count as noise, too.
"""

import math

from bridge.kernel import Record, kernel
from bridge.layouts import ControllerMemory, ControllerParams
from controller.estimate.windows import DRIVE, LEVELS
from controller.trips.delivered import SOME

_LOUDER = 4.0  # growth of the drive position's second difference that counts as a new noise level
_LEARN = 1.0 / 16.0  # weight of a new second difference in its mean
_SLIPS_S = 1.0  # time constant of the count of slips
# Slips count as noise above this number, and above this factor times the slips for which the spring could wind up.
_MOST_SLIPS, _TIMES = 8.0, 3.0
_UNBELIEVED_S = 2.0  # time for which slips are ignored after too many of them
_TOLD_S = 2.0  # time for which grown noise is reported


@kernel
def look_at_noise(s: ControllerMemory, samples: Record) -> None:
    """Update the second difference of the drive position; after two large ones, restart the learning of the noise."""
    bend_m = 0.0
    for i in range(2, samples.shape[0]):
        bend_m += math.fabs(float(samples[i]) - 2.0 * float(samples[i - 1]) + float(samples[i - 2]))
    bend_m /= samples.shape[0] - 2
    floor_m = s.resolution[DRIVE]
    if s.bend_m > 0.0 and bend_m > _LOUDER * max(s.bend_m, floor_m):
        s.bent += 1
        if s.bent >= 2:
            for level in range(LEVELS):
                s.differences[level] = 0
                s.sigma[:, level], s.noise[:, level] = 0.0, 0.0
            s.bend_m, s.bent, s.noise_told_s = bend_m, 0, _TOLD_S
        return
    s.bent = 0
    s.bend_m = bend_m if s.bend_m == 0.0 else s.bend_m + _LEARN * (bend_m - s.bend_m)


@kernel
def watch_slips(p: ControllerParams, s: ControllerMemory) -> None:
    """Ignore slips for a time if there are too many. Called every SOME steps."""
    some_s = SOME * p.block_s
    keep = 1.0 - min(some_s / _SLIPS_S, 1.0)
    s.slip_count *= keep
    s.slips_wound *= keep
    if s.moving == 1:  # integrated, as the speed of the drive may change
        s.slips_wound += some_s / max(s.expected_stick_s, some_s)
    s.unbelieved_s = max(s.unbelieved_s - some_s, 0.0)
    s.noise_told_s = max(s.noise_told_s - some_s, 0.0)
    if s.slip_count > _MOST_SLIPS and s.slip_count > _TIMES * s.slips_wound:
        s.unbelieved_s = _UNBELIEVED_S
