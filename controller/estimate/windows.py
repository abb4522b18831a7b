"""Slopes of the signals in windows from four bins to seconds, and the noise of each slope.

Level j has windows twice as long as level j - 1, of four bins each. A stiff axis needs a window of 0.4 ms, and a creep feed a
window of a second, so all levels run in parallel and `contact` takes the shortest window whose signal exceeds its noise.

The noise of a level is measured: the slopes of three successive windows lie on a line except for noise (the idea of the Hadamard
deviation), so it contains hum, drift and quantisation as well as white noise, but not a swing that is slow against the window.
The scale is the lower quartile of the deviations, which a minority of disturbances by slips and re-sticks changes little.

A slide that swings or slips with about the period of the windows bends their slopes as noise does, but in force and position
alike, by the spring's law x_d' - x_s' = c F'. So the deviation from this law and the drive's noise together bound the noise.
"""

import math

from bridge.kernel import hypot, kernel
from bridge.layouts import ControllerMemory, ControllerParams

BINS = 4  # bins in a window; a power of 2
MOST_FRESH = 16  # most bins that are added in a call
LEVELS = 16  # most levels; `levels` of the parameters is the number in use
FORCE, SLIDE, DRIVE = 0, 1, 2  # rows: drive force [N], slide position [m], drive position [m]
ROWS = 3
_OF_BEND = 6.0**-0.5  # sigma of a slope over the sigma of a - 2 b + c of three successive slopes
_QUARTILE = 0.3186  # lower quartile of |d| of a normal distribution, over its sigma
WHITE = 2.0**-1.5  # noise of a slope over the noise at half the window, for white noise
# Differences until the level's measured noise is used, and at which it counts twice; before, the noise of shorter windows is
# extrapolated as white noise. Smaller: with 7 a resting drive moves once in the first second of one run of eight. Larger: the
# start of a run is seen later, by 5 ms from 7 to 10.
FEWEST = 10
WELL_KNOWN = 40  # bins after which a channel's noise is known
_LEAST_STEP = 0.00125  # least relative change of sigma by a difference, at which it scatters by 6 %
SIGMAS = 6.0  # detection limit of every window: error rate of 1e-9, one in 100 hours of windows of 1 ms at most
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
        c, count = s.compliance_m_per_N, s.differences[level] + 1
        s.differences[level], law_mps = count, 0.0
        for row in range(ROWS):
            bend = slope[row, level] - 2.0 * before[row, level, 0] + before[row, level, 1]
            law_mps += bend * (c if row == FORCE else 1.0 if row == SLIDE else -1.0)
            sigma[row, level] = _moved(sigma[row, level], math.fabs(bend), count)
        s.law_mps[level] = _moved(s.law_mps[level], math.fabs(law_mps), count)
        _note_noise(p, s, level)
        if c > 0.0 and p.use_force == 1 and p.use_slide_position == 1:
            off_mps = hypot((1.0 + FEWEST / count) * s.law_mps[level], s.noise[DRIVE, level])
            s.noise[FORCE, level] = min(s.noise[FORCE, level], off_mps / c)
            s.noise[SLIDE, level] = min(s.noise[SLIDE, level], off_mps)
    for row in range(ROWS):
        before[row, level, 1] = before[row, level, 0]
        before[row, level, 0] = slope[row, level]


@kernel
def _moved(sigma: float, bend: float, count: int) -> float:
    """Sigma after difference number `count`: a step up, or three steps down, which are balanced at the lower quartile."""
    bend *= _OF_BEND
    if count <= 4 or sigma == 0.0:  # sigma begins as the mean of the first four
        return sigma + (1.25 * bend - sigma) / min(count, 4)
    up = 1.0 + max(1.0 / count, _LEAST_STEP)
    return sigma * up if bend > _QUARTILE * sigma else sigma / (up * up * up)


@kernel
def clear_windows(s: ControllerMemory) -> None:
    """Empty the windows; the noise stays."""
    for level in range(LEVELS):
        s.pushed[level] = 0


@kernel
def _note_noise(p: ControllerParams, s: ControllerMemory, level: int) -> None:
    """Set the noise of the slopes of a level, and of longer windows whose noise is not measured yet."""
    for i in range(level, p.levels):
        count = s.differences[i]
        if i > level and count >= FEWEST:
            return
        for row in range(ROWS):
            extrapolated = WHITE * s.noise[row, i - 1] if i > 0 else 0.0
            known = s.sigma[row, i] * (1.0 + FEWEST / count) if count >= FEWEST else extrapolated
            step = OF_STEP * s.resolution[row] / p.window_s[i]
            s.noise[row, i] = math.sqrt(known * known + step * step) if known > 0.0 or count >= FEWEST else 0.0
