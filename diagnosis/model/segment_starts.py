"""The measured force with which every segment begins; the model begins with this force (reason: `diagnosis.model.predict`)."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from diagnosis.features.feature import Scales, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.noise import RunNoise
from diagnosis.features.segments import CommandedRun, Segment
from diagnosis.features.slips import find_slips
from diagnosis.model.rig import StartState

# Most and fewest blocks of the line whose value at its begin is the force. Fewer: noise; more: the line runs into the slip.
# 40 blocks reduce noise of 30 mN a block to 10 mN.
_MOST, _FEWEST = 40, 10


def entries_of(signals: Signals, commands: CommandedRun, scales: Scales) -> tuple[StartState, ...]:
    """State at the start of each settled segment that slides evenly or begins in a stick, in time order.

    Empty without a measured force, and with a force drive. `signals` are [blocks] each.
    """
    if "drive_force_N" not in signals:
        return ()
    entries: list[StartState] = []
    renewed = _renewed(signals, commands, scales)
    for segment in commands.segments:
        cut = {name: segment.sign * values[segment.first : segment.last] for name, values in signals.items()}
        if segment.still:
            force_N, _ = _line(cut["drive_force_N"][:_MOST])
            entries.append(StartState(segment.first, segment.sign * force_N, None))
        elif segment.slips > 0:
            entries += _stuck(segment, cut, scales, renewed[renewed <= segment.first])
    return tuple(entries)


def misread(entry: StartState, noise: RunNoise, random: np.random.Generator) -> StartState:
    """The entry with a random error of its force, from a draw of the measured noise."""
    error_N, _ = _line(noise.drawn("drive_force_N", _MOST, random))
    return entry._replace(force_N=entry.force_N + error_N)


def _renewed(signals: Signals, commands: CommandedRun, scales: Scales) -> npt.NDArray[np.int64]:
    """Blocks at which a slip or even sliding ended, so that the contact was new; in time order."""
    slid = [segment.last for segment in commands.segments if segment.still]
    sign = np.sign(commands.drive)
    turns = [0, *(np.flatnonzero(np.diff(sign)) + 1).tolist(), len(sign)]
    for first, last in pairwise(turns):
        slips = find_slips({name: sign[first] * values[first:last] for name, values in signals.items()}, scales)
        slid += (first + slips.bottoms).tolist()
    return np.array(sorted(slid), np.int64)


def _stuck(segment: Segment, cut: Signals, scales: Scales, renewed: npt.NDArray[np.int64]) -> list[StartState]:
    measured_N = cut["drive_force_N"]
    slips = find_slips(cut, scales)
    blocks = min(_MOST, int(slips.tops[0]) // 2)
    if blocks < _FEWEST:
        return []
    force_N, rate_N = _line(measured_N[:blocks])
    if len(renewed) == 0:
        return [StartState(segment.first, segment.sign * force_N, segment.first * BLOCK_S, from_before=True)]
    if rate_N <= 0.0 or force_N < float(measured_N[slips.bottoms].mean()):  # the segment begins in a slip
        return []
    return [StartState(segment.first, segment.sign * force_N, (segment.first - int(renewed[-1])) * BLOCK_S)]


def _line(values: Floats) -> tuple[float, float]:
    """A line through `values` [blocks]: its value at the start, and its slope per block."""
    slope, begin = np.polyfit(np.arange(len(values)) + 0.5, values, 1)
    return float(begin), float(slope)
