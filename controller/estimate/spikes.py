"""Spikes: single samples far from both neighbours, which agree with each other.

No slide, drive or spring moves away and back within one sample, so such a sample carries no information, and the mean of its
neighbours replaces it (Hampel's rule, with the noise in place of the median of deviations). At most one spike is replaced in a
channel of a block, and none in the next block: more of them are noise or a fault. The last sample of a block has no neighbour
after it, so a jump there counts from the next block on.
"""

import math

import numpy as np

from bridge.kernel import Record, kernel
from bridge.layouts import ControllerMemory, ControllerParams, SensorRow
from controller.estimate.windows import DRIVE, FORCE, ROWS, SLIDE

# A bend is the second difference of samples. Least bend of a spike, over (mean bend of the noise times the root of the samples in
# a bin): the spike is then 6 sigma of the slope of four bins, and a smaller spike is not detected as a slip.
BENDS = 9.0
_STEPS = 4.0  # least bend of a spike, over the resolution: a step up and down again bends by two
_ROUNDED = 2e-7  # relative rounding of a float32 in a message
_LEFT = 0.25  # share of the bend that may remain next to a replaced spike; after a step or a kink half remains
_NEAR = 0.25  # no spike if all samples are within this share of a spike's bend of the last sample before the block
_LARGEST = 3e38  # largest bend that a float32 holds
_LEARN = 0.125  # weight of a new mean bend in the learnt noise
_GROWS = 2.0  # largest factor by which the noise grows in a block


