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

from bridge.log.watches.arrays import noise_of
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge.window import Moved, Window

Floats = npt.NDArray[np.floating[Any]]
Bools = npt.NDArray[np.bool_]

_FOLLOWS = 0.5  # of the drive's way: a slide that makes more has ended its stick
_AT_TURN_SIGMAS = 6.0  # of the drive's noise within which it is where it turned
_CHANGE_S = 0.25  # before the turn at the end of a window: the controller sees it some 0.03 s earlier or later
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
    """A stretch of a run block by block, [blocks] each, and its reversals."""

    t_s: Floats
    error_m: Floats | None  # drive less slide; None where one of them has no position
    direction: npt.NDArray[np.int64]  # of the drive, 0 where it stands
    dose_m2_per_s: Floats  # v_a^2 times the block, 0 where the exciter rests
    reversals: list[Reversal]


class FollowingSum:
    """How the slide follows the drive in a stretch of a run, gathered piece by piece."""

    def __init__(self) -> None:
        self.moving = 0  # blocks in which the drive moves, whether or not its slide has a position
        self._blocks = 0
        self._squares_m2 = self._peak_m = self._dose_m2_per_s = 0.0
        self._ways = {-1: (0, 0.0, 0.0), 1: (0, 0.0, 0.0)}  # by direction: blocks, mean, squares about the mean
        self._reversals = 0
        self._stick_s = self._quadrant_m = 0.0

    def add(self, motion: Motion, counts: Callable[[Floats], Bools]) -> None:
        """The blocks and reversals whose times count."""
        counted = counts(motion.t_s)
        self._dose_m2_per_s += float(motion.dose_m2_per_s[counted].sum())
        self.moving += int(np.count_nonzero(counted & (motion.direction != 0)))
        if motion.error_m is None:
            return
        for way, before in self._ways.items():
            error_m = motion.error_m[counted & (motion.direction == way)]
            if not len(error_m):
                continue
            blocks, mean_m = before[0] + len(error_m), float(error_m.mean())
            apart_m = mean_m - before[1]
            about_m2 = float(((error_m - mean_m) ** 2).sum()) + apart_m**2 * before[0] * len(error_m) / blocks
            self._ways[way] = blocks, before[1] + apart_m * len(error_m) / blocks, before[2] + about_m2
            self._blocks += len(error_m)
            self._squares_m2 += float((error_m**2).sum())
            self._peak_m = max(self._peak_m, float(np.abs(error_m).max()))
        inside = counts(np.array([reversal.t_s for reversal in motion.reversals]))
        for reversal, here in zip(motion.reversals, inside, strict=True):
            if here:
                self._reversals += 1
                self._stick_s = max(self._stick_s, reversal.stick_s)
                self._quadrant_m = max(self._quadrant_m, reversal.quadrant_error_m)

    def result(self, block_s: float) -> Following | None:
        """All of it; None where no block moves, or a position is missing."""
        if not self._blocks:
            return None
        return Following(
            moving_s=self._blocks * block_s,
            error_rms_m=float(np.sqrt(self._squares_m2 / self._blocks)),
            error_peak_m=self._peak_m,
            error_ripple_m=float(np.sqrt(sum(way[2] for way in self._ways.values()) / self._blocks)),
            reversals=self._reversals,
            reversal_stick_s=self._stick_s,
            quadrant_error_m=self._quadrant_m,
        )

    @property
    def dose_mm2_per_s(self) -> float:
        """The integral of v_a^2."""
        return 1e6 * self._dose_m2_per_s


