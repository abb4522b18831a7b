"""A run in the terms of machine tools: following error, quadrant error at reversals, and the dose of vibration.

Following error: nominal less actual position, as numerical controls have it (Heidenhain, iTNC 530 technical manual, 6.8: "servo
lag"). Nominal is the drive's position, actual the slide's: without slips it is the give of the spring, F / k_d, and what the
zeros of both transducers are apart.

Quadrant error: the peak that friction leaves where an axis changes its sign, the "quadrant glitch" of circular tests (ISO 230-4
has such tests, but not this number). Here: the largest following error after a change of sign, until the slide has moved for as
long as it stood, less the mean from the end of that stick to the end of the stroke, which a constant correction takes away.

Dose: the integral of v_a^2 over time. It is energy-equivalent, as A(8) of ISO 5349-1 is for the acceleration of a hand, and says
nothing of people: their weightings end at 1 kHz.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.logfile import RunData
from bridge.wire import stickslip_pb2 as wire

Floats = npt.NDArray[np.floating[Any]]
Bools = npt.NDArray[np.bool_]

_FOLLOWS = 0.5  # of the drive's way: a slide that makes more has ended its stick
_AT_TURN_SIGMAS = 6.0  # of the drive's noise within which it is where it turned
_SEEN_SIGMAS = 10.0  # of the noise of both ways: the way of the drive on which its slide is judged


class Following(NamedTuple):
    """How the slide follows the drive in a stretch of a run, while the drive moves. From means of a block."""

    moving_s: float
    error_rms_m: float
    error_peak_m: float  # largest size
    error_ripple_m: float  # rms about the mean of each direction: what no constant offset takes away
    reversals: int  # changes of sign of the drive's velocity
    reversal_stick_s: float  # the longest time from one until the slide follows; 0 without reversals
    quadrant_error_m: float  # the largest; 0 without reversals


class Reversal(NamedTuple):
    """One change of sign of the drive's velocity."""

    t_s: float
    stick_s: float  # until the slide makes half of the drive's way; to the end of the stroke if it never does
    quadrant_error_m: float  # 0 where the slide never follows


class Motion(NamedTuple):
    """A run block by block, [blocks] each, and its reversals."""

    t_s: Floats
    error_m: Floats | None  # drive less slide; None where one of them has no position
    direction: npt.NDArray[np.int64]  # of the drive, 0 where it stands
    dose_m2_per_s: Floats  # v_a^2 times the block, 0 where the exciter rests
    reversals: list[Reversal]
    block_s: float

    def following(self, counts: Callable[[Floats], Bools]) -> Following | None:
        """The blocks and reversals whose times count; None where none moves, or a position is missing."""
        chosen = counts(self.t_s) & (self.direction != 0)
        if self.error_m is None or not chosen.any():
            return None
        error_m, direction = self.error_m[chosen], self.direction[chosen]
        about = np.concatenate([part - part.mean() for way in (-1, 1) if len(part := error_m[direction == way])])
        turned = np.array([one.t_s for one in self.reversals])
        inside = [one for one, here in zip(self.reversals, counts(turned), strict=True) if here]
        return Following(
            moving_s=len(error_m) * self.block_s,
            error_rms_m=_rms(error_m),
            error_peak_m=float(np.abs(error_m).max()),
            error_ripple_m=_rms(about),
            reversals=len(inside),
            reversal_stick_s=max((one.stick_s for one in inside), default=0.0),
            quadrant_error_m=max((one.quadrant_error_m for one in inside), default=0.0),
        )

    def dose_mm2_per_s(self, counts: Callable[[Floats], Bools]) -> float:
        """The integral of v_a^2 over the blocks that count."""
        return 1e6 * float(self.dose_m2_per_s[counts(self.t_s)].sum())