@kernel
def find_spikes(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> bool:
    """Find the spikes of a block; false if a sample is NaN or infinite, which would stay in the filters for ever.

    Channels that are not configured are skipped.
    """
    if s.missing_blocks > 0:
        s.tail[:, :] = math.nan
    if s.spiked == 1:
        s.spiked, s.spike_at[:] = 0, -1
    bad = _not_finite(block.base_accel_mps2) + _look(p, s, DRIVE, block.drive_position_m)
    if p.use_force == 1:
        bad += _look(p, s, FORCE, block.drive_force_N)
    if p.use_slide_position == 1:
        bad += _look(p, s, SLIDE, block.mass_position_m)
    return bad == 0


@kernel
def sum_without(s: ControllerMemory, row: int, samples: Record, first: int, count: int) -> float:
    """Sum of some samples, with the mean of its neighbours in place of a spike."""
    total = 0.0
    for i in range(first, first + count):
        total += s.spike[row] if i == s.spike_at[row] else float(samples[i])
    return total


@kernel
def learn_bends(p: ControllerParams, s: ControllerMemory, look: int, block: SensorRow) -> None:
    """Update the noise of one channel, in turn; `look` counts the calls."""
    if look % ROWS == FORCE:
        _learn(p, s, FORCE, block.drive_force_N)
    elif look % ROWS == SLIDE:
        _learn(p, s, SLIDE, block.mass_position_m)
    else:
        _learn(p, s, DRIVE, block.drive_position_m)


@kernel
def _learn(p: ControllerParams, s: ControllerMemory, row: int, samples: Record) -> None:
    """Update the noise of a channel: the mean bend of its samples."""
    bend = 0.0
    for i in range(2, samples.shape[0]):
        bend += math.fabs(float(samples[i]) - 2.0 * float(samples[i - 1]) + float(samples[i - 2]))
    bend /= samples.shape[0] - 2
    known = s.bends[row]
    known += bend if known == 0.0 else _LEARN * min(bend - known, known)
    _know(p, s, row, known, float(samples[0]))


@kernel
def _look(p: ControllerParams, s: ControllerMemory, row: int, samples: Record) -> int:
    """Search one channel for a spike; return the number of NaN or infinite samples."""
    count, bad = samples.shape[0], 0
    if _count_far(s.tail[row, 1], samples, _NEAR * s.most_bend[row]) > 0:
        bad = _look_closer(p, s, row, samples)
    s.tail[row, 0], s.tail[row, 1] = float(samples[count - 2]), float(samples[count - 1])
    if s.spiked == 1 and s.spike_at[row] >= count - 2:
        s.tail[row, s.spike_at[row] - count + 2] = s.spike[row]
    return bad


@kernel
def _look_closer(p: ControllerParams, s: ControllerMemory, row: int, samples: Record) -> int:
    bad = 0
    if _count_bent(s.tail[row, 0], s.tail[row, 1], samples, s.most_bend[row]) > 0:
        bad = _not_finite(samples)
        if bad == 0 and s.bends[row] > 0.0:
            _search(p, s, row, samples)
    return bad


@kernel
def _count_far(last: float, samples: Record, most: float) -> int:
    """Number of samples farther than `most` from `last`, or NaN; counted without a branch, so that eight run at once."""
    near, limit, far = np.float32(last), np.float32(most), 0
    for i in range(samples.shape[0]):
        far += 0 if abs(samples[i] - near) <= limit else 1
    return far


@kernel
def _count_bent(before: float, last: float, samples: Record, most: float) -> int:
    """Number of samples with a bend above `most`, or NaN; counted without a branch."""
    first, second, bent = float(samples[0]), float(samples[1]), 0
    bent += 0 if math.fabs(before - 2.0 * last + first) <= most else 1
    bent += 0 if math.fabs(last - 2.0 * first + second) <= most else 1
    limit = np.float32(most)
    for i in range(2, samples.shape[0]):
        bend = (samples[i] - samples[i - 1]) - (samples[i - 1] - samples[i - 2])
        bent += 0 if abs(bend) <= limit else 1
    return bent


@kernel
def _not_finite(samples: Record) -> int:
    """Number of NaN or infinite samples; counted without a branch, so that eight run at once."""
    bad = 0
    for i in range(samples.shape[0]):
        value = float(samples[i])
        bad += 1 if value - value != 0.0 else 0
    return bad


@kernel
def _search(p: ControllerParams, s: ControllerMemory, row: int, samples: Record) -> None:
    """Store the largest spike; without a spike, raise the noise."""
    count, largest, total = samples.shape[0], s.most_bend[row], 0.0
    steep = 0.0  # bend just before the bend of the last three samples
    for i in range(count - 1):
        left, middle, right = _at(s, row, samples, i - 1), float(samples[i]), float(samples[i + 1])
        bend = math.fabs(left - 2.0 * middle + right)
        if i == count - 3:
            steep = bend
        total += bend if math.isfinite(bend) else 0.0
        if bend > largest:
            mean = 0.5 * (left + right)
            stays = math.fabs(_at(s, row, samples, i - 2) - 2.0 * left + mean) > _LEFT * bend
            stays = stays or math.fabs(mean - 2.0 * right + _at(s, row, samples, i + 2)) > _LEFT * bend
            if not stays:
                largest = bend
                s.spiked, s.spike_at[row], s.spike[row] = 1, i, mean
    end, before = float(samples[count - 1]), float(samples[count - 2])
    bend = math.fabs(end - 2.0 * before + float(samples[count - 3]))
    if bend > largest and not steep > _LEFT * bend:
        s.spiked, s.spike_at[row], s.spike[row] = 1, count - 1, before
    if s.spike_at[row] < 0:
        _know(p, s, row, min(max(total / count, s.bends[row]), _GROWS * s.bends[row]), end)
        return
    if s.steps == s.spike_step[row] + 1:
        s.spike_at[row] = -1  # a spike in each block is not a single sample: the trips judge it
    s.spike_step[row] = s.steps


@kernel
def _know(p: ControllerParams, s: ControllerMemory, row: int, bend: float, value: float) -> None:
    """Set the mean bend of the noise, and from it the least bend of a spike; `value` is one of the samples."""
    s.bends[row] = bend
    floor = _STEPS * max(s.resolution[row], _ROUNDED * math.fabs(value))
    s.most_bend[row] = min(max(p.spike_bends * bend, floor), _LARGEST)


@kernel
def _at(s: ControllerMemory, row: int, samples: Record, i: int) -> float:
    """A sample of this block, or one of the two samples before it; NaN if it is not known."""
    if i >= samples.shape[0]:
        return math.nan
    return float(samples[i]) if i >= 0 else float(s.tail[row, 2 + i])
