"""Channels of a rig that are derived from measured ones, by the formulas of its rig file."""

import numpy as np

from bridge.arrays import Floats
from bridge.formula import Formula
from bridge.rig.file import DeviceRig


class Derived:
    """Adds the derived channels of a rig to the samples of its device."""

    def __init__(self, rig: DeviceRig) -> None:
        self._numbers = rig.numbers
        self._formulas = [Formula(text) for text in rig.derived.values()]
        used = {name for formula in self._formulas for name in formula.names}
        channels = {name: rig.channels[name] for name in rig.measured if name in used}
        self._calibration = {
            name: (rig.measured[name], channel.sign * channel.scale, channel.offset)
            for name, channel in channels.items()
        }

    def __call__(self, samples: Floats) -> Floats:
        """The samples [channels, samples] of the device with a row for each derived channel, in SI units; NaN if unknown."""
        if not self._formulas:
            return samples
        measured = {name: scale * samples[row] + offset for name, (row, scale, offset) in self._calibration.items()}
        rows = [np.broadcast_to(formula(measured | self._numbers), samples.shape[1:]) for formula in self._formulas]
        return np.vstack([samples, *rows])