def motion_of(run: RunData, block_s: float) -> Motion:
    """The motion of a run from its positions, and from what its controller saw of the drive."""
    _, at_sensors, at_trace = np.intersect1d(run.sensors["sequence"], run.trace["block"], return_indices=True)
    sensors, trace = run.sensors[at_sensors], run.trace[at_trace]
    slide_m, drive_m = (
        sensors[name].mean(axis=1, dtype=np.float64) for name in ("mass_position_m", "drive_position_m")
    )
    usable = np.isfinite(slide_m) & np.isfinite(drive_m)
    sensors, trace, slide_m, drive_m = sensors[usable], trace[usable], slide_m[usable], drive_m[usable]
    moves = (trace["state"] != wire.STANDSTILL) & np.isfinite(trace["drive_velocity_mps"])
    direction = np.where(moves, np.sign(trace["drive_velocity_mps"]), 0.0).astype(np.int64)
    t_s = sensors["t_ns"] * 1e-9
    v_a_mps = trace["vibration_velocity_mps"]
    shaken = np.isin(sensors["sequence"], run.applied["sequence"][run.applied["amplitude_m"] > 0.0])
    dose = np.where(shaken & np.isfinite(v_a_mps), v_a_mps, 0.0) ** 2 * block_s
    there = (
        len(slide_m) > 0 and np.ptp(slide_m) > 0.0 and np.ptp(drive_m) > 0.0
    )  # a transducer that is not there stands
    found = reversals_of(t_s, slide_m, drive_m, direction) if there else []
    return Motion(t_s, drive_m - slide_m if there else None, direction, dose, found, block_s)


def reversals_of(t_s: Floats, slide_m: Floats, drive_m: Floats, direction: npt.NDArray[np.int64]) -> list[Reversal]:
    """The changes of sign of the drive's velocity, stops between both signs left out.

    Args:
        t_s, slide_m, drive_m: time and places, [blocks].
        direction: of the drive, 0 where it stands; it may be late.

    """
    moving = np.flatnonzero(direction)
    at = np.flatnonzero(np.diff(direction[moving])) + 1
    if not len(at):
        return []
    changes, lasts = moving[at], moving[at - 1]  # the first block with another sign, and the last with the one before
    seen_m = _SEEN_SIGMAS * np.hypot(noise_of(slide_m), noise_of(drive_m))
    at_turn_m = _AT_TURN_SIGMAS * noise_of(drive_m)
    begins = [0]
    for change in changes:  # from the sign to the place at which the drive turned, which was before
        place_m = direction[change] * drive_m[begins[-1] : change + 1]
        begins.append(begins[-1] + int(np.flatnonzero(place_m <= place_m.min() + at_turn_m)[-1]))
    ends = [*np.minimum(begins[2:], lasts[1:] + 1), moving[-1] + 1]
    return [
        _reversal(t_s[begin:end], way * slide_m[begin:end], way * drive_m[begin:end], seen_m)
        for begin, end, way in zip(begins[1:], ends, direction[changes], strict=True)
        if end - begin > 1
    ]


def _reversal(t_s: Floats, slide_m: Floats, drive_m: Floats, seen_m: float) -> Reversal:
    """Of a stroke that begins with its change of sign, both places along the drive."""
    back = (
        np.searchsorted(np.maximum.accumulate(drive_m), drive_m - seen_m, side="right") - 1
    )  # where it was `seen_m` ago
    back = np.minimum(back, np.arange(len(back)) - 1)
    now = np.flatnonzero(back >= 0)
    way_m = drive_m[now] - drive_m[back[now]]
    follows = now[(way_m > 0.0) & (slide_m[now] - slide_m[back[now]] > _FOLLOWS * way_m)]
    if not len(follows):
        return Reversal(float(t_s[0]), float(t_s[-1] - t_s[0]), 0.0)
    first = max(int(follows[0]) - 1, 1)
    error_m = drive_m - slide_m
    peak_m = error_m[: 2 * first + 1].max()
    return Reversal(float(t_s[0]), float(t_s[first] - t_s[0]), max(float(peak_m - error_m[first:].mean()), 0.0))


def noise_of(place_m: Floats) -> float:
    """Standard deviation of white noise on what moves smoothly most of the time, from second differences."""
    if len(place_m) < 3:
        return 0.0
    bend_m: Any = np.abs(np.diff(place_m, 2))
    return float(np.median(bend_m)) / 0.6745 / np.sqrt(6.0)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
