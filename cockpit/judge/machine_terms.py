"""A run in the terms of machine tools: following error, quadrant error at reversals, and the dose of vibration.

Following error: nominal less actual position, as defined by numerical controls (Heidenhain, iTNC 530 technical manual, 6.8:
"servo lag"). Nominal is the drive's position, actual the slide's: without slips it is the extension of the spring, F / k_d, plus
the difference of the zeros of both transducers.

Quadrant error: the peak caused by friction where an axis changes its sign, the "quadrant glitch" of circular tests (ISO 230-4
has such tests, but not this number). Definition: the largest following error from a change of sign until the slide has moved for
as long as it rested, less the mean from the end of that stick to the end of the stroke. A constant correction removes the mean.

Dose: the integral of v_a^2 over time. It is energy-equivalent, as A(8) of ISO 5349-1 is for the acceleration of a hand, but
not a measure of human exposure: those weightings end at 1 kHz.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Bools, Floats
from bridge.log.watches.arrays import noise_of
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge.window import HasMoved, Window

_FOLLOWS = 0.5  # a slide that moves by more than this share of the drive's travel no longer sticks
# Time over which both travels are compared. Shorter: noise decides, as it may be a fifth of the drive's travel in this time
# (cockpit/run/sensor_needs.py). Longer: a short stroke on a soft spring seems to stick.
_TRAVEL_S = 0.125
_AT_TURN_SIGMAS = 6.0  # the drive turns within this distance of its extreme position, in rms noises of the position
# Reversals that the controller reports in this time before the end of a window are left to the next: it reports early or late.
_CHANGE_S = 0.25
_SEEN_SIGMAS = 10.0  # travel of the drive with which the slide's travel is compared, in rms noises of both positions


class Following(NamedTuple):
    """How the slide follows the moving drive in a stretch of a run. From means of blocks."""

    moving_s: float
    error_rms_m: float
    error_peak_m: float  # largest magnitude of drive less slide
    error_ripple_m: float  # rms about the mean of each direction: a constant offset does not remove it
    reversals: int  # changes of sign of the drive's velocity
    reversal_stick_s: float  # longest time from a reversal until the slide follows; 0 without reversals
    quadrant_error_m: float  # largest of all reversals; 0 without reversals
    following_s: float  # part of `moving_s` in which the slide no longer sticks: it makes most of the drive's travel


class Reversal(NamedTuple):
    """One change of sign of the drive's velocity."""

    reported_s: float  # time by the controller, up to 0.03 s early or late
    t_s: float  # turning point by the drive position
    stick_s: float  # time until the slide makes half of the drive's travel, at most to the end of the stroke
    quadrant_error_m: float  # as defined at the top of this file; 0 if the slide never follows


class BlockMotion(NamedTuple):
    """Motion in a stretch of a run, [blocks] each, and its reversals."""

    t_s: Floats
    error_m: Floats | None  # drive less slide; None if a position is missing
    direction: npt.NDArray[np.int64]  # direction of the drive: 1, -1, 0 at rest
    dose_m2_per_s: Floats  # v_a^2 times the block duration, 0 while the exciter rests
    reversals: list[Reversal]
    follows: Bools  # the slide has made most of the drive's travel in the last 0.125 s


class FollowingSum:
    """How the slide follows the drive in a stretch of a run, summed piece by piece."""

    def __init__(self) -> None:
        self.moving = 0  # blocks with a moving drive, with or without a position of the slide
        self._blocks = self._follows = 0
        self._squares_m2 = self._peak_m = self._dose_m2_per_s = 0.0
        self._ways = {-1: (0, 0.0, 0.0), 1: (0, 0.0, 0.0)}  # by direction: blocks, mean error, squares about the mean
        self._reversals = 0
        self._stick_s = self._quadrant_m = 0.0

    def add(self, motion: BlockMotion, counts: Callable[[Floats], Bools]) -> None:
        """Add the blocks and reversals selected by `counts`."""
        counted = counts(motion.t_s)
        self._dose_m2_per_s += float(motion.dose_m2_per_s[counted].sum())
        self.moving += int(np.count_nonzero(counted & (motion.direction != 0)))
        if motion.error_m is None:
            return
        self._follows += int(np.count_nonzero(counted & motion.follows))
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
        for reversal, is_inside in zip(motion.reversals, inside, strict=True):
            if is_inside:
                self._reversals += 1
                self._stick_s = max(self._stick_s, reversal.stick_s)
                self._quadrant_m = max(self._quadrant_m, reversal.quadrant_error_m)

    def result(self, block_s: float) -> Following | None:
        """Figures of the stretch; None without motion or without a position."""
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
            following_s=self._follows * block_s,
        )

    @property
    def dose_mm2_per_s(self) -> float:
        """Integral of v_a^2 over time."""
        return 1e6 * self._dose_m2_per_s


