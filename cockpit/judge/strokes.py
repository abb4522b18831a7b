"""The strokes of a drive, and how far its force swings inside them: at a turn it changes its sign, slip or no slip."""

import itertools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cockpit.judge.machine_terms import noise_of
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


def steady_parts(drive_m: Floats, force_N: Floats, block_s: float) -> npt.NDArray[np.int64]:
    """In the steady part of which stroke each block is, from 0; -1 at turns, while the spring turns over, and in dwells.

    Args:
        drive_m, force_N: place of the drive, NaN where it is not known, and force of its spring, [blocks].
        block_s: length of a block.

    """
    part = np.full(len(drive_m), -1)
    if np.isnan(drive_m).any():
        return part + 1
    beside = max(round(_BESIDE_S / block_s), 1)
    for number, (first, end, way) in enumerate(strokes_of(drive_m)):
        way_m = np.pad(way * drive_m[first:end], beside, mode="edge")
        way_m = way_m[beside:] - way_m[:-beside]
        speed = np.minimum(way_m[:-beside], way_m[beside:])  # before and after the block
        moving = np.flatnonzero(speed > _MOVES * speed.max())
        if not len(moving):
            continue
        fast = moving[speed[moving] >= _AWAY_FROM_TURN * np.median(speed[moving])]
        if first > 0:
            moving = moving[moving >= fast[0]]
        if end < len(drive_m):
            moving = moving[moving <= fast[-1]]
        along_N = way * force_N[first + moving]
        if first > 0:  # the spring is turned over once the force is where it stays
            known_N = along_N[np.isfinite(along_N)]
            moving = moving[int(np.argmax(along_N >= np.median(known_N))) if len(known_N) else 0 :]
        part[first + moving] = number
    return part


def swing_of(force_N: Floats, part: npt.NDArray[np.int64]) -> tuple[float, int]:
    """Largest less smallest force in the steady part of a stroke, median of strokes; and of how many, 0 where none is steady."""
    there, blocks = np.unique(part[part >= 0], return_counts=True)
    if not len(there):
        return float(np.ptp(force_N)), 0
    whole = there[blocks >= _WHOLE * blocks.max()]
    return float(np.median([np.ptp(force_N[part == number]) for number in whole])), len(whole)
