"""The slips of a run, in the force of its drive.

A slip is a fall of the force along the motion: of F where the drive goes forwards, of -F where it goes backwards. Where the drive
turns, the force changes its sign as fast as a slip on a stiff axis, so each stroke of the drive is looked at by itself.

The force falls as well where a soft drive rings, and where the drive stops and the slide comes after it. With the place of the
slide the two are told apart: a slide that slips is faster than its drive was, as `docs/method/bank.md` has it.

The same rule on drive less slide, the spring's extension, counts the slips by position: a second witness, without the force.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cockpit.judge.setup import Setup
from cockpit.judge.strokes import Stroke, steady_parts, strokes_of
from cockpit.judge.window import Moved, Window
from diagnosis.features.cycles import Cycles, find_cycles, smallest_drop_N

Floats = npt.NDArray[np.floating[Any]]

BIN_S = 1e-3  # of means, as slips are found in
# Before and after a fall: the drive's velocity there decides, and no block may be missing there.
_BESIDE_S = 0.02
_STOPS = 0.5  # of the drive's velocity before the fall
# Velocity of the slide over the drive's, mean from 10 to 90 % of a fall: that of a sine whose peak is the 1.5 v_d of a slip.
_RUNS_AHEAD = 1.4
_NONE = Cycles(*(np.empty(0) for _ in Cycles._fields))


class Forces(NamedTuple):
    """The slips of a window, and its blocks whose force is a number, [blocks]."""

    cycles: Cycles  # forces at breakaway and re-stick have the sign that they have in the log
    unsure: npt.NDArray[np.bool_]  # slips in which blocks are missing: what the force did there is not known, [slips]
    t_s: Floats
    mean_N: Floats
    part: npt.NDArray[np.int64]  # number of the stroke in whose steady part a block is; -1 in none
    missing: npt.NDArray[np.int64]  # blocks that are missing, or hold no force, just before this one
    end: int  # row after the last of the window: where the drive turns, if it does
    turned: bool
    stroke: int  # number of the stroke that begins, or goes on, at `end`
    least_N: float  # the smallest fall of the force that counts; infinite where no force is known
    by_position_s: Floats  # times of the slips in drive less slide, by the rule of the force
    least_m: float  # the smallest fall of drive less slide that counts; infinite where a position is not known


def bins_of(samples: int, period_ns: float) -> int:
    """Into how many bins of about 1 ms the samples of a block go."""
    return math.gcd(samples, max(round(period_ns * 1e-9 / BIN_S), 1))


def forces_of(window: Window, setup: Setup, moved: Moved) -> Forces:
    """The slips and the forces of a window."""
    block_s, blocks = setup.block_s, window.blocks
    finite = np.asarray(np.isfinite(blocks.force_N).all(axis=1))
    usable = np.flatnonzero(finite)
    if not len(usable):
        nothing = np.empty(0)
        none = np.empty(0, np.int64)
        return Forces(
            _NONE, np.empty(0, bool), nothing, nothing, none, none, window.end, False, window.stroke,
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
    present = next((i for i, one in enumerate(strokes) if begins + one.end > first), 0)
    part[part >= 0] += window.stroke - present
    part = np.concatenate([np.full(begins, -1), part])
    end, turned = _end(window, [int(usable[begins + one.first]) for one in strokes[1:]])
    limits_s, bin_s = [time_ns * 1e-9 for time_ns in window._replace(end=end).own_ns], block_s / bins
    found: list[Cycles] = []
    by_position_s: list[Floats] = [np.empty(0)]
    bin_t_s, behind_m = sample_s[:, :: samples // bins].ravel(), drive_m - slide_m
    least_m = smallest_drop_N(bin_t_s, behind_m) if np.isfinite(behind_m).all() else math.inf
    for stroke in (Stroke(begins + one.first, begins + one.end, one.way) for one in strokes):
        if stroke.end <= first or usable[stroke.first] >= end:
            continue
        rows, inside = slice(stroke.first, stroke.end), slice(stroke.first * bins, stroke.end * bins)
        along_N = stroke.way * force_N[rows]
        drive, slide = stroke.way * drive_m[inside], stroke.way * slide_m[inside]
        means_N = along_N.reshape(len(along_N), bins, -1).mean(axis=2).ravel()
        t_s = bin_t_s[inside]
        falls = find_cycles(sample_s[rows].ravel(), along_N.ravel(), drop_N, setup.slowest_fall_s)
        found.append(_signed(_slips_among(falls, limits_s, _Stroke(t_s, means_N, drive, slide), bin_s), stroke.way))
        if math.isfinite(least_m):
            falls = find_cycles(t_s, drive - slide, least_m, setup.slowest_fall_s)
            places = _Stroke(t_s, drive - slide, drive, slide)
            by_position_s.append(_slips_among(falls, limits_s, places, bin_s).breakaway_t_s)
    cycles = Cycles(*(np.concatenate(parts) for parts in zip(*found, strict=True))) if found else _NONE
    mine = slice(first, int(np.searchsorted(usable, end)))
    steps = np.diff(blocks.sequence, prepend=blocks.sequence[:1] - 1) - 1
    goes_on = (i for i, one in enumerate(strokes) if usable[begins + one.end - 1] >= end)
    return Forces(
        cycles,
        _unsure(cycles, blocks.t_ns * 1e-9, steps),
        blocks.t_ns[mine] / 1e9,
        mean_N[mine],
        part[mine],
        np.maximum(steps, 0)[mine],
        end,
        turned,
        window.stroke - present + next(goes_on, present),
        drop_N,
        np.concatenate(by_position_s),
        least_m,
    )


def _end(window: Window, turns: list[int]) -> tuple[int, bool]:
    """Where a window ends: at the last turn in its second half, else where it must; and whether the drive turns there."""
    if window.is_last:
        return window.end, False
    late = [row for row in turns if (window.first + window.end) // 2 < row <= window.end]
    return (late[-1], True) if late else (window.end, False)


def _unsure(cycles: Cycles, t_s: Floats, steps: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Slips within which blocks are missing, [slips]."""
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
    """A stroke of the drive, all along the drive; no number where a place is not known. [bins]."""

    t_s: Floats
    force_N: Floats
    drive_m: Floats
    slide_m: Floats


