"""Slips of a run, found in its force, and the force's shape around them."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from diagnosis.features.cycles import half_fallen, turning_points
from diagnosis.features.feature import Scales, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import Segment

Floats = npt.NDArray[np.floating[Any]]

# instants of a slip at which its shape is read, in half periods of the mass on its spring after the middle of the fall
SHAPE_AT = np.array([-1.5, -1.0, -0.75, -0.5, -0.35, -0.2, 0.0, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0])
_ENOUGH_SLIPS = 0.5  # sum of their weights
_LEVEL = 0.15  # of the static friction: sliding under a friction wave changes by less
_TAPER = 0.12  # of a segment, from its ends, over which slips come to count in full


class Slips(NamedTuple):
    """The slips of a segment: blocks of breakaway and re-stick, where half of the fall is done, and how much each counts.

    A slip counts less towards the ends of its segment and nothing at them: one that comes in or goes out as a parameter
    moves must not make the features jump, or no fit finds its way.
    """

    tops: npt.NDArray[np.int64]
    bottoms: npt.NDArray[np.int64]
    middles: Floats
    weights: Floats

    @property
    def some(self) -> bool:
        """Whether there is enough of a slip to speak of."""
        return float(self.weights.sum()) > 0.1


def slip_pairs(slips: Slips) -> Floats:
    """How much each stick between two slips counts."""
    return np.minimum(slips.weights[:-1], slips.weights[1:])


NO_SLIPS = Slips(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))


def settled(signals: Signals, segment: Segment, scales: Scales) -> Segment:
    """A segment without what its start decides, and with what it shows: slips, even sliding, or neither, as in a first climb.

    With three slips or more it begins in the second stick: how loaded the spring was and how old the contact is past then. A
    single slip at an end or a climb that just does not slip would come and go with every parameter: nothing is read from them.
    """
    cut = {name: segment.sign * values[segment.first : segment.last] for name, values in signals.items()}
    slips = find_slips(cut, scales)
    if float(slips.weights.sum()) > _ENOUGH_SLIPS:
        segment = segment._replace(slips=len(slips.tops))
    if len(slips.tops) == 0:
        return segment._replace(still="drive_force_N" not in cut or not _climbs(cut["drive_force_N"], scales))
    if len(slips.bottoms) >= 3:
        stick = int(slips.tops[1] - slips.bottoms[0])
        start = int(slips.bottoms[0]) + int(0.4 * stick)
        segment = segment._replace(first=segment.first + start)
        slips = find_slips({name: values[start:] for name, values in cut.items()}, scales)
    return segment._replace(sticks=float(slip_pairs(slips).sum()) > _ENOUGH_SLIPS)


def _climbs(force_N: Floats, scales: Scales) -> bool:
    """Or falls: its second half, over fiftieths of a segment, is not level."""
    half = force_N[len(force_N) // 2 :]
    width = max(len(force_N) // 50, 1)
    level_N = half[: len(half) // width * width].reshape(-1, width).mean(axis=1)
    return float(np.ptp(level_N)) > _LEVEL * scales.force_N


def find_slips(cut: Signals, scales: Scales) -> Slips:
    """The slips of a segment whose signals are cut out and turned into the direction of the drive."""
    if "drive_force_N" in cut:
        falling = cut["drive_force_N"]
        tops, bottoms = turning_points(falling, scales.drop_N)
    else:
        # no force: the slide's velocity, an integral that leaks over two slips, rises and falls once a slip
        keep = math.exp(-BLOCK_S / (2.0 * scales.slip_s))
        falling = -np.asarray(lfilter([BLOCK_S], [1.0, -keep], cut["mass_accel_mps2"]))
        swing_mps = scales.drop_N * math.pi / (scales.stiffness_N_per_m * scales.slip_s)  # over sqrt(stiffness x mass)
        tops, bottoms = turning_points(falling, max(0.3 * float(np.ptp(falling)), swing_mps))
    tops = tops[: len(bottoms)]
    # what takes ten times as long as a slip is a change of level
    quick = (bottoms - tops) * BLOCK_S < 10.0 * scales.slip_s
    tops, bottoms = tops[quick], bottoms[quick]
    middles = half_fallen(falling, tops, bottoms)
    width = scales.slip_s / BLOCK_S
    margin = np.minimum(middles + SHAPE_AT[0] * width, len(falling) - 1 - middles - SHAPE_AT[-1] * width)
    return Slips(tops, bottoms, middles, np.clip(margin / (_TAPER * len(falling)), 0.0, 1.0))
