"""The strokes of a drive, and how far its force swings inside them: at a turn it changes its sign, slip or no slip."""

import itertools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.watches.arrays import median, noise_of
from diagnosis.look.turns import turns

Floats = npt.NDArray[np.floating[Any]]

_SHORTEST_STROKE = 1e-3  # of the drive's whole travel, which is some steps of its encoder
_TURN_SIGMAS = 10.0  # of the noise of the drive's place, which a stroke is longer than
_BESIDE_S = 0.02  # before a block and after it, over which the drive's velocity is taken; the smaller counts
_MOVES = 0.02  # of the stroke's fastest: slower is a dwell
_AWAY_FROM_TURN = 0.5  # of the stroke's usual velocity: slower, beside a turn, is the turn
_WHOLE = (
    0.5  # of the longest steady part: a shorter one, cut by the end of a phase, shows less of a swing than there is
)


class Stroke(NamedTuple):
    """A part of the drive's way between two turns, or an end of the record."""

    first: int
    end: int  # the block after the last
    way: int  # 1 or -1


def strokes_of(drive_m: Floats) -> list[Stroke]:
    """The strokes of a drive, from its place in each block; one of all blocks where the place is not known."""
    count = len(drive_m)
    if np.isnan(drive_m).any():
        return [Stroke(0, count, 1)]
    shortest_m = max(_SHORTEST_STROKE * float(np.ptp(drive_m)), _TURN_SIGMAS * float(noise_of(drive_m)))
    at = [0] * count
    turned = turns(drive_m.tolist(), shortest_m, at)
    limits = [0, *at[:turned], count]
    return [Stroke(first, end, (-1) ** i) for i, (first, end) in enumerate(itertools.pairwise(limits)) if end > first]


def steady_parts(
    drive_m: Floats, force_N: Floats, strokes: list[Stroke], block_s: float, after_turn: bool
) -> npt.NDArray[np.int64]:
    """In the steady part of which stroke each block is, from 0; -1 at turns, while the spring turns over, and in dwells.

    Args:
        drive_m, force_N: place of the drive, NaN where it is not known, and force of its spring, [blocks].
        strokes: of the drive.
        block_s: length of a block.
        after_turn: the drive turned at the first block.

    """
    part = np.full(len(drive_m), -1)
    if np.isnan(drive_m).any():
        return part + 1
    beside = max(round(_BESIDE_S / block_s), 1)
    for number, (first, end, way) in enumerate(strokes):
        way_m = np.pad(way * drive_m[first:end], beside, mode="edge")
        way_m = way_m[beside:] - way_m[:-beside]
        speed = np.minimum(way_m[:-beside], way_m[beside:])  # before and after the block
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
        if turned:  # the spring is turned over once the force is where it stays
            known_N = along_N[np.isfinite(along_N)]
            moving = moving[int(np.argmax(along_N >= median(known_N))) if len(known_N) else 0 :]
        part[first + moving] = number
    return part


class Swing:
    """The swing of a force, stroke by stroke; of many rows a few numbers for each stroke."""

    def __init__(self) -> None:
        self.blocks = 0
        self._sum_N = 0.0
        self._lowest_N, self._highest_N = np.inf, -np.inf
        self._strokes: dict[int, tuple[int, float, float]] = {}  # blocks, lowest and highest force

    def add(self, force_N: Floats, part: npt.NDArray[np.int64]) -> None:
        """Forces, and the number of the stroke in whose steady part each is, -1 in none; [blocks], in order of time."""
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
        """Largest less smallest force in the steady part of a stroke, median of strokes; of how many, 0: that of all blocks."""
        if not self._strokes:
            return self._highest_N - self._lowest_N, 0
        counts, lows, highs = np.array(list(self._strokes.values())).T
        whole = counts >= _WHOLE * counts.max()
        return median((highs - lows)[whole]), int(whole.sum())