def _place_m(means_m: Floats, name: str, setup: Setup, moved: Moved) -> Floats:
    """Means of bins, straight lines where they are no numbers; NaN throughout for a channel that is not there, or stands."""
    place_m = means_m.ravel()
    known = np.isfinite(place_m)
    if not moved(name, place_m) or name in setup.absent or not known.any():
        return np.full(len(place_m), np.nan)
    at = np.flatnonzero(known)
    return place_m if len(at) == len(place_m) else np.interp(np.arange(len(place_m)), at, place_m[at])


def _signed(cycles: Cycles, way: int) -> Cycles:
    return cycles._replace(
        breakaway_force_N=way * cycles.breakaway_force_N, restick_force_N=way * cycles.restick_force_N
    )


def _slips_among(falls: Cycles, limits_s: Sequence[float], stroke: _Stroke, bin_s: float) -> Cycles:
    """Those of the falls of a stroke that are slips; only the ones from and until the limits are looked at."""
    own = (falls.breakaway_t_s >= limits_s[0]) & (falls.breakaway_t_s < limits_s[1])
    first = np.searchsorted(stroke.t_s, falls.breakaway_t_s, side="right") - 1
    last = [*first, len(stroke.t_s) - 1][1:]
    slips = np.array(
        [mine and _is_slip(stroke, a, b, bin_s) for a, b, mine in zip(first, last, own, strict=True)], bool
    )
    stick = slips[: len(falls.restick_t_s)]
    return Cycles(
        falls.breakaway_t_s[slips],
        falls.breakaway_force_N[slips],
        falls.restick_t_s[stick],
        falls.restick_force_N[stick],
    )


def _is_slip(stroke: _Stroke, first: int, last: int, bin_s: float) -> bool:
    """Whether the slide runs ahead in the fall of the force between two bins; its place not known: whether the drive goes on."""
    force_N = stroke.force_N[first : last + 1]
    force_N = force_N[: int(force_N.argmin()) + 1]
    drop_N = float(force_N[0] - force_N[-1])
    begin = first + int(np.flatnonzero(force_N >= force_N[0] - 0.1 * drop_N)[-1])
    end = first + int(np.flatnonzero(force_N <= force_N[0] - 0.9 * drop_N)[0])
    beside = max(end - begin, math.ceil(_BESIDE_S / bin_s))
    before, after = max(begin - beside, 0), min(end + beside, len(stroke.t_s) - 1)
    if not before < begin < end < after:
        return True
    was = (stroke.drive_m[begin] - stroke.drive_m[before]) / (begin - before)
    goes_on = (stroke.drive_m[after] - stroke.drive_m[end]) / (after - end)
    slides, drives = ((place_m[end] - place_m[begin]) / (end - begin) for place_m in (stroke.slide_m, stroke.drive_m))
    if not slides > drives:  # no place, or one that is wrong: a force falls only where the slide outruns its drive
        return not goes_on < _STOPS * was
    return not slides <= _RUNS_AHEAD * max(was, goes_on)
