"""Slopes of the signals in windows from four bins to seconds, and the noise of each slope.

Level j has windows twice as long as level j - 1, of four bins each. A stiff axis needs a window of 0.4 ms, and a creep feed a
window of a second, so all levels run in parallel and `contact` takes the shortest window whose signal exceeds its noise.

The noise of a level is measured: the slopes of three successive windows lie on a line except for noise (the idea of the Hadamard
deviation), so it contains hum, drift and quantisation as well as white noise, but not a swing that is slow against the window.
The scale is the lower quartile of the deviations, which a minority of disturbances by slips and re-sticks changes little.

A slide that swings with about the period of the windows bends their slopes as noise does, but in force and position alike, by
the spring's law x_d' - x_s' = F' / k_d. So the deviation from this law and the drive's noise together bound the noise from above.
"""

import math

import numpy as np

from bridge.kernel import Record, kernel
from bridge.layouts import ControllerMemory, ControllerParams

BINS = 4  # bins in a window; a power of 2
MOST_FRESH = 16  # most bins that are added in a call
LEVELS = 16  # most levels; `levels` of the parameters is the number in use
FORCE, SLIDE, DRIVE = 0, 1, 2  # rows: drive force [N], slide position [m], drive position [m]
ROWS = 3
_OF_BEND = 6.0**-0.5  # sigma of a slope over the sigma of a - 2 b + c of three successive slopes
_QUARTILE = 0.3186  # lower quartile of |d| of a normal distribution, over its sigma
_WHITE = 2.0**-1.5  # noise of a slope over the noise at half the window, for white noise
# Differences until the level's measured noise is used; before, the noise of shorter windows is extrapolated as white noise.
FEWEST = 10
WELL_KNOWN = 40  # differences after which the error of a level's noise is only some per cent
_CARRIED = 1.3  # factor of extrapolated noise: ten differences have an error of 20 %, and no noise is quite white
_FIRST_SHARE, _LEAST_SHARE = 4.0, 0.005  # change of log sigma: first, and least, at which sigma scatters by 6 %
_LEAST_SHARE_OF_LAW = 0.02  # least change for the deviation from the spring's law, whose stiffness is still learnt
# Factors of sigma at the least changes, and the number of differences after which they apply.
_UP, _MANY = math.exp(0.25 * _LEAST_SHARE), round(_FIRST_SHARE / _LEAST_SHARE)
_UP_OF_LAW, _MANY_OF_LAW = math.exp(0.25 * _LEAST_SHARE_OF_LAW), round(_FIRST_SHARE / _LEAST_SHARE_OF_LAW)
# A quantisation step q causes an error of a slope of at most q / W in a window W; its sigma is 0.29 of that.
OF_STEP = 0.29


@kernel
def push(p: ControllerParams, s: ControllerMemory, count: int, learn: bool) -> None:
    """Add `count` bins, whose means are in `fresh`, to all levels; `learn`: false for bins that only bridge lost blocks."""
    fresh, bins, slope = s.fresh, s.bins, s.slope
    per_s = 0.1 / p.bin_s
    for level in range(p.levels):
        pushed = s.pushed[level]
        longer = 0
        for i in range(count):
            at = pushed & (BINS - 1)
            for row in range(ROWS):
                bins[row, level, at] = fresh[row, i]
            pushed += 1
            if at == BINS - 1:
                for row in range(ROWS):
                    slope[row, level] = (
                        3.0 * (bins[row, level, 3] - bins[row, level, 0]) + bins[row, level, 2] - bins[row, level, 1]
                    ) * per_s
                _note_window(p, s, level, learn and pushed >= 3 * BINS)
            if pushed & 1 == 0:
                for row in range(ROWS):
                    fresh[row, longer] = 0.5 * (bins[row, level, at - 1] + bins[row, level, at])
                longer += 1
        s.pushed[level] = pushed
        last = (pushed - 1) & (BINS - 1)
        if pushed > BINS and last != BINS - 1:
            first, second, third = pushed & (BINS - 1), (pushed + 1) & (BINS - 1), (pushed + 2) & (BINS - 1)
            for row in range(ROWS):
                across = 3.0 * (bins[row, level, last] - bins[row, level, first])
                slope[row, level] = (across + bins[row, level, third] - bins[row, level, second]) * per_s
        if longer == 0:
            return
        count = longer
        per_s *= 0.5


