"""Position and velocity of a drive over the time of a run, in either direction: pieces of constant jerk.

A jerk-limited move has seven of them, as in Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots,
2008, section 3.4: the acceleration grows, holds and falls, the velocity holds, and three mirrored pieces brake. A move too short
for its velocity has the highest peak velocity from which it still stops in time.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats

_CLOSED_M = 1e-12  # a cycle ending this near to its beginning counts as closed: rounding, 1 um in a million cycles


class DriveMotion(NamedTuple):
    """Motion of a drive that starts at 0 m. The pieces, [pieces], follow each other; the last one lasts to the period's end."""

    start_s: Floats
    position_m: Floats
    velocity_mps: Floats
    acceleration_mps2: Floats
    jerk_mps3: Floats
    period_s: float = math.inf  # length of a cycle; inf: the motion runs once
    drift_m: float = 0.0  # displacement over a cycle


class Move(NamedTuple):
    """A move from standstill to standstill, then a stop."""

    distance_m: float  # below 0: backwards
    velocity_mps: float  # this and the next two are limits, above 0
    acceleration_mps2: float
    jerk_mps3: float
    dwell_s: float


def of_profile(points: Sequence[tuple[float, float]]) -> DriveMotion:
    """The motion of points (time [s], velocity [m/s]): linear velocity between them, constant outside of them."""
    times_s, velocities_mps = np.array(points).T
    start_s = np.unique([0.0, *times_s[times_s > 0.0]])
    velocity_mps = np.interp(start_s, times_s, velocities_mps)
    length_s, gain_mps = np.diff(start_s), np.diff(velocity_mps)
    travel_m = 0.5 * (velocity_mps[1:] + velocity_mps[:-1]) * length_s
    position_m = np.append(0.0, np.cumsum(travel_m))
    return DriveMotion(start_s, position_m, velocity_mps, np.append(gain_mps / length_s, 0.0), np.zeros(len(start_s)))


def of_moves(moves: Iterable[Move]) -> DriveMotion:
    """The motion of moves, one after the other, at rest after the last one."""
    rows: list[tuple[float, float, float, float, float]] = []
    begin_s = begin_m = 0.0
    for move in moves:
        at_s, at_m, v, a = begin_s, begin_m, 0.0, 0.0
        for length_s, jerk in _pieces(move):
            rows.append((at_s, at_m, v, a, jerk))
            at_s += length_s
            at_m += length_s * (v + length_s * (a / 2.0 + length_s * jerk / 6.0))
            v += length_s * (a + length_s * jerk / 2.0)
            a += length_s * jerk
        # the exact end of the move, so that rounding does not add up to a drift
        begin_m += move.distance_m
        if move.dwell_s > 0.0:
            rows.append((at_s, begin_m, 0.0, 0.0, 0.0))
        begin_s = at_s + move.dwell_s
    rows.append((begin_s, begin_m, 0.0, 0.0, 0.0))
    return DriveMotion(*np.array(rows).T)


def peak_mps(move: Move) -> float:
    """The speed that a move reaches [m/s]: its velocity, or less for a short move."""
    distance_m, v, a, j = abs(move.distance_m), move.velocity_mps, move.acceleration_mps2, move.jerk_mps3
    if distance_m >= v * _ramp_s(v, a, j):
        return v
    # two ramps without a cruise between them: with the full acceleration, or a lower peak if that is not reached
    full = 0.5 * a * (math.sqrt((a / j) ** 2 + 4.0 * distance_m / a) - a / j)
    return full if full >= a * a / j else (0.25 * distance_m * distance_m * j) ** (1.0 / 3.0)


def _ramp_s(v: float, a: float, j: float) -> float:
    """Time from standstill to the velocity v [s]; the distance is half of v times this."""
    return v / a + a / j if v * j >= a * a else 2.0 * math.sqrt(v / j)


def _pieces(move: Move) -> list[tuple[float, float]]:
    """Duration [s] and jerk [m/s3] of the pieces of a move, without its stop."""
    if move.distance_m == 0.0:
        return []
    v, a, j = peak_mps(move), move.acceleration_mps2, move.jerk_mps3
    ramp_s = _ramp_s(v, a, j)
    grows_s = min(a / j, 0.5 * ramp_s)
    holds_s = ramp_s - 2.0 * grows_s
    cruise_s = max(abs(move.distance_m) / v - ramp_s, 0.0)
    jerk = math.copysign(j, move.distance_m)
    pieces = [
        *((grows_s, jerk), (holds_s, 0.0), (grows_s, -jerk)),
        (cruise_s, 0.0),
        *((grows_s, -jerk), (holds_s, 0.0), (grows_s, jerk)),
    ]
    return [piece for piece in pieces if piece[0] > 0.0]


