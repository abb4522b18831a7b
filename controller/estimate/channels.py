"""Conditioning of the samples, and the faults that one channel shows.

A bin of samples is compared with the line of the bins before it; the mean deviation is the channel's noise. A bin beyond 6 sigma
is replaced by the line, as no slide, drive or spring moves away and back within a bin. If the next bin deviates as far, the
signal has stepped: a step of the drive position is an error of its encoder and is subtracted from then on. If the deviations
differ, the noise has grown or the motion has changed, and both are followed.
"""

import math

from bridge.kernel import Record, kernel
from bridge.layouts import ControllerMemory, ControllerParams, SensorRow
from bridge.wire.stickslip_pb2 import DRIVE_DOUBTED, FROZEN
from controller.estimate.compliance import spring_force
from controller.estimate.windows import DRIVE, FORCE, ROWS, SLIDE, WELL_KNOWN
from controller.trips.doubts import ACCELEROMETER, CONTACT, trip
from controller.trips.doubts import DRIVE as DRIVE_DOUBT

# Deviation of a replaced bin, over the mean deviation: a step of 16 sigma is subtracted in six of ten times. Larger: an encoder
# slips for longer. Smaller: at 7 white noise steps 9 times an hour, as two noisy bins deviate from the line's last bin.
_FAR = 8.0
_STEPS = 2.0  # resolutions added to it; smaller: a step of a coarse encoder is replaced
_ROUNDED = 2e-7  # relative rounding of a float32 in a message, the finest resolution
# Weights of a bin in the slope of the line, and in the noise. Larger: the limit scatters with its noise, and at 0.03 white noise
# steps once in two hours. Smaller: an accelerating drive deviates from its line; grown noise is taken for steps.
_FOLLOW, _LEARN = 0.25, 0.015625
_MOST_BINS = 3  # bins until a deviation other than a step is followed; smaller: a step within a bin is missed
_MEMORY_S = 1.0  # time constant of the counts and of the usual noise; time of a report
_MOST_STEPS = 2.5  # count of steps from which the drive position is doubted
# Time of repeated blocks or grown noise. Larger: at 0.015 an accelerometer that drops out for 5 % of the time is reported after
# 0.9 s (0.3 s). Smaller: bursts of noise of 3 ms count as grown noise.
HOLD_S = 0.01
_GROWN = 8.0  # growth of the drive position's noise that counts in all windows; smaller: an acceleration is noise
_STEPS_LOOK = 16  # steps between two measurements of the resolution of the samples
_LARGEST = 1e15  # sum of a block's samples that shows no number
BASE = 2  # index of the base acceleration in the counts of repeated blocks, after FORCE and SLIDE


