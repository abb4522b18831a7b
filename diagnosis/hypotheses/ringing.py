"""Candidate frequencies of a structure that rings: the peaks of an acceleration's spectrum without commanded vibration.

They are only starting points of a refit, never a verdict.
"""

import numpy as np
from scipy.signal import find_peaks, welch

from bridge.arrays import Floats
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared

_WINDOW = 512  # blocks of a window: a resolution of 2 Hz
_LOWEST_HZ, _HIGHEST_HZ = (
    20.0,
    450.0,
)  # range of a ringing base: slips are slower, the 1 ms grid resolves no faster ringing
_PROMINENCE = 2.0  # smallest prominence of a peak in the logarithm of power; combs of regular slips stay below


def ringing_Hz(runs: list[Prepared], signal: str, most: int) -> list[float]:
    """Frequencies of the most prominent peaks, `most` at most; empty without the signal."""
    power: Floats = np.zeros(_WINDOW // 2 + 1)
    frequency_Hz = np.fft.rfftfreq(_WINDOW, BLOCK_S)
    for run in runs:
        for segment in run.commands.segments:
            values = run.signals.get(signal, np.zeros(0))[segment.first : segment.last]
            if segment.frequency_Hz == 0.0 and len(values) >= _WINDOW:
                power += len(values) * welch(values, 1.0 / BLOCK_S, nperseg=_WINDOW)[1]
    inside = (frequency_Hz > _LOWEST_HZ) & (frequency_Hz < _HIGHEST_HZ)
    peaks, properties = find_peaks(np.log(np.maximum(power[inside], 1e-300)), prominence=_PROMINENCE)
    order = np.argsort(-properties["prominences"])[:most]
    return [float(value) for value in frequency_Hz[inside][peaks[order]]]
