"""Where to look for a structure that rings: the peaks of an acceleration's spectrum while nothing vibrates the rig.

Only starting points for a refit come from here, never a verdict.
"""

import numpy as np
from scipy.signal import find_peaks, welch

from bridge.arrays import Floats
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared

_WINDOW = 512  # blocks: 2 Hz
_LOWEST_HZ, _HIGHEST_HZ = 20.0, 450.0  # of a base that rings: slower is a slip, faster is beyond a grid of 1 ms
_PROMINENCE = 2.0  # of the logarithm of power; combs of regular slips stay below


def ringing_Hz(runs: list[Prepared], signal: str, most: int) -> list[float]:
    """Frequencies of the most prominent peaks [most at most]; none without the signal."""
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
