"""The measured force with which every segment begins, for the model to begin with as well (`model.predict` says why)."""

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.features.feature import Scales, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.noise import Noise
from diagnosis.features.segments import Commands, Segment
from diagnosis.features.slips import find_slips
from diagnosis.model.rig import Entry

Floats = npt.NDArray[np.floating[Any]]
_MOST, _FEWEST = 40, 10  # blocks of the line that is read: takes noise of 30 mN a block to 10 mN


def entries_of(signals: Signals, commands: Commands, scales: Scales) -> tuple[Entry, ...]:
    """Of settled segments that slide evenly or begin in a stick; none without a force or with a force drive."""
    if "drive_force_N" not in signals:
        return ()
    found: list[Entry] = []
    renewed = _renewed(signals, commands, scales)
    for segment in commands.segments:
        cut = {name: segment.sign * values[segment.first : segment.last] for name, values in signals.items()}
        if segment.still:
            force_N, _ = _line(cut["drive_force_N"][:_MOST])
            found.append(Entry(segment.first, segment.sign * force_N, None))
        elif segment.slips > 0:
            found += _stuck(segment, cut, scales, renewed[renewed <= segment.first])
    return tuple(found)


def misread(entry: Entry, noise: Noise, random: np.random.Generator) -> Entry:
    """The entry as another run's noise would have it read."""
    error_N, _ = _line(noise.drawn("drive_force_N", _MOST, random))
    return entry._replace(force_N=entry.force_N + error_N)


def _renewed(signals: Signals, commands: Commands, scales: Scales) -> npt.NDArray[np.int64]:
    """The blocks at which the contact was new: where slips and even sliding ended."""
    slid = [segment.last for segment in commands.segments if segment.still]
    sign = np.sign(commands.drive)
    turns = [0, *(np.flatnonzero(np.diff(sign)) + 1).tolist(), len(sign)]
    for first, last in pairwise(turns):
        slips = find_slips({name: sign[first] * values[first:last] for name, values in signals.items()}, scales)
        slid += (first + slips.bottoms).tolist()
    return np.array(sorted(slid), np.int64)


def _stuck(segment: Segment, cut: Signals, scales: Scales, renewed: npt.NDArray[np.int64]) -> list[Entry]:
    measured_N = cut["drive_force_N"]
    slips = find_slips(cut, scales)
    blocks = min(_MOST, int(slips.tops[0]) // 2)
    if blocks < _FEWEST:
        return []
    force_N, rate_N = _line(measured_N[:blocks])
    if len(renewed) == 0:
        return [Entry(segment.first, segment.sign * force_N, segment.first * BLOCK_S, from_before=True)]
    if rate_N <= 0.0 or force_N < float(measured_N[slips.bottoms].mean()):  # in a slip
        return []
    return [Entry(segment.first, segment.sign * force_N, (segment.first - int(renewed[-1])) * BLOCK_S)]


def _line(values: Floats) -> tuple[float, float]:
    """A line through values: where it begins, and its slope a block."""
    slope, begin = np.polyfit(np.arange(len(values)) + 0.5, values, 1)
    return float(begin), float(slope)
