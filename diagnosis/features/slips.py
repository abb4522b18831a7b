"""The slips of a segment, found in the force, or in the acceleration where no force was measured."""

import math
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from bridge.arrays import Floats, Indices
from bridge.kernel import kernel
from diagnosis.features.feature import Scales, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import Segment
from diagnosis.slips import turns

# instants at which the shape of a slip is sampled, in slip durations (half periods of the mass on its spring) after mid-fall
SHAPE_AT = np.array([-1.5, -1.0, -0.75, -0.5, -0.35, -0.2, 0.0, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0])
# Least sum of the weights of the slips in a segment that slips. Too small: a slip at the edge of a segment decides which
# features are compared. Too large: short segments are not compared.
_ENOUGH_SLIPS = 0.5
# Largest change of the force over the second half of a segment of even sliding, as a share of the static friction.
# Too small: a friction wave counts as a climb. Too large: a first climb counts as sliding.
_LEVEL = 0.15
# Share of a segment, from either end, over which the weight of a slip grows from 0 to 1.
# Too small: features jump when a slip enters the segment. Too large: slips are wasted.
_TAPER = 0.12
_turns = kernel(turns)  # compiled, as thousands of records are searched


class SegmentSlips(NamedTuple):
    """The slips of a segment, [slips] each, in blocks from the start of the segment.

    The weight of a slip falls to 0 towards the ends of its segment, so that the features do not jump when a parameter moves a
    slip into or out of the segment, and a fit can follow their slope.
    """

    tops: Indices  # breakaways
    bottoms: Indices  # re-sticks
    middles: Floats  # instants of mid-fall
    weights: Floats  # 0 to 1


def slip_pairs(slips: SegmentSlips) -> Floats:
    """Weight of each stick between two slips, [slips - 1]."""
    return np.minimum(slips.weights[:-1], slips.weights[1:])


NO_SLIPS = SegmentSlips(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))


def settled(signals: Signals, segment: Segment, scales: Scales) -> Segment:
    """A segment without the part that depends on its start, marked with slips, even sliding, or neither (a first climb).

    With three slips or more the segment begins in the second stick, where the load of the spring and the age of the contact
    before the segment no longer matter. A single slip near an end, or a climb just below a slip, would appear and disappear with
    every parameter; neither gives a feature.
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
    """Whether the force [blocks] of a segment rises or falls in the second half, smoothed over fiftieths of the segment."""
    half = force_N[len(force_N) // 2 :]
    width = max(len(force_N) // 50, 1)
    level_N = half[: len(half) // width * width].reshape(-1, width).mean(axis=1)
    return float(np.ptp(level_N)) > _LEVEL * scales.force_N


def find_slips(cut: Signals, scales: Scales) -> SegmentSlips:
    """The slips of a segment.

    Args:
        cut: signals of the segment, [blocks] each, with positive values in the direction of the drive.
        scales: scales of the rig.

    """
    if "drive_force_N" in cut:
        falling, drop = cut["drive_force_N"], scales.drop_N
    else:
        # Without a force, the velocity of the slide is searched (the acceleration, integrated with a leak over two slip
        # durations): it rises and falls once a slip.
        keep = math.exp(-BLOCK_S / (2.0 * scales.slip_s))
        falling = -np.asarray(lfilter([BLOCK_S], [1.0, -keep], cut["mass_accel_mps2"]))
        swing_mps = scales.drop_N * math.pi / (scales.stiffness_N_per_m * scales.slip_s)  # over sqrt(stiffness x mass)
        drop = max(0.3 * float(np.ptp(falling)), swing_mps)
    at = np.empty(len(falling), np.int64)
    count = _turns(falling, drop, at) // 2 * 2  # without an incomplete fall at the end
    tops, bottoms = at[:count:2], at[1:count:2]
    # a fall that lasts ten slip durations or more is a change of level
    quick = (bottoms - tops) * BLOCK_S < 10.0 * scales.slip_s
    tops, bottoms = tops[quick], bottoms[quick]
    middles = _half_fallen(falling, tops, bottoms)
    width = scales.slip_s / BLOCK_S
    margin = np.minimum(middles + SHAPE_AT[0] * width, len(falling) - 1 - middles - SHAPE_AT[-1] * width)
    return SegmentSlips(tops, bottoms, middles, np.clip(margin / (_TAPER * len(falling)), 0.0, 1.0))


@kernel
def _half_fallen(falling: Floats, tops: Indices, bottoms: Indices) -> Floats:
    """Instant [samples] of mid-fall, [falls]; interpolated between two samples."""
    middles = np.empty(len(tops))
    for fall in range(len(tops)):
        half = 0.5 * (falling[tops[fall]] + falling[bottoms[fall]])
        under = tops[fall]
        while falling[under] > half:
            under += 1
        step = falling[under - 1] - falling[under]
        middles[fall] = under - (half - falling[under]) / step if step > 0.0 else under
    return middles