def again_and_again(motion: DriveMotion, period_s: float) -> DriveMotion:
    """The motion, repeated with this period."""
    drift_m = float(position_m(motion, np.array([period_s]))[0])
    return motion._replace(period_s=period_s, drift_m=drift_m if abs(drift_m) > _CLOSED_M else 0.0)


def _within(motion: DriveMotion, t_s: Floats) -> tuple[Floats, npt.NDArray[np.intp], Floats]:
    """Whole periods before the times `t_s`, 0 or later; their pieces; the times since the pieces began [s]."""
    periods = np.floor(t_s / motion.period_s)
    phase_s = np.maximum(t_s - periods * motion.period_s if math.isfinite(motion.period_s) else t_s, 0.0)
    piece = np.searchsorted(motion.start_s, phase_s, side="right") - 1
    return periods, piece, phase_s - motion.start_s[piece]


def position_m(motion: DriveMotion, t_s: Floats) -> Floats:
    """Position of the drive [m] at the times `t_s` [s], 0 or later."""
    periods, piece, since_s = _within(motion, t_s)
    v, a, j = motion.velocity_mps[piece], motion.acceleration_mps2[piece], motion.jerk_mps3[piece]
    gained_m = since_s * (v + since_s * (a / 2.0 + since_s * j / 6.0))
    return motion.position_m[piece] + gained_m + periods * motion.drift_m


def velocity_mps(motion: DriveMotion, t_s: Floats) -> Floats:
    """Velocity of the drive [m/s] at the times `t_s` [s], 0 or later."""
    _, piece, since_s = _within(motion, t_s)
    gained_mps = since_s * (motion.acceleration_mps2[piece] + since_s * motion.jerk_mps3[piece] / 2.0)
    return motion.velocity_mps[piece] + gained_mps


def mean_velocity_mps(motion: DriveMotion, t_s: Floats, block_s: float) -> Floats:
    """Mean velocity [m/s] over the blocks that begin at `t_s` [s]: held over them, it gives the same positions."""
    return (position_m(motion, t_s + block_s) - position_m(motion, t_s)) / block_s


def reach_m(motion: DriveMotion, until_s: float) -> tuple[float, float]:
    """The lowest and the highest position of the drive [m] from 0 s to `until_s`."""
    periods = math.floor(until_s / motion.period_s)
    if periods == 0:
        return _reach_within(motion, until_s)
    once = _reach_within(motion, math.nextafter(motion.period_s, 0.0))
    rest = _reach_within(motion, max(until_s - periods * motion.period_s, 0.0))
    drifts_m = (0.0, (periods - 1) * motion.drift_m)
    ends_m = [end + drift_m for end in once for drift_m in drifts_m] + [end + periods * motion.drift_m for end in rest]
    return min(ends_m), max(ends_m)


def _reach_within(motion: DriveMotion, until_s: float) -> tuple[float, float]:
    """The lowest and the highest position [m] from 0 s to `until_s`, within the first period."""
    # begins of the pieces, and their turning points; pieces with a jerk belong to moves, which reverse only at rest
    with np.errstate(divide="ignore", invalid="ignore"):
        turn_s = motion.start_s - motion.velocity_mps / motion.acceleration_mps2
    turns = (turn_s > motion.start_s) & (turn_s < np.append(motion.start_s[1:], np.inf)) & (motion.jerk_mps3 == 0.0)
    times_s = np.array([*motion.start_s, *turn_s[turns], until_s])
    positions_m = position_m(motion, times_s[times_s <= until_s])
    return float(positions_m.min()), float(positions_m.max())


def lowest_mps(motion: DriveMotion, until_s: float) -> float:
    """The lowest velocity of the drive [m/s] from 0 s to `until_s`; below 0 if it reverses."""
    until_s = min(until_s, math.nextafter(motion.period_s, 0.0))
    begun = motion.start_s <= until_s
    return float(min(motion.velocity_mps[begun].min(), velocity_mps(motion, np.array([until_s]))[0]))
