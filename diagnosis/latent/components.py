"""The processes that a level of friction may be made of, each as a covariance over the rows.

Every covariance is centred, as the mean of the rows is a fixed effect, and has a mean diagonal of 1: its variance is then the one
that the process adds to these rows. A process that the rows cannot show is left out.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from diagnosis.latent.rows import BREAKAWAY, ExcessRows, Floats

PLACE, ROUGH, FORCE_PLACE = "position-dependent-friction", "rough track", "place-dependent force"
DIRECTION, TIME, LOAD = "direction-dependent-friction", "friction-drift", "load-dependent friction"
SPEED, RUN, WANDER = "friction over speed", "difference between runs", "slow scatter"
MASS, CLOCKS = "inertia", "clocks apart"
SCATTER, NOISE = "scatter", "noise"

_SPEEDS = 0.1  # spread of the logarithm of the speed from which a curve over the speed shows
_REVISITED = 0.3  # share of rows that have a neighbour in place which is far in time, from which places are revisited
_LOAD_VARIES = 0.02  # relative
_NEAR_ROWS = 2.0  # times the usual distance of rows: shortest length of a process along the track
# Shortest length of what goes with place, where a rough track is there besides: in lengths of the rough track
_LONG = 4.0
_CENTRED = 1e-9  # mean diagonal below which a centred covariance is constant


class Length(NamedTuple):
    """A length of a process, by its logarithm: where a fit begins, and its bounds."""

    name: str
    start: float
    low: float
    high: float


class Component(NamedTuple):
    """A process: its covariance over the rows from the lengths, [rows, rows]."""

    what: str
    covariance: Callable[[dict[str, float]], Floats]
    lengths: tuple[str, ...] = ()


class ComponentModel(NamedTuple):
    """The processes of one signal and their lengths."""

    components: tuple[Component, ...]
    lengths: tuple[Length, ...]
    revisited: bool  # whether the rows come back to places at other times: only then place and time are two things


def model_of(rows: ExcessRows) -> ComponentModel:
    """The processes that these rows can show."""
    both = len(np.unique(rows.sign)) > 1
    revisited = _revisited(rows)
    apart = np.abs(np.subtract.outer(rows.place_m, rows.place_m))
    components = [_along(PLACE, "place", apart, matern)]
    step_m = max(_spacing(rows.place_m), 1e-12)
    track_m = max(float(np.ptp(rows.place_m)), 4.0 * step_m)
    shortest = math.log(_NEAR_ROWS * step_m)
    lengths = [
        Length(
            "place",
            math.log(0.1 * track_m),
            min(math.log(_LONG) + shortest, math.log(0.1 * track_m)),
            math.log(track_m),
        )
    ]
    time = np.abs(np.subtract.outer(rows.t_s, rows.t_s))
    if rows.signal == BREAKAWAY or not revisited:
        components.append(_along(ROUGH, "rough", apart, rough))
        lengths.append(Length("rough", shortest, math.log(0.5 * step_m), math.log(_NEAR_ROWS * _LONG * step_m)))
    else:
        # what a pass adds and the next one does not find again is no track
        step_s = max(_spacing(rows.t_s), 1e-12)
        components.append(_along(WANDER, "wander", time, rough))
        lengths.append(Length("wander", math.log(2.0 * step_s), math.log(0.5 * step_s), math.log(20.0 * step_s)))
    if both:
        ways = np.outer(rows.sign, rows.sign)
        components.append(Component(DIRECTION, _fixed(unit(ways))))
        components.append(_along(FORCE_PLACE, "place", apart, matern, rows.sign))
    if revisited:
        drift = matern(time, 0.5 * max(float(np.ptp(rows.t_s)), 1e-12))
        components.append(Component(TIME, _fixed(unit(drift))))
    speed = np.log(np.maximum(rows.speed_mps, 1e-12))
    if float(speed.std()) > _SPEEDS:
        components.append(Component(SPEED, _fixed(unit(matern(np.abs(np.subtract.outer(speed, speed)), 1.0)))))
    if len(np.unique(rows.run)) > 1:
        components.append(Component(RUN, _fixed(unit(np.equal.outer(rows.run, rows.run).astype(float)))))
    if rows.load_N is not None and float(rows.load_N.std()) > _LOAD_VARIES * abs(float(rows.load_N.mean())):
        components.append(Component(LOAD, _fixed(line(rows.load_N))))
    for what, values in ((MASS, rows.pull_N), (CLOCKS, rows.rate_N_per_s)):
        if values is not None and float(values.std()) > 0.0:
            components.append(Component(what, _fixed(line(values))))
    components.append(Component(SCATTER, _fixed(unit(np.eye(len(rows.excess_N))))))
    return ComponentModel(tuple(components), tuple(lengths), revisited)


def matern(apart: Floats, length: float) -> Floats:
    """Matern covariance of smoothness 3/2 over distances."""
    scaled = math.sqrt(3.0) * apart / length
    return (1.0 + scaled) * np.exp(-scaled)


def rough(apart: Floats, length: float) -> Floats:
    """Covariance of a path without a slope, over distances."""
    return np.exp(-apart / length)


def line(values: Floats) -> Floats:
    """Covariance of a proportion to `values`."""
    about = values - values.mean()
    return unit(np.outer(about, about))


def centred(covariance: Floats) -> Floats:
    """Without what is the same for all rows."""
    mean = covariance.mean(axis=0)
    return covariance - mean[:, None] - mean[None, :] + mean.mean()


def unit(covariance: Floats) -> Floats:
    """Centred, with a mean diagonal of 1; zero where nothing is left."""
    result = centred(covariance)
    size = float(np.trace(result)) / len(result)
    return result / size if size > _CENTRED else np.zeros_like(result)


def _along(
    what: str, length: str, apart: Floats, shape: Callable[[Floats, float], Floats], sign: Floats | None = None
) -> Component:
    """A process over distances; with `sign`, [rows], of a force that does not change its direction with the motion."""

    def covariance(at: dict[str, float]) -> Floats:
        correlation = shape(apart, math.exp(at[length]))
        return unit(correlation if sign is None else np.outer(sign, sign) * centred(correlation))

    return Component(what, covariance, (length,))


def _fixed(covariance: Floats) -> Callable[[dict[str, float]], Floats]:
    return lambda _: covariance


def _spacing(values: Floats) -> float:
    """The usual distance from one row to the next."""
    steps = np.abs(np.diff(np.sort(values)))
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if len(steps) else 0.0


def _revisited(rows: ExcessRows) -> bool:
    """Whether many rows have a neighbour in place that is far away in time."""
    order = np.argsort(rows.place_m, kind="stable")
    gone = np.abs(np.diff(rows.t_s[order]))
    usual_s = float(np.median(np.diff(np.sort(rows.t_s))))
    return float((gone > 10.0 * usual_s).mean()) > _REVISITED