class MotionOf:
    """Motion of a run, window by window, from both positions and the drive velocity that the controller measured."""

    def __init__(self) -> None:
        self._moved = HasMoved()
        # last moving block so far: time [s], positions of slide and drive [m], direction
        self._last: tuple[float, float, float, int] | None = None
        self._until_s = -np.inf  # reversals are judged up to this time

    def __call__(self, window: Window, block_s: float) -> BlockMotion:
        """Motion in the judged rows of a window."""
        rows, trace, slide_m, drive_m = _paired(window)
        t_s = window.blocks.t_ns[rows] / 1e9
        moves = (trace["state"] != wire.STANDSTILL) & np.isfinite(trace["drive_velocity_mps"])
        direction = np.where(moves, np.sign(trace["drive_velocity_mps"]), 0.0).astype(np.int64)
        judged = (rows >= window.first) & (rows < window.end)
        v_a_mps = trace["vibration_velocity_mps"]
        shaken = _shaken(window, rows)
        dose = np.where(shaken & np.isfinite(v_a_mps), v_a_mps, 0.0) ** 2 * block_s
        slide_moved, drive_moved = self._moved("slide", slide_m), self._moved("drive", drive_m)
        measured = slide_moved and drive_moved and len(rows) > 0  # a missing transducer never moves
        reversals = self._reversals(window, t_s, slide_m, drive_m, direction) if measured else []
        error_m = (drive_m - slide_m)[judged] if measured else None
        before = np.maximum(np.arange(len(rows)) - round(_TRAVEL_S / block_s), 0)
        follows = direction * (slide_m - slide_m[before]) > _FOLLOWS * direction * (drive_m - drive_m[before])
        return BlockMotion(t_s[judged], error_m, direction[judged], dose[judged], reversals, follows[judged])

    def _reversals(
        self, window: Window, t_s: Floats, slide_m: Floats, drive_m: Floats, direction: npt.NDArray[np.int64]
    ) -> list[Reversal]:
        """Reversals in a window. A reversal at its end belongs to the next window, which has the stroke after it."""
        until_s = np.inf if window.is_last else window.own_ns[1] * 1e-9 - _CHANGE_S
        columns: Any = t_s, slide_m, drive_m, direction
        if self._last is not None and self._last[0] < t_s[0]:  # the drive may have rested since: add its last motion
            columns = tuple(
                np.concatenate([[value], column]) for value, column in zip(self._last, columns, strict=True)
            )
        judged = [turn for turn in reversals_of(*columns) if self._until_s <= turn.reported_s < until_s]
        self._until_s = until_s
        moving = np.flatnonzero((direction != 0) & (t_s < until_s))
        if len(moving):
            last = moving[-1]
            self._last = float(t_s[last]), float(slide_m[last]), float(drive_m[last]), int(direction[last])
        return judged


def _paired(window: Window) -> tuple[npt.NDArray[np.int64], Any, Floats, Floats]:
    """Rows of the blocks with both positions and a step of the controller; these steps; the positions."""
    blocks = window.blocks
    _, rows, at_trace = np.intersect1d(blocks.sequence, window.trace["block"], return_indices=True)
    slide_m, drive_m = blocks.slide_m[rows].mean(axis=1), blocks.drive_m[rows].mean(axis=1)
    usable = np.isfinite(slide_m) & np.isfinite(drive_m)
    return rows[usable], window.trace[at_trace[usable]], slide_m[usable], drive_m[usable]


def _shaken(window: Window, rows: npt.NDArray[np.int64]) -> Bools:
    """Blocks with a moving exciter."""
    applied = window.applied
    return np.isin(window.blocks.sequence[rows], applied["sequence"][applied["amplitude_m"] > 0.0])


def reversals_of(t_s: Floats, slide_m: Floats, drive_m: Floats, direction: npt.NDArray[np.int64]) -> list[Reversal]:
    """Changes of sign of the drive's velocity; stops between both signs are ignored. All arguments are [blocks].

    The direction of the drive is 0 at rest, and may lag its position.
    """
    moving = np.flatnonzero(direction)
    at = np.flatnonzero(np.diff(direction[moving])) + 1
    if not len(at):
        return []
    changes, lasts = moving[at], moving[at - 1]  # first block with the new sign, last block with the old sign
    seen_m = float(_SEEN_SIGMAS * np.hypot(noise_of(slide_m), noise_of(drive_m)))
    at_turn_m = _AT_TURN_SIGMAS * noise_of(drive_m)
    begins = [0]
    for change in changes:  # the turning point is the last block near the extreme position before the reported change
        place_m = direction[change] * drive_m[begins[-1] : change + 1]
        begins.append(begins[-1] + int(np.flatnonzero(place_m <= place_m.min() + at_turn_m)[-1]))
    ends = [*np.minimum(begins[2:], lasts[1:] + 1), moving[-1] + 1]
    return [
        Reversal(
            float(t_s[change]), *_stick(t_s[begin:end], way * slide_m[begin:end], way * drive_m[begin:end], seen_m)
        )
        for change, begin, end, way in zip(changes, begins[1:], ends, direction[changes], strict=True)
        if end - begin > 1
    ]


def _stick(t_s: Floats, slide_m: Floats, drive_m: Floats, seen_m: float) -> tuple[float, float, float]:
    """Begin and length of the stick after a turn, and quadrant error; both positions along the drive's direction."""
    back = np.searchsorted(np.maximum.accumulate(drive_m), drive_m - seen_m, side="right") - 1
    back = np.minimum(back, np.arange(len(back)) - 1)  # block in which the drive was `seen_m` behind
    now = np.flatnonzero(back >= 0)
    way_m = drive_m[now] - drive_m[back[now]]
    follows = now[(way_m > 0.0) & (slide_m[now] - slide_m[back[now]] > _FOLLOWS * way_m)]
    if not len(follows):
        return float(t_s[0]), float(t_s[-1] - t_s[0]), 0.0
    first = max(int(follows[0]) - 1, 1)
    error_m = drive_m - slide_m
    peak_m = error_m[: 2 * first + 1].max()
    return float(t_s[0]), float(t_s[first] - t_s[0]), max(float(peak_m - error_m[first:].mean()), 0.0)
