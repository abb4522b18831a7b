"""Channels that repeat their bits: a converter that hangs, a cut wire, a range that is exceeded.

A channel with noise never repeats a number for long. Whether it has noise is learnt from the samples of a block, separately for a
moving drive and a drive at rest: noise goes up and down within a block, while an encoder without noise steps in one direction and
repeats a number for hours at rest.
"""

import math

from bridge.kernel import Record, kernel
from bridge.layouts import ControllerMemory, ControllerParams, SensorRow
from bridge.wire.stickslip_pb2 import DRIVE_DOUBTED, FROZEN, LOOSE
from controller.estimate.spikes import sum_without
from controller.estimate.windows import DRIVE as DRIVE_ROW
from controller.trips.doubts import (
    ACCELEROMETER,
    CHANNELS,
    CONTACT,
    DRIVE,
    OF_BASE,
    OF_DRIVE,
    OF_FORCE,
    OF_SLIDE,
    trip,
)
from controller.trips.jumps import watch_jumps
from controller.trips.noise import look_at_noise

# Time and number of blocks with equal first samples until a trip: with a noise of one step, half of all samples are equal.
HOLD_S, FEWEST = 0.05, 40
# If all channels repeat their number for HOLD_S divided by this, their reader hangs: all signals are doubted.
_ALL_PARTS = 2
_FASTEST_MPS = 100.0  # largest velocity of a drive; a faster change of its position is a wrong unit or channel
_LOOK_STEPS = 16  # steps from the check of one channel's noise to the check of the next channel
_LOOKS = 8  # number of checks until a channel may count as noisy
_LIVELY = 0.9  # share of the checks above which a channel counts as noisy
_DROPS_S, _MOST_DROPS = 1.0, 3.5  # time constant of the count of dropouts, and the largest allowed count
_DEAD_S = 0.3  # duration of a motion after which a force that never changed in the run is frozen
_SAME = 4  # blocks in a row with the same first sample from which a channel is not checked for noise


@kernel
def watch_frozen(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> None:
    """Count blocks that begin with the same number as the block before; trip if a channel with noise shows no noise.

    A drive position that changes impossibly fast has another unit, or is another channel.
    """
    if s.steps % _LOOK_STEPS == 0:
        _look_at_one(s, block)
        look_at_noise(s, block.drive_position_m)
    blocks = s.block - s.seen_block
    s.seen_block = s.block
    place_m = sum_without(s, DRIVE_ROW, block.drive_position_m, 0, 1)
    went_m = math.fabs(place_m - s.first_sample[OF_DRIVE])
    if blocks > 0 and s.first_seen == 1 and went_m > _FASTEST_MPS * blocks * p.block_s:
        trip(s, DRIVE_DOUBTED, DRIVE)
    watch_jumps(p, s, place_m, blocks)
    s.first_seen = 1
    if p.use_force == 1 and _repeats(p, s, OF_FORCE, float(block.drive_force_N[0])):
        trip(s, FROZEN, CONTACT)
    if p.use_force == 1 and s.moved_s > _DEAD_S and s.same_steps[OF_FORCE] >= s.steps - 1:
        trip(s, FROZEN, CONTACT)  # the force never changed, although a moving drive winds up its spring
    if p.use_slide_position == 1 and _repeats(p, s, OF_SLIDE, float(block.mass_position_m[0])):
        trip(s, FROZEN, CONTACT)
    if _repeats(p, s, OF_DRIVE, place_m):
        trip(s, FROZEN, DRIVE)
    if _repeats(p, s, OF_BASE, float(block.base_accel_mps2[0])):
        trip(s, FROZEN, ACCELEROMETER)
    if s.same_steps[OF_BASE] > 0 and _all_repeat(p, s):
        trip(s, FROZEN, ACCELEROMETER | CONTACT | DRIVE)
    _watch_drops(p, s, block.base_accel_mps2)


@kernel
def _watch_drops(p: ControllerParams, s: ControllerMemory, samples: Record) -> None:
    """Count dropouts to blocks of a constant number during a vibration; trip if there are too many within a second."""
    s.drops *= 1.0 - min(p.block_s / _DROPS_S, 1.0)
    dropped = s.allowed_m > 0.0 and _is_one_number(samples)
    if dropped and s.dropped == 0:
        s.drops += 1.0
        if s.drops > _MOST_DROPS and s.looks[OF_BASE, 1] == _LOOKS and s.lively[OF_BASE, 1] > _LIVELY:
            trip(s, LOOSE, ACCELEROMETER)
    s.dropped = 1 if dropped else 0


@kernel
def _is_one_number(samples: Record) -> bool:
    first = float(samples[0])
    same = True
    for i in range(samples.shape[0] - 1, 0, -1):
        same = same and float(samples[i]) == first
    return same


@kernel
def _look_at_one(s: ControllerMemory, block: SensorRow) -> None:
    """Check the noise of one channel, in turn."""
    channel = s.looked % CHANNELS
    s.looked += 1
    if s.same_steps[channel] >= _SAME:
        return
    if channel == OF_FORCE:
        shows = _goes_up_and_down(block.drive_force_N)
    elif channel == OF_SLIDE:
        shows = _goes_up_and_down(block.mass_position_m)
    elif channel == OF_DRIVE:
        shows = _goes_up_and_down(block.drive_position_m)
    else:
        shows = _goes_up_and_down(block.base_accel_mps2)
    way = _state(s, channel)
    s.looks[channel, way] = min(s.looks[channel, way] + 1, _LOOKS)
    s.lively[channel, way] += ((1.0 if shows else 0.0) - s.lively[channel, way]) / s.looks[channel, way]


@kernel
def _state(s: ControllerMemory, channel: int) -> int:
    """The condition on which a channel's noise depends: 1 if the base vibrates (accelerometer) or the drive moves (others)."""
    if channel == OF_BASE:
        return 1 if s.allowed_m > 0.0 else 0
    return s.moving


@kernel
def _goes_up_and_down(samples: Record) -> bool:
    went = 0.0
    for i in range(1, samples.shape[0]):
        step = float(samples[i]) - float(samples[i - 1])
        if step * went < 0.0:
            return True
        went = step if step != 0.0 else went
    return False


@kernel
def _repeats(p: ControllerParams, s: ControllerMemory, channel: int, first: float) -> bool:
    same = s.same_steps[channel] + 1 if first == s.first_sample[channel] else 0
    s.same_steps[channel], s.first_sample[channel] = same, first
    return same > p.frozen_steps and _has_noise(s, channel)


@kernel
def _has_noise(s: ControllerMemory, channel: int) -> bool:
    way = _state(s, channel)
    return s.looks[channel, way] == _LOOKS and s.lively[channel, way] > _LIVELY


@kernel
def _all_repeat(p: ControllerParams, s: ControllerMemory) -> bool:
    """Whether all channels repeat their numbers, and the base accelerometer has noise; without noise it may be constant."""
    fewest = min(s.same_steps[OF_BASE], s.same_steps[OF_DRIVE])
    if p.use_force == 1:
        fewest = min(fewest, s.same_steps[OF_FORCE])
    if p.use_slide_position == 1:
        fewest = min(fewest, s.same_steps[OF_SLIDE])
    return _ALL_PARTS * fewest > p.frozen_steps and _has_noise(s, OF_BASE)
