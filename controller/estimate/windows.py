"""Slopes of the signals in windows from four bins to seconds, and the noise of each slope.

Level j has windows twice as long as level j - 1, of four bins each. A stiff axis needs a window of 0.4 ms and a creep feed one
of a second, so all of them run at once and `contact` takes the shortest that stands out from its noise.

The noise of a level is measured, not assumed: the slopes of three windows side by side lie on a line but for noise (the idea of
the Hadamard deviation), so hum, drift and quantisation are in it as well as white noise, and a swing that is slow against the
window is not. The scale is the lower quartile of how far they are off: slips and re-sticks disturb most of them before
they move it by much.
"""

import math

import numpy as np

from bridge.kernel import Record, kernel

BINS = 4  # in a window
LEVELS = 16  # at most; `levels` of the parameters says how many are used
FORCE, SLIDE, DRIVE = 0, 1, 2  # rows: drive force [N], slide position [m], drive position [m]
ROWS = 3
_OF_BEND = 6.0**-0.5  # sigma of a slope over that of a - 2 b + c
_QUARTILE = 0.3186  # of |d| of a normal distribution, over its sigma
_WHITE = 2.0**-1.5  # noise of a slope over the noise at half the window, for white noise
# Differences until a level's own noise is used; before, that of shorter windows is carried on as white noise.
_FEWEST = 10
WELL_KNOWN = 40  # differences from which a level's noise is off by some per cent only
_CARRIED = 1.3  # factor for a noise that is carried on: ten differences are 20 % off, and no noise is quite white
_FIRST_SHARE, _LEAST_SHARE = 4.0, 0.005  # of the logarithm of sigma that one difference moves; 6 % of scatter at 0.005
# Largest error of a slope by a quantisation step q over a window is q / W; uniform in a step it is 0.29 of that.
OF_STEP = 0.29


@kernel
def push(p: Record, s: Record, force_N: float, slide_m: float, drive_m: float, learn: bool) -> None:
    """Add the means of one bin; `learn` says whether they are measured, so that their noise counts."""
    bins, carried, slope, before, sigma = s.bins, s.carried, s.slope, s.slope_before, s.sigma
    a, b, c = force_N, slide_m, drive_m
    width_s = p.bin_s
    for level in range(p.levels):
        pushed = s.pushed[level]
        at = pushed % BINS
        bins[FORCE, level, at], bins[SLIDE, level, at], bins[DRIVE, level, at] = a, b, c
        pushed += 1
        s.pushed[level] = pushed
        if pushed >= BINS:
            first, second, third = pushed % BINS, (pushed + 1) % BINS, (pushed + 2) % BINS
            for row in range(ROWS):
                across = 3.0 * (bins[row, level, at] - bins[row, level, first])
                slope[row, level] = (across + bins[row, level, third] - bins[row, level, second]) / (10.0 * width_s)
            if at == BINS - 1:
                if pushed >= 3 * BINS and learn:
                    s.differences[level] += 1
                    share = max(_FIRST_SHARE / s.differences[level], _LEAST_SHARE)
                    for row in range(ROWS):
                        bend = slope[row, level] - 2.0 * before[row, level, 0] + before[row, level, 1]
                        apart = math.fabs(bend) * _OF_BEND
                        sigma[row, level] = _moved(sigma[row, level], apart, share, s.differences[level])
                    _note_noise(p, s, level)
                for row in range(ROWS):
                    before[row, level, 1] = before[row, level, 0]
                    before[row, level, 0] = slope[row, level]
        if pushed % 2 == 1:
            carried[FORCE, level], carried[SLIDE, level], carried[DRIVE, level] = a, b, c
            return
        a, b, c = (
            0.5 * (carried[FORCE, level] + a),
            0.5 * (carried[SLIDE, level] + b),
            0.5 * (carried[DRIVE, level] + c),
        )
        width_s *= 2.0


@kernel
def _moved(sigma: float, apart: float, share: float, count: int) -> float:
    """The scale of the differences after one more of them."""
    if count <= 4 or sigma == 0.0:  # the mean of the first
        return sigma + (1.25 * apart - sigma) / min(count, 4)
    if apart < _QUARTILE * sigma:
        return sigma * math.exp(-0.75 * share)
    return sigma * math.exp(0.25 * share)


@kernel
def begin_anew(s: Record) -> None:
    """Empty the windows; the noise stays."""
    for level in range(LEVELS):
        s.pushed[level] = 0


@kernel
def _note_noise(p: Record, s: Record, level: int) -> None:
    """Set the noise of the slopes of a level, and of those longer windows whose own is not known yet."""
    for row in range(ROWS):
        for i in range(level, p.levels):
            if s.differences[i] >= _FEWEST:
                if i > level:
                    break
                measured = s.sigma[row, i]
            elif i > 0 and s.noise[row, i - 1] > 0.0:
                measured = s.noise[row, i - 1] * _WHITE * (_CARRIED if s.differences[i - 1] >= _FEWEST else 1.0)
            else:
                break
            step = OF_STEP * s.resolution[row] / p.window_s[i]
            s.noise[row, i] = math.sqrt(measured * measured + step * step)


@kernel
def note_steps(s: Record, row: int, samples: Record) -> None:
    """Learn the quantisation step of a row: the smallest change from sample to sample."""
    last = np.float64(samples[0])
    for i in range(1, samples.shape[0]):
        value = np.float64(samples[i])
        change = math.fabs(value - last)
        # a float32 of the wire rounds the steps themselves, by 1e-7 of the value
        if change > 2e-7 * math.fabs(value) and (s.resolution[row] == 0.0 or change < s.resolution[row]):
            s.resolution[row] = change
        last = value
