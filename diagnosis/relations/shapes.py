"""Shapes of columns: a channel behind a mode, or as a free function of a variable."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.signal import lfilter, savgol_filter

from diagnosis.features.grid import BLOCK_S
from diagnosis.relations.relation import Floats, Term

MODES_HZ = np.geomspace(25.0, 320.0, 30)  # of frame and base: a ringing is some periods long, so steps of 9 %
_MOVES = 8.0  # standard deviations of this speed above the usual one, from which the slide moves
_AROUND_BLOCKS, _EDGE_BLOCKS = 30, 8.0  # around a motion that count as near it, and the soft edge
# Window and order of the polynomials. Quick: keeps 95 % of 100 Hz. Slow: a stick is a straight line with a bow.
_QUICK, _SLOW = (9, 4), (81, 2)


def rate(values: Floats) -> Floats:
    """First derivative of `values` [blocks], in their unit per s."""
    return np.asarray(np.gradient(values, BLOCK_S), np.float64)


def bend(values: Floats) -> Floats:
    """Second derivative of `values` [blocks], in their unit per s2; 0 at the ends."""
    result = np.zeros(len(values))
    result[1:-1] = (values[2:] - 2.0 * values[1:-1] + values[:-2]) / BLOCK_S**2
    return result


def near_slips(position_m: Floats) -> Floats:
    """Weight of each block, [blocks]: 1 near a motion that is faster than creep, 0 where the slide sticks, with soft edges."""
    speed = np.abs(np.asarray(savgol_filter(position_m, *_QUICK, deriv=1)))
    usual = np.median(speed)
    noise = 1.4826 * np.median(np.abs(speed - usual))
    moves = speed > usual + _MOVES * noise
    about = maximum_filter1d(moves.astype(np.float64), 2 * _AROUND_BLOCKS + 1)
    return np.asarray(gaussian_filter1d(about, _EDGE_BLOCKS))


def calmed(values: Floats, near: Floats) -> Floats:
    """`values` [blocks] with the noise of a channel taken off where nothing slips, `near` from `near_slips`.

    A column holds the noise of its channel, and the residual of a relation holds the same noise. Without this the two would be
    correlated, and causes that filter a channel would be found in noise alone.
    """
    quick, slow = (np.asarray(savgol_filter(values, *window)) for window in (_QUICK, _SLOW))
    return slow + near * (quick - slow)


def mode(values: Floats, frequency_Hz: float, damping_ratio: float) -> Floats:
    """`values` [blocks] as a swinging mode of unit stiffness follows them (bilinear transform, exact at its frequency)."""
    omega = 2.0 * math.pi * frequency_Hz
    warped = omega / math.tan(0.5 * omega * BLOCK_S)
    steady, first, second = omega * omega, 2.0 * damping_ratio * omega * warped, warped * warped
    over = steady + first + second
    ahead = np.array([1.0, 2.0, 1.0]) * steady / over
    back = np.array([1.0, 2.0 * (steady - second) / over, (steady - first + second) / over])
    return np.asarray(lfilter(ahead, back, values - values[0])) + values[0]


def free(what: str, over: Sequence[Floats], count: int) -> Term:
    """A pattern: any function of a variable, as broken lines between `count` knots; `over` is [rows of the run] each."""
    knots = knots_of(np.concatenate(over), count)
    return Term(what, "", tuple(hats(values, knots) for values in over), math.nan)


def slip_phase(velocity: Floats, slip_s: float) -> Floats:
    """log10 of the time [s] since the slide last began to move as fast as in a slip, [blocks]: slips look alike over it."""
    fast = np.abs(velocity) > 0.3 * np.quantile(np.abs(velocity), 0.995)
    at = np.arange(len(velocity), dtype=np.float64)
    begins = fast & ~np.concatenate(([False], fast[:-1]))
    last = np.maximum.accumulate(np.where(begins, at, -1.0))
    return np.asarray(np.log10(np.where(last < 0.0, 10.0 * slip_s / BLOCK_S, at - last + 1.0) * BLOCK_S))


def hats(values: Floats, knots: Floats) -> Floats:
    """Linear interpolation between `knots` as columns, [rows, knots]: any function of `values` as broken lines."""
    place = np.clip(np.searchsorted(knots, values) - 1, 0, len(knots) - 2)
    share = np.clip((values - knots[place]) / (knots[place + 1] - knots[place]), 0.0, 1.0)
    result = np.zeros((len(values), len(knots)))
    rows = np.arange(len(values))
    result[rows, place] = 1.0 - share
    result[rows, place + 1] = share
    return result


def knots_of(values: Floats, count: int) -> Floats:
    """At most `count` knots, each with as much of `values` between it and the next; two knots where they are nearly equal."""
    knots = np.unique(np.quantile(values, np.linspace(0.0, 1.0, count)))
    least = 1e-9 * max(float(np.abs(values).max()), 1e-30)
    knots = knots[np.concatenate(([True], np.diff(knots) > least))]
    return knots if len(knots) > 1 else np.array([knots[0] - 1.0, knots[0] + 1.0])
