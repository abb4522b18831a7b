"""Fitted parameters with their intervals."""

import math

import numpy as np

from diagnosis.fits.fit import Fit
from diagnosis.hypotheses.hypothesis import Coordinate
from diagnosis.model.per_run import is_phase
from diagnosis.result import Estimate

_TWO_SIDED_90 = 1.645


def estimates_of(fit: Fit) -> dict[str, dict[str, Estimate]]:
    """The parameters of every effect of a fit, by effect and name."""
    deviation = np.sqrt(np.diag(fit.covariance()))[len(fit.deviations) :]
    result: dict[str, dict[str, Estimate]] = {name: {} for name in fit.effects}
    for coordinate, w, spread in zip(fit.hypothesis.coordinates, fit.w.tolist(), deviation.tolist(), strict=True):
        result[coordinate.effect][coordinate.name] = estimate_of(coordinate, w, spread)
    return result


def estimate_of(coordinate: Coordinate, w: float, deviation: float) -> Estimate:
    """A parameter with its 90 % interval, from the value of its coordinate and that value's standard deviation."""
    value, half = coordinate.value(w), _TWO_SIDED_90 * deviation
    if is_phase(coordinate.name):  # at most half a turn to either side, without wrapping at pi
        half = min(half * coordinate.scale, math.pi)
        return Estimate(value, (value - half, value + half))
    low, high = sorted((coordinate.value(w - half), coordinate.value(w + half)))
    return Estimate(value, (low, high))