@kernel
def is_usable(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> bool:
    """Whether all used samples are numbers. Counts the blocks that repeat the block before them, by a weighted sum."""
    force, slide, drive, base, unused = 0.0, 0.0, 0.0, 0.0, 0.0  # together, as the sums do not wait for each other
    for i in range(block.base_accel_mps2.shape[0]):
        weight = float((i + 1) * (i + 1))
        force += weight * float(block.drive_force_N[i])
        slide += weight * float(block.mass_position_m[i])
        drive += weight * float(block.drive_position_m[i])
        base += weight * float(block.base_accel_mps2[i])
        unused += float(block.mass_accel_mps2[i])
    _note(p, s, FORCE, force, s.moving == 1 and s.usual[FORCE] > _STEPS * s.resolution[FORCE])
    _note(p, s, SLIDE, slide, s.moving == 1 and s.usual[SLIDE] > _STEPS * s.resolution[SLIDE])
    _note(p, s, BASE, base, s.least_mps.min() > 0.0)
    s.slide_accel_unread = 0 if math.isfinite(unused) else 1
    used = math.fabs(drive) + math.fabs(base)
    used += math.fabs(force) if p.use_force == 1 else 0.0
    used += math.fabs(slide) if p.use_slide_position == 1 else 0.0
    return used < _LARGEST


@kernel
def _note(p: ControllerParams, s: ControllerMemory, channel: int, block_sum: float, noisy: bool) -> None:
    """Count a block that repeats the block before it, of a channel that is noisy at present."""
    same = noisy and block_sum == s.block_sum[channel]
    s.block_sum[channel] = block_sum
    s.repeats[channel] += (1.0 if same else 0.0) - p.block_s / _MEMORY_S * s.repeats[channel]


@kernel
def means(p: ControllerParams, s: ControllerMemory, block: SensorRow, first: int, samples: int, at: int) -> None:
    """Store the means of some samples in `fresh`, at `at`; 0 for a channel that is not used."""
    force_N, slide_m, drive_m = 0.0, 0.0, 0.0
    for i in range(first, first + samples):
        force_N += float(block.drive_force_N[i])
        slide_m += float(block.mass_position_m[i])
        drive_m += float(block.drive_position_m[i])
    s.fresh[FORCE, at] = force_N / samples if p.use_force == 1 else 0.0
    s.fresh[SLIDE, at] = slide_m / samples if p.use_slide_position == 1 else 0.0
    s.fresh[DRIVE, at] = drive_m / samples - s.offset_m


@kernel
def bin_means(p: ControllerParams, s: ControllerMemory, block: SensorRow, first: int, bins: int) -> None:
    """Store the conditioned means of some bins in `fresh`; without a force sensor, the spring's force."""
    for i in range(bins):
        means(p, s, block, first + i * p.bin_samples, p.bin_samples, i)
    for row in range(ROWS):
        if s.pushed[0] == 0:
            s.last[row], s.rate[row], s.far[row] = s.fresh[row, 0], 0.0, 0
        _condition(s, row, bins)
    if p.use_force == 0:
        for i in range(bins):
            s.fresh[FORCE, i] = spring_force(s, s.fresh[DRIVE, i] - s.fresh[SLIDE, i])


@kernel
def _condition(s: ControllerMemory, row: int, bins: int) -> None:
    fresh, last, rate, scatter, far, off = s.fresh, s.last[row], s.rate[row], s.scatter[row], s.far[row], s.off[row]
    is_first = s.pushed[0] < WELL_KNOWN
    step = _STEPS * max(s.resolution[row], _ROUNDED * math.fabs(fresh[row, 0]))
    for i in range(bins):
        before, off = off, fresh[row, i] - (last + rate)
        most = _FAR * scatter + step
        steps = far > 0 and 2.0 * math.fabs(off - before) <= most
        if is_first or (math.fabs(off) <= most and not steps):
            last = fresh[row, i]
            rate += _FOLLOW * off
            if off != 0.0:  # a repeated number gives no information on the noise
                s.learnt[row] += 1
                scatter += max(_LEARN, 1.0 / s.learnt[row]) * (math.fabs(off) - scatter)
            far = 0
            continue
        last += rate
        is_held = far == 0 and before == 0.0  # a channel without noise, or slower than the bins, moves in steps
        far += 1
        if steps:
            far = 0
            s.stepped |= 1 << row
            if row == DRIVE:
                s.offset_m += off
                for later in range(i, bins):
                    fresh[row, later] -= off
            last = fresh[row, i]
        elif is_held or far == _MOST_BINS:
            far = 0
            last = fresh[row, i]
            rate += 0.0 if is_held else off - before
            scatter += _LEARN * (math.fabs(off) - scatter)
        fresh[row, i] = last
    s.last[row], s.rate[row], s.scatter[row], s.far[row], s.off[row] = last, rate, scatter, far, off


@kernel
def note_resolution(s: ControllerMemory, row: int, samples: Record) -> None:
    """Learn the quantisation step of a row: the smallest change from sample to sample. Until the first change in each block."""
    if s.resolution[row] > 0.0 and s.steps % _STEPS_LOOK > 0:
        return
    last = float(samples[0])
    for i in range(1, samples.shape[0]):
        value = float(samples[i])
        change = math.fabs(value - last)
        if change > _ROUNDED * math.fabs(value) and (s.resolution[row] == 0.0 or change < s.resolution[row]):
            s.resolution[row] = change
        last = value


@kernel
def watch_channels(p: ControllerParams, s: ControllerMemory) -> None:
    """Trip on channels that repeat blocks or step too often; learn the drive's noise again if it has grown. Once a block."""
    share = p.block_s / _MEMORY_S
    if s.stepped & 1 << DRIVE:  # two channels at once: their common reference
        s.jumps += 1.0 if s.stepped == 1 << DRIVE else 1.0 + _MOST_STEPS
    s.stepped = 0
    if s.jumps > _MOST_STEPS:
        trip(s, DRIVE_DOUBTED, DRIVE_DOUBT)
    s.jumps -= share * s.jumps
    if s.repeats[BASE] > p.frozen_steps:
        trip(s, FROZEN, ACCELEROMETER)
    if max(s.repeats[FORCE], s.repeats[SLIDE]) > p.frozen_steps:
        trip(s, FROZEN, CONTACT)
    scatter_m = s.scatter[DRIVE]
    for row in range(ROWS):
        is_known = s.usual[row] > 0.0 and s.learnt[row] >= WELL_KNOWN
        s.usual[row] += (share if is_known else 1.0) * (s.scatter[row] - s.usual[row])
    usual_m = max(s.usual[DRIVE], s.resolution[DRIVE])
    if scatter_m <= _GROWN * usual_m:
        s.grown_s = max(s.grown_s - p.block_s, 0.0)
        return
    s.grown_s += p.block_s
    if s.grown_s > HOLD_S:
        for level in range(p.levels):
            s.sigma[DRIVE, level] *= scatter_m / usual_m
            s.noise[DRIVE, level] *= scatter_m / usual_m
        s.usual[DRIVE], s.grown_s = scatter_m, _MEMORY_S


@kernel
def has_jumped(s: ControllerMemory) -> bool:
    """Whether the drive position stepped a short time ago."""
    return s.jumps > 0.5


@kernel
def is_noisy(s: ControllerMemory) -> bool:
    """Whether the noise of the drive position has grown a short time ago."""
    return s.grown_s > HOLD_S
