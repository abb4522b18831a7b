"""Strokes of a drive, and the swing of its force inside them: at a turn the force changes its sign, with or without a slip."""

import itertools
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from bridge.log.watches.arrays import median, noise_of
from diagnosis.slips import turning_points

_SHORTEST_STROKE = 1e-3  # shortest stroke, as a share of the travel of the drive: a few steps of its encoder
_TURN_SIGMAS = 10.0  # shortest stroke, in rms noises of the drive position
_BESIDE_S = 0.02  # time before and after a block over which its drive velocity is taken; the smaller velocity counts
_MOVES = 0.02  # share of the stroke's largest velocity; a slower drive dwells
_AWAY_FROM_TURN = 0.5  # share of the stroke's median velocity; slower blocks next to a turn are part of the turn
_UNCUT = 0.5  # share of the longest steady part; a shorter part, cut by the end of a phase, underestimates the swing


class DriveStroke(NamedTuple):
    """Travel of the drive from a turn, or the begin of the record, to the next turn or the end."""

    first: int
    end: int  # the block after the last
    way: int  # direction: 1 or -1


def strokes_of(drive_m: Floats) -> list[DriveStroke]:
    """Strokes of a drive, from its position in each block; a single stroke for an unknown position."""
    count = len(drive_m)
    if np.isnan(drive_m).any():
        return [DriveStroke(0, count, 1)]
    shortest_m = max(_SHORTEST_STROKE * float(np.ptp(drive_m)), _TURN_SIGMAS * float(noise_of(drive_m)))
    limits = [0, *turning_points(drive_m, shortest_m).tolist(), count]
    return [
        DriveStroke(first, end, (-1) ** i) for i, (first, end) in enumerate(itertools.pairwise(limits)) if end > first
    ]


def steady_parts(
    drive_m: Floats, force_N: Floats, strokes: list[DriveStroke], block_s: float, after_turn: bool
) -> npt.NDArray[np.int64]:
    """Number of the stroke whose steady part contains each block, from 0; -1 at turns, while the spring reverses, and in dwells.

    Args:
        drive_m, force_N: position of the drive, NaN if unknown, and force of its spring, [blocks].
        strokes: strokes of the drive.
        block_s: duration of a block.
        after_turn: the drive turned at the first block.

    """
    part = np.full(len(drive_m), -1)
    if np.isnan(drive_m).any():
        return part + 1
    beside = max(round(_BESIDE_S / block_s), 1)
    for number, (first, end, way) in enumerate(strokes):
        way_m = np.pad(way * drive_m[first:end], beside, mode="edge")
        way_m = way_m[beside:] - way_m[:-beside]
        speed = np.minimum(way_m[:-beside], way_m[beside:])  # travel before and after the block, whichever is smaller
        moving = np.flatnonzero(speed > _MOVES * speed.max())
        if not len(moving):
            continue
        turned = first > 0 or after_turn
        fast = moving[speed[moving] >= _AWAY_FROM_TURN * median(speed[moving])]
        if turned:
            moving = moving[moving >= fast[0]]
        if end < len(drive_m):
            moving = moving[moving <= fast[-1]]
        along_N = way * force_N[first + moving]
        if turned:  # the spring is reversed once the force reaches its level
            known_N = along_N[np.isfinite(along_N)]
            moving = moving[int(np.argmax(along_N >= median(known_N))) if len(known_N) else 0 :]
        part[first + moving] = number
    return part


class Swing:
    """Swing of a force, reduced to a few numbers per stroke."""

    def __init__(self) -> None:
        self.blocks = 0
        self._sum_N = 0.0
        self._lowest_N, self._highest_N = np.inf, -np.inf
        self._strokes: dict[int, tuple[int, float, float]] = {}  # by stroke: number of blocks, lowest and highest force

    def add(self, force_N: Floats, part: npt.NDArray[np.int64]) -> None:
        """Add forces with the number of their stroke, -1 outside of steady parts; [blocks], in order of time."""
        if not len(force_N):
            return
        self.blocks += len(force_N)
        self._sum_N += float(force_N.sum())
        self._lowest_N = min(self._lowest_N, float(force_N.min()))
        self._highest_N = max(self._highest_N, float(force_N.max()))
        steady = part >= 0
        part, force_N = part[steady], force_N[steady]
        begins = np.flatnonzero(np.diff(part, prepend=-1))
        if not len(begins):
            return
        lows, highs = np.minimum.reduceat(force_N, begins), np.maximum.reduceat(force_N, begins)
        counts = np.diff(begins, append=len(part))
        for number, count, low_N, high_N in zip(part[begins].tolist(), counts.tolist(), lows, highs, strict=True):
            known = self._strokes.get(number, (0, np.inf, -np.inf))
            self._strokes[number] = known[0] + count, min(known[1], float(low_N)), max(known[2], float(high_N))

    @property
    def mean_N(self) -> float:
        """Mean force of all blocks."""
        return self._sum_N / self.blocks

    def result(self) -> tuple[float, int]:
        """Largest less smallest force in a steady part, median over strokes; number of strokes, 0: swing over all blocks."""
        if not self._strokes:
            return self._highest_N - self._lowest_N, 0
        counts, lows, highs = np.array(list(self._strokes.values())).T
        uncut = counts >= _UNCUT * counts.max()
        return median((highs - lows)[uncut]), int(uncut.sum())