class MotionOf:
    """The motion of a run, window by window, from its positions and from what its controller saw of the drive."""

    def __init__(self) -> None:
        self._moved = Moved()
        self._last: tuple[float, float, float, int] | None = (
            None  # the last block of the windows before in which the drive moved
        )
        self._until_s = -np.inf  # to which changes of direction were judged

    def __call__(self, window: Window, block_s: float) -> Motion:
        """The rows of a window that are to be judged."""
        rows, trace, slide_m, drive_m = _paired(window)
        t_s = window.blocks.t_ns[rows] / 1e9
        moves = (trace["state"] != wire.STANDSTILL) & np.isfinite(trace["drive_velocity_mps"])
        direction = np.where(moves, np.sign(trace["drive_velocity_mps"]), 0.0).astype(np.int64)
        own = (rows >= window.first) & (rows < window.end)
        v_a_mps = trace["vibration_velocity_mps"]
        shaken = _shaken(window, rows)
        dose = np.where(shaken & np.isfinite(v_a_mps), v_a_mps, 0.0) ** 2 * block_s
        slide_moved, drive_moved = self._moved("slide", slide_m), self._moved("drive", drive_m)
        there = slide_moved and drive_moved and len(rows) > 0  # a transducer that is not there stands
        found = self._reversals(window, t_s, slide_m, drive_m, direction) if there else []
        error_m = (drive_m - slide_m)[own] if there else None
        return Motion(t_s[own], error_m, direction[own], dose[own], found)

    def _reversals(
        self, window: Window, t_s: Floats, slide_m: Floats, drive_m: Floats, direction: npt.NDArray[np.int64]
    ) -> list[Reversal]:
        """The changes of direction of a window; the one at its end belongs to the next, which sees the stroke after it."""
        until_s = np.inf if window.is_last else window.own_ns[1] * 1e-9 - _CHANGE_S
        columns: Any = t_s, slide_m, drive_m, direction
        if self._last is not None and self._last[0] < t_s[0]:  # the drive may have stood since
            columns = tuple(np.concatenate([[one], column]) for one, column in zip(self._last, columns, strict=True))
        changed_s, found = _changes(*columns)
        mine = [one for at_s, one in zip(changed_s, found, strict=True) if self._until_s <= at_s < until_s]
        self._until_s = until_s
        moving = np.flatnonzero((direction != 0) & (t_s < until_s))
        if len(moving):
            last = moving[-1]
            self._last = float(t_s[last]), float(slide_m[last]), float(drive_m[last]), int(direction[last])
        return mine


def _paired(window: Window) -> tuple[npt.NDArray[np.int64], Any, Floats, Floats]:
    """Rows of the blocks of a window that have both places and a step of the controller, these steps, and the places."""
    blocks, trace = window.blocks, window.trace
    rows = np.arange(len(blocks.sequence))
    if len(rows) != len(trace) or not np.array_equal(blocks.sequence, trace["block"]):
        _, rows, at_trace = np.intersect1d(blocks.sequence, trace["block"], return_indices=True)
        trace = trace[at_trace]
    slide_m, drive_m = blocks.slide_m[rows].mean(axis=1), blocks.drive_m[rows].mean(axis=1)
    usable = np.isfinite(slide_m) & np.isfinite(drive_m)
    if usable.all():
        return rows, trace, slide_m, drive_m
    return rows[usable], trace[usable], slide_m[usable], drive_m[usable]


def _shaken(window: Window, rows: npt.NDArray[np.int64]) -> Bools:
    """Blocks in which the exciter moved."""
    numbers, applied = window.blocks.sequence[rows], window.applied
    if np.array_equal(numbers, applied["sequence"]):
        return applied["amplitude_m"] > 0.0
    return np.isin(numbers, applied["sequence"][applied["amplitude_m"] > 0.0])


def reversals_of(t_s: Floats, slide_m: Floats, drive_m: Floats, direction: npt.NDArray[np.int64]) -> list[Reversal]:
    """The changes of sign of the drive's velocity, stops between both signs left out.

    Args:
        t_s, slide_m, drive_m: time and places, [blocks].
        direction: of the drive, 0 where it stands; it may be late.

    """
    return _changes(t_s, slide_m, drive_m, direction)[1]


def _changes(
    t_s: Floats, slide_m: Floats, drive_m: Floats, direction: npt.NDArray[np.int64]
) -> tuple[list[float], list[Reversal]]:
    """The reversals, and when the direction was seen to change for each."""
    moving = np.flatnonzero(direction)
    at = np.flatnonzero(np.diff(direction[moving])) + 1
    if not len(at):
        return [], []
    changes, lasts = moving[at], moving[at - 1]  # the first block with another sign, and the last with the one before
    seen_m = _SEEN_SIGMAS * np.hypot(noise_of(slide_m), noise_of(drive_m))
    at_turn_m = _AT_TURN_SIGMAS * noise_of(drive_m)
    begins = [0]
    for change in changes:  # from the sign to the place at which the drive turned, which was before
        place_m = direction[change] * drive_m[begins[-1] : change + 1]
        begins.append(begins[-1] + int(np.flatnonzero(place_m <= place_m.min() + at_turn_m)[-1]))
    ends = [*np.minimum(begins[2:], lasts[1:] + 1), moving[-1] + 1]
    found = [
        (float(t_s[change]), _reversal(t_s[begin:end], way * slide_m[begin:end], way * drive_m[begin:end], seen_m))
        for change, begin, end, way in zip(changes, begins[1:], ends, direction[changes], strict=True)
        if end - begin > 1
    ]
    return [at_s for at_s, _ in found], [reversal for _, reversal in found]


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
