"""Times that begin again: counters that overflow, and files of several runs, whose clock restarts with each."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats, Indices
from bridge.log.finding import Finding
from bridge.units import counted

_COUNTERS = (2.0**16, 2.0**31, 2.0**32)  # counts at which the counters of microcontrollers begin again
# Usual steps: a fall of the time by more begins a piece, by less it is disorder. Also the longest step across an overflow.
_FALL_STEPS = 10.0
_AROUND = 5  # rows on either side of a fall whose medians must fall too: a single wrong stamp begins no piece
_FEWEST_ROWS = 16  # fewest rows of a piece on average; a column that falls more often holds no time
_APART_STEPS = 20.0  # gap before a piece without a stated start, longer than the gaps that readers bridge


class Segment(NamedTuple):
    """The first row of a part of a file with a separate head, and its start in s after the start of the first part."""

    row: int
    start_s: float  # NaN: not stated


class Pieces(NamedTuple):
    """Times that rise over all pieces [rows], the start of each piece, and the findings."""

    t_s: Floats
    starts_s: tuple[float, ...]
    findings: list[Finding]


def unwrapped(counts: Floats) -> tuple[Floats, int]:
    """A column of whole numbers that counts on after each overflow, [rows], and the number of overflows."""
    if _rises(counts):
        return counts, 0
    filled = np.flatnonzero(np.isfinite(counts))
    values = counts[filled]
    steps = np.diff(values)
    if not (steps < 0.0).any() or not (values == np.round(values)).all() or not (steps > 0.0).any():
        return counts, 0
    usual = float(np.median(steps[steps > 0.0]))
    more = np.zeros(len(values))
    for size in _COUNTERS:
        over = (steps < 0.0) & (steps + size >= 0.0) & (steps + size <= _FALL_STEPS * usual)
        more[1:] += size * over
    overflows = int(np.count_nonzero(more))
    if not overflows:
        return counts, 0
    result = counts.copy()
    result[filled] += np.cumsum(more)
    return result, overflows


def in_pieces(t_s: Floats, segments: Sequence[Segment], where: str) -> Pieces:
    """Times that go on rising over the pieces of a file.

    A piece starts where its head states, else 20 steps after the piece before, so that a gap parts the two.

    Args:
        t_s: times as written [rows]; NaN: missing.
        segments: parts of the file with a head each.
        where: file and column, for the finding.

    """
    if not segments and _rises(t_s):
        return Pieces(t_s, (), [])
    filled = np.flatnonzero(np.isfinite(t_s))
    times_s = t_s[filled]
    stated = {int(np.searchsorted(filled, segment.row)): segment.start_s for segment in segments}
    edges = np.unique(np.concatenate([[0], _falls(times_s), [at for at in stated if at < len(filled)]])).astype(int)
    if len(edges) < 2 or len(filled) < _FEWEST_ROWS * len(edges):
        return Pieces(t_s, (), [])
    steps_s = np.diff(times_s)
    apart_s = _APART_STEPS * float(np.median(steps_s[steps_s > 0.0]))
    began_s = stated.get(0, np.nan)
    shifted, starts, unstated = times_s.copy(), [float(times_s[0])], 0
    for first, end in zip(edges[1:].tolist(), [*edges[2:].tolist(), len(times_s)], strict=True):
        start_s = stated.get(first, np.nan) - began_s + times_s[first]
        if times_s[first] > times_s[first - 1]:  # the clock of the file goes on
            start_s = shifted[first - 1] + times_s[first] - times_s[first - 1]
        elif not start_s > shifted[first - 1]:  # not stated, or before the end of the piece before it
            start_s, unstated = shifted[first - 1] + apart_s, unstated + 1
        shifted[first:end] += start_s - times_s[first]
        starts.append(float(start_s))
    result = t_s.copy()
    result[filled] = shifted
    how = "each starts when its head states"
    if unstated:
        how = f"the start of {unstated} is not stated, so they follow one another with a gap of {apart_s:.3g} s"
    text = f"begins again in row {filled[edges[1]] + 1}{' and others' if len(edges) > 2 else ''}"
    text = f"{text}: {counted(len(edges), 'piece')}; {how}; --piece N takes one"
    return Pieces(result, tuple(starts), [Finding("pieces", where, text, len(edges))])


def _rises(times: Floats) -> bool:
    """Whether no value is missing or smaller than the value before it, as in most files."""
    return bool((times[1:] >= times[:-1]).all())


def _falls(times_s: Floats) -> Indices:
    """The rows at which a time begins again [n]: it falls below the middle of its piece; rows sent twice go back less."""
    steps_s = np.diff(times_s)
    if not (steps_s > 0.0).any():
        return np.zeros(0, np.int64)
    fall_s = _FALL_STEPS * float(np.median(steps_s[steps_s > 0.0]))
    candidates = np.flatnonzero(steps_s < -fall_s) + 1
    kept: list[int] = []
    for at in candidates.tolist():
        before_s, after_s = np.median(times_s[max(at - _AROUND, 0) : at]), np.median(times_s[at : at + _AROUND])
        middle_s = 0.5 * (times_s[kept[-1] if kept else 0] + before_s)
        if before_s - after_s > fall_s and after_s < middle_s:
            kept.append(at)
    return np.array(kept, np.int64)
