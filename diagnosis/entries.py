"""The measured force with which every segment begins, for the model to begin with as well (`diagnosis.twin` says why)."""

from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.commands import Commands, Segment
from diagnosis.features import Scales, Signals, find_slips
from diagnosis.noise import Noise
from diagnosis.reduced import BLOCK_S
from diagnosis.twin import Entry

Floats = npt.NDArray[np.floating[Any]]
_MOST, _FEWEST = 40, 10  # blocks of the line that is read: takes noise of 30 mN a block to 10 mN


def entries_of(signals: Signals, commands: Commands, scales: Scales) -> tuple[Entry, ...]:
    """Of settled segments that slide evenly or begin in a stick; none without a force or with a force drive."""
    if "drive_force_N" not in signals:
        return ()
    found: list[Entry] = []
    slid_at: int | None = None  # when the contact was last made new, as far as the run shows
    before = 0
    # a slip is seen once the force has risen again, which may be when the next segment has begun
    ends = [segment.first for segment in commands.segments[1:]] + [len(commands.drive)]
    for segment, end in zip(commands.segments, ends, strict=True):
        around = {name: segment.sign * values[before:end] for name, values in signals.items()}
        renewed = before + find_slips(around, scales).bottoms
        slid_at = _last(renewed[renewed <= segment.first], slid_at)
        if segment.still:
            force_N, _ = _line(segment.sign * signals["drive_force_N"][segment.first :][:_MOST])
            found.append(Entry(segment.first, segment.sign * force_N, None))
            slid_at = segment.last
        elif segment.slips > 0:
            cut = {name: segment.sign * values[segment.first : segment.last] for name, values in signals.items()}
            found += _stuck(segment, cut, scales, slid_at)
            slid_at = _last(renewed, slid_at)
        before = segment.last
    return tuple(found)


def misread(entry: Entry, noise: Noise, random: np.random.Generator) -> Entry:
    """The entry as another run's noise would have it read."""
    error_N, _ = _line(noise.drawn("drive_force_N", _MOST, random))
    return entry._replace(force_N=entry.force_N + error_N)


def _last(blocks: npt.NDArray[np.int64], before: int | None) -> int | None:
    return int(blocks[-1]) if len(blocks) else before


def _stuck(segment: Segment, cut: Signals, scales: Scales, slid_at: int | None) -> list[Entry]:
    measured_N = cut["drive_force_N"]
    slips = find_slips(cut, scales)
    blocks = min(_MOST, int(slips.tops[0]) // 2)
    if blocks < _FEWEST:
        return []
    force_N, rate_N = _line(measured_N[:blocks])
    in_a_slip = rate_N <= 0.0 or force_N < float(measured_N[slips.bottoms].mean())
    if in_a_slip and slid_at is not None:
        return []
    age_s = (segment.first - (slid_at or 0)) * BLOCK_S
    return [Entry(segment.first, segment.sign * force_N, age_s, from_before=slid_at is None)]


def _line(values: Floats) -> tuple[float, float]:
    """A line through values: where it begins, and its slope a block."""
    slope, begin = np.polyfit(np.arange(len(values)) + 0.5, values, 1)
    return float(begin), float(slope)