@kernel
def _note_window(p: ControllerParams, s: ControllerMemory, level: int, learn: bool) -> None:
    """Use the slopes of a window that begins at the end of the last window: their differences give the noise."""
    slope, before, sigma = s.slope, s.slope_before, s.sigma
    if learn:
        both = p.use_force == 1 and p.use_slide_position == 1 and s.stiffness_learnt == 1
        s.differences[level] += 1
        count = s.differences[level]
        up = _UP if count >= _MANY else math.exp(0.25 * max(_FIRST_SHARE / count, _LEAST_SHARE))
        law_mps = 0.0
        for row in range(ROWS):
            bend = slope[row, level] - 2.0 * before[row, level, 0] + before[row, level, 1]
            law_mps += bend * (s.compliance_m_per_N if row == FORCE else 1.0 if row == SLIDE else -1.0)
            sigma[row, level] = _moved(sigma[row, level], math.fabs(bend) * _OF_BEND, up, count)
        if both:
            s.agreements[level] += 1
            count = s.agreements[level]
            up = _UP_OF_LAW if count >= _MANY_OF_LAW else math.exp(0.25 * _FIRST_SHARE / count)
            s.law_mps[level] = _moved(s.law_mps[level], math.fabs(law_mps) * _OF_BEND, up, count)
        _note_noise(p, s, level, both)
    for row in range(ROWS):
        before[row, level, 1] = before[row, level, 0]
        before[row, level, 0] = slope[row, level]


@kernel
def _moved(sigma: float, apart: float, up: float, count: int) -> float:
    """The scale after a further difference `apart`: a step `up`, or three steps down; balanced at the lower quartile."""
    if count <= 4 or sigma == 0.0:  # the scale begins as the mean of the first four
        return sigma + (1.25 * apart - sigma) / min(count, 4)
    return sigma / (up * up * up) if apart < _QUARTILE * sigma else sigma * up


@kernel
def clear_windows(s: ControllerMemory) -> None:
    """Empty the windows; the noise stays."""
    for level in range(LEVELS):
        s.pushed[level] = 0


@kernel
def _note_noise(p: ControllerParams, s: ControllerMemory, level: int, both: bool) -> None:
    """Set the noise of the slopes of a level, and of longer windows whose noise is not measured yet."""
    for row in range(ROWS):
        for i in range(level, p.levels):
            if s.differences[i] >= FEWEST:
                if i > level:
                    break
                measured = s.sigma[row, i]
            elif i > 0 and s.noise[row, i - 1] > 0.0:
                measured = s.noise[row, i - 1] * _WHITE * (_CARRIED if s.differences[i - 1] >= FEWEST else 1.0)
            else:
                break
            step = OF_STEP * s.resolution[row] / p.window_s[i]
            s.noise[row, i] = math.sqrt(measured * measured + step * step)
    # only under vibration: without it the swing after a slip would count as further slips
    if both and s.allowed_m > 0.0 and s.agreements[level] >= WELL_KNOWN:
        off_mps = math.sqrt(s.law_mps[level] * s.law_mps[level] + s.noise[DRIVE, level] * s.noise[DRIVE, level])
        s.noise[FORCE, level] = min(s.noise[FORCE, level], off_mps / s.compliance_m_per_N)
        s.noise[SLIDE, level] = min(s.noise[SLIDE, level], off_mps)


@kernel
def note_steps(s: ControllerMemory, row: int, samples: Record) -> None:
    """Learn the quantisation step of a row: the smallest change from sample to sample."""
    last = np.float64(samples[0])
    for i in range(1, samples.shape[0]):
        value = np.float64(samples[i])
        change = math.fabs(value - last)
        # float32 in a message rounds each value by 1e-7, so smaller changes are not steps
        if change > 2e-7 * math.fabs(value) and (s.resolution[row] == 0.0 or change < s.resolution[row]):
            s.resolution[row] = change
        last = value
