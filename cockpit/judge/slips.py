"""Strokes of a run's drive, and slips and swing of its force inside them.

A slip is a fall of the force along the motion: of F while the drive goes forwards, of -F while it goes backwards. At a turn of
the drive the force changes its sign as fast as in a slip on a stiff axis, so each stroke of the drive is searched separately.

The force also falls when a soft drive rings, and when the drive stops and the slide catches up. The position of the slide
separates these cases: a slipping slide is faster than its drive was, see `docs/method/bank.md`.

The same rule on drive less slide, the extension of the spring, counts the slips by position: a second count without the force.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from bridge.log.watches.arrays import median, noise_of
from cockpit.judge.setup import Setup
from cockpit.judge.window import HasMoved, Window
from diagnosis.slips import Cycles, find_cycles, joined, smallest_drop_N, steep_part, turning_points

BIN_S = 1e-3  # length of a bin; slips are searched in the means of bins
# Time before and after a fall in which the drive velocity is measured, and in which a missing block makes the slip unsure. In
# `steady_parts`: time before and after a block in which the drive velocity is measured; the smaller of both velocities counts.
_BESIDE_S = 0.02
_STOPS = 0.5  # share of the drive velocity before the fall; a drive that is slower after the fall stopped
# Least mean velocity of a slipping slide from 10 to 90 % of the fall, in drive velocities: 1.4 for a sine that peaks at 1.5.
_RUNS_AHEAD = 1.4
# Share of the drive velocity below which the position of a slide is missing or wrong during a fall. Larger: at 1 noise decides on
# a stiff spring, whose slide outruns its drive by 0.1 % in a slow fall. Smaller: slips behind a frozen, noisy position are lost.
_FOLLOWS = 0.5

_SHORTEST_STROKE = 1e-3  # shortest stroke, as a share of the travel of the drive: a few steps of its encoder
_TURN_SIGMAS = 10.0  # shortest stroke, in rms noises of the drive position
_MOVES = 0.02  # share of the stroke's largest velocity; a slower drive dwells
_AWAY_FROM_TURN = 0.5  # share of the stroke's median velocity; slower blocks next to a turn are part of the turn
_UNCUT = 0.5  # share of the longest steady part; a shorter one, cut by the end of a phase, is left out: its swing is too small


class Forces(NamedTuple):
    """Slips of a window, and its blocks with a finite force, [blocks]."""

    cycles: Cycles  # slips; their forces have the sign of the log
    unsure: npt.NDArray[np.bool_]  # slips during which blocks are missing, so the force is unknown, [slips]
    t_s: Floats
    mean_N: Floats
    part: npt.NDArray[np.int64]  # number of the stroke whose steady part contains the block; -1 outside
    missing: npt.NDArray[np.int64]  # blocks missing or without a force just before this block
    end: int  # row after the last of the window: a turn of the drive, if any
    turned: bool  # `end` is a turn of the drive
    stroke: int  # number of the stroke at `end`
    least_N: float  # smallest fall of the force that counts; infinite without a force
    by_position_s: Floats  # times of the slips that drive less slide shows, by the rule for the force
    least_m: float  # smallest fall of drive less slide that counts; infinite without a position


def bins_of(samples: int, period_ns: float) -> int:
    """Number of bins of about 1 ms per block."""
    return math.gcd(samples, max(round(period_ns * 1e-9 / BIN_S), 1))


def forces_of(window: Window, setup: Setup, moved: HasMoved) -> Forces:
    """Slips and forces of a window."""
    block_s, blocks = setup.block_s, window.blocks
    finite = np.asarray(np.isfinite(blocks.force_N).all(axis=1))
    usable = np.flatnonzero(finite)
    if not len(usable):
        nothing = np.empty(0)
        none = np.empty(0, np.int64)
        return Forces(
            joined([]), np.empty(0, bool), nothing, nothing, none, none, window.end, False, window.stroke,
            math.inf, nothing, math.inf,
        )  # fmt: skip
    blocks = blocks.part(usable) if len(usable) < len(finite) else blocks
    force_N = blocks.force_N.astype(np.float64)
    samples, bins = force_N.shape[1], blocks.drive_m.shape[1]
    sample_s = (blocks.t_ns[:, None] + (np.arange(samples) + 1 - samples) * (1e9 * block_s / samples)) / 1e9
    drop_N = smallest_drop_N(sample_s.ravel(), force_N.ravel())
    drive_m = _place_m(blocks.drive_m, "drive_position_m", setup, moved)
    slide_m = _place_m(blocks.slide_m, "mass_position_m", setup, moved)
    mean_N = force_N.mean(axis=1)
    begins = int(np.searchsorted(usable, window.begins))
    place_m = drive_m.reshape(-1, bins).mean(axis=1)[begins:]
    strokes = strokes_of(place_m)
    part = steady_parts(place_m, mean_N[begins:], strokes, block_s, window.after_turn)
    first = int(np.searchsorted(usable, window.first))
    present = next((i for i, stroke in enumerate(strokes) if begins + stroke.end > first), 0)
    part[part >= 0] += window.stroke - present
    part = np.concatenate([np.full(begins, -1), part])
    end, turned = _end(window, [int(usable[begins + stroke.first]) for stroke in strokes[1:]])
    limits_s, bin_s = [time_ns * 1e-9 for time_ns in window._replace(end=end).own_ns], block_s / bins
    slips: list[Cycles] = []
    by_position_s: list[Floats] = [np.empty(0)]
    bin_t_s, behind_m = sample_s[:, :: samples // bins].ravel(), drive_m - slide_m
    least_m = smallest_drop_N(bin_t_s, behind_m) if np.isfinite(behind_m).all() else math.inf
    for stroke in (DriveStroke(begins + begin, begins + stop, way) for begin, stop, way in strokes):
        if stroke.end <= first or usable[stroke.first] >= end:
            continue
        rows, inside = slice(stroke.first, stroke.end), slice(stroke.first * bins, stroke.end * bins)
        along_N = stroke.way * force_N[rows]
        drive, slide = stroke.way * drive_m[inside], stroke.way * slide_m[inside]
        means_N = along_N.reshape(len(along_N), bins, -1).mean(axis=2).ravel()
        t_s = bin_t_s[inside]
        falls = find_cycles(sample_s[rows].ravel(), along_N.ravel(), drop_N, setup.slowest_fall_s)
        slips.append(_signed(_slips_among(falls, limits_s, _Stroke(t_s, means_N, drive, slide), bin_s), stroke.way))
        if math.isfinite(least_m):
            falls = find_cycles(t_s, drive - slide, least_m, setup.slowest_fall_s)
            places = _Stroke(t_s, drive - slide, drive, slide)
            by_position_s.append(_slips_among(falls, limits_s, places, bin_s).breakaway_t_s)
    cycles = joined(slips)
    judged = slice(first, int(np.searchsorted(usable, end)))
    steps = np.diff(blocks.sequence, prepend=blocks.sequence[:1] - 1) - 1
    goes_on = (i for i, stroke in enumerate(strokes) if usable[begins + stroke.end - 1] >= end)
    return Forces(
        cycles,
        _unsure(cycles, blocks.t_ns * 1e-9, steps),
        blocks.t_ns[judged] / 1e9,
        mean_N[judged],
        part[judged],
        np.maximum(steps, 0)[judged],
        end,
        turned,
        window.stroke - present + next(goes_on, present),
        drop_N,
        np.concatenate(by_position_s),
        least_m,
    )


def _end(window: Window, turns: list[int]) -> tuple[int, bool]:
    """End of a window: the last turn in its second half, else its latest end; True if it is a turn."""
    if window.is_last:
        return window.end, False
    late = [row for row in turns if (window.first + window.end) // 2 < row <= window.end]
    return (late[-1], True) if late else (window.end, False)


def _unsure(cycles: Cycles, t_s: Floats, steps: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """True for slips during which blocks are missing, [slips]."""
    gaps = np.flatnonzero(steps > 0)
    unsure = np.zeros(cycles.slips, bool)
    for at in gaps if len(gaps) and cycles.slips else ():
        slip = int(np.searchsorted(cycles.breakaway_t_s - _BESIDE_S, t_s[at], side="right")) - 1
        if slip >= 0:
            began_s = cycles.breakaway_t_s[slip]
            later = int(np.searchsorted(cycles.restick_t_s, began_s))
            ends_s = cycles.restick_t_s[later] if later < len(cycles.restick_t_s) else began_s
            unsure[slip] |= bool(t_s[at - 1] < ends_s + _BESIDE_S)
    return unsure


class _Stroke(NamedTuple):
    """A stroke along the direction of the drive, [bins]; NaN for an unknown position."""

    t_s: Floats
    force_N: Floats
    drive_m: Floats
    slide_m: Floats


def _place_m(means_m: Floats, name: str, setup: Setup, moved: HasMoved) -> Floats:
    """Means of bins, interpolated where not finite; all NaN for a channel that is missing or never moves."""
    place_m = means_m.ravel()
    known = np.isfinite(place_m)
    if not moved(name, place_m) or name in setup.absent or not known.any():
        return np.full(len(place_m), np.nan)
    return np.interp(np.arange(len(place_m)), np.flatnonzero(known), place_m[known])


def _signed(cycles: Cycles, way: int) -> Cycles:
    return cycles._replace(
        breakaway_force_N=way * cycles.breakaway_force_N, restick_force_N=way * cycles.restick_force_N
    )


def _slips_among(falls: Cycles, limits_s: Sequence[float], stroke: _Stroke, bin_s: float) -> Cycles:
    """Falls of a stroke that begin inside the limits and are slips."""
    judged = (falls.breakaway_t_s >= limits_s[0]) & (falls.breakaway_t_s < limits_s[1])
    first = np.searchsorted(stroke.t_s, falls.breakaway_t_s, side="right") - 1
    last = [*first, len(stroke.t_s) - 1][1:]
    slips = np.array(
        [is_judged and _is_slip(stroke, a, b, bin_s) for a, b, is_judged in zip(first, last, judged, strict=True)], bool
    )
    return falls.kept(slips)


def _is_slip(stroke: _Stroke, first: int, last: int, bin_s: float) -> bool:
    """True if the slide outruns the drive in the fall between two bins; without a slide position: if the drive goes on."""
    begin, end = steep_part(stroke.force_N, first, last)
    beside = max(end - begin, math.ceil(_BESIDE_S / bin_s))
    before, after = max(begin - beside, 0), min(end + beside, len(stroke.t_s) - 1)
    if not before < begin < end < after:
        return True
    was = (stroke.drive_m[begin] - stroke.drive_m[before]) / (begin - before)
    goes_on = (stroke.drive_m[after] - stroke.drive_m[end]) / (after - end)
    slides, drives = ((place_m[end] - place_m[begin]) / (end - begin) for place_m in (stroke.slide_m, stroke.drive_m))
    if (
        not slides > _FOLLOWS * drives
    ):  # the position is missing or wrong: a force falls only if the slide outruns its drive
        return not goes_on < _STOPS * was
    return not slides <= _RUNS_AHEAD * max(was, goes_on)


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
