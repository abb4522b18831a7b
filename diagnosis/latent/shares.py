"""Shares of the difference on the held-out rows that each cause predicts, with intervals and nulls.

About the mean of the fitted rows, a prediction p that is the sum of p_c over the causes takes y'y - (y - p)'(y - p) of the
squares, the sum of p_c'(2 y - p): these are the shares. They add up to 1 with the remainder, and are negative where a cause
predicts worse than the mean.
"""

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from bridge.arrays import Floats, Indices
from diagnosis.latent.causes import NOISE, SCATTER, Causes, causes_of
from diagnosis.latent.pursuit import Chosen, predicted
from diagnosis.latent.rows import ExcessRows
from diagnosis.relations.shares import interval_90

# Records without the cause. With 10 a null of the development sets moves by up to 0.09, with 100 by 0.003 at twice the CPU.
_DRAWS = 40
_PIECES = 10  # of the held-out rows, for the interval
# A size agrees within this part of itself: a prediction of twice the true size is as bad as the mean. At 1.0 a drift of the force
# sensor is named as a matter of direction (1 of 37 development cases); 0.25 changes nothing there.
_AGREES = 0.5


class LatentShare(NamedTuple):
    """The share of one cause."""

    what: str
    share: float  # of the squares of the held-out rows about the mean of the fitted rows
    interval_90: tuple[float, float] | None  # None for the noise of the sensor
    null_90: float | None  # share in 9 of 10 records that lack the cause; None for scatter and noise
    agrees: bool  # the size is the same in every run

    @property
    def beyond_chance(self) -> bool:
        """Whether the whole interval lies above the null."""
        return self.null_90 is not None and self.interval_90 is not None and self.interval_90[0] > self.null_90


class Split(NamedTuple):
    """The shares of one signal."""

    shares: tuple[LatentShare, ...]  # the largest first, then scatter and noise; they add up to 1
    one_pass: bool  # place and time are one variable in these rows
    slow: float  # part of the remainder that is the same from row to row: its correlation with the next row


def shares_of(rows: ExcessRows) -> Split:
    """Fit the rows that are not held out, and split those that are."""
    fit, held = np.flatnonzero(~rows.held_out), np.flatnonzero(rows.held_out)
    causes = causes_of(rows, fit)
    y = rows.excess_N - rows.excess_N[fit].mean()
    chosen = predicted(causes, y, fit, rows.run)
    left = y - chosen.whole
    squares = max(float(y[held] @ y[held]), 1e-30)
    shares: list[LatentShare] = []
    for what in dict.fromkeys(chosen.owners):
        taken = _taken(chosen, what, y)[held]
        null = _null(causes, what, y, fit, held, rows.run)
        share = float(taken.sum()) / squares
        shares.append(
            LatentShare(what, share, _interval(taken, y[held]), null, _agrees(chosen, what, y, rows.run, fit))
        )
    shares.sort(key=lambda share: -share.share)
    noise = rows.noise_N**2 * len(held) / squares
    scatter = left[held] ** 2 - rows.noise_N**2
    shares.append(LatentShare(SCATTER, float(scatter.sum()) / squares, _interval(scatter, y[held]), None, agrees=False))
    shares.append(LatentShare(NOISE, noise, None, None, agrees=False))
    return Split(tuple(shares), causes.one_pass, _next_row(left))


def _taken(chosen: Chosen, what: str, y: Floats) -> Floats:
    """Squares that a cause takes from each row, [rows]."""
    return chosen.of(what) * (2.0 * y - chosen.whole)


def _interval(parts: Floats, y: Floats) -> tuple[float, float]:
    """90 % interval of sum(parts) over sum(y^2), from pieces: neighbouring rows are not independent."""
    pieces = np.linspace(0, len(y), min(_PIECES, len(y)), endpoint=False).astype(np.int64)
    return interval_90(np.add.reduceat(parts, pieces), np.add.reduceat(y * y, pieces))


def _next_row(left: Floats) -> float:
    """Correlation of a row with the next one."""
    about = left - left.mean()
    return float(about[1:] @ about[:-1]) / max(float(about @ about), 1e-30)


def _null(causes: Causes, what: str, y: Floats, fit: Indices, held: Indices, run: Indices) -> float:
    """The share of a cause in 9 of 10 records that lack it.

    A record is the prediction of the other causes plus scatter with the size and the correlation of their remainder, from row to
    row (autoregressive of order 1) and from run to run. The result is at least 0, the share of the mean.
    """
    others = predicted(causes.without(what), y, fit, run).whole
    left = (y - others)[fit]
    numbers, of_row = np.unique(run, return_inverse=True)
    level = np.array([left[run[fit] == number].mean() for number in np.unique(run[fit])])
    inside = left - level[np.unique(run[fit], return_inverse=True)[1]]
    next_row = min(max(_next_row(inside), 0.0), 0.999)
    random = np.random.default_rng(2)
    shares: list[float] = []
    for _ in range(_DRAWS):
        white = random.normal(0.0, float(inside.std()), len(y))
        white[1:] *= (1.0 - next_row**2) ** 0.5
        scatter = np.asarray(lfilter([1.0], [1.0, -next_row], white))
        record = others + scatter + random.normal(0.0, float(np.std(level)), len(numbers))[of_row]
        record -= record[fit].mean()
        chosen = predicted(causes, record, fit, run)
        shares.append(float(_taken(chosen, what, record)[held].sum()) / max(float(record[held] @ record[held]), 1e-30))
    return max(float(np.quantile(shares, 0.9)), 0.0)


def _agrees(chosen: Chosen, what: str, y: Floats, run: Indices, fit: Indices) -> bool:
    """Whether no run has a size of the cause that differs by half of it, and by two standard errors."""
    course = chosen.of(what)
    left = y - chosen.whole
    next_row = min(max(_next_row(left[fit]), 0.0), 0.999)
    independent = (1.0 + next_row) / (1.0 - next_row)  # rows for one independent row
    for number in np.unique(run):
        rows = run == number
        square = max(float(course[rows] @ course[rows]), 1e-30)
        off = abs(float(course[rows] @ left[rows])) / square
        error = float(left[rows].std()) * (independent / square) ** 0.5
        if off > max(_AGREES, 2.0 * error):
            return False
    return True
