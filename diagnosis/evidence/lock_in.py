"""A lock-in amplifier: how strongly a signal swings at the commanded vibration, or at a multiple of it, window by window."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.floating[Any]]
WINDOW_S = 0.02
FEWEST_WINDOWS = 5
BESIDE_HZ = 3.5 / WINDOW_S  # to either side: a line leaks no further than two of 1 / WINDOW_S
_HIGHEST = 0.45  # of the sampling rate: above it the vibration is folded down


class LockIn:
    """The windows of a run under a vibration that the sampling shows.

    Attributes:
        rate_Hz: of the samples.
        lowest_Hz: the smallest commanded frequency of every window [windows].
        used: numbers of the windows that vibrate throughout.

    """

    def __init__(self, t_s: Floats, columns: Mapping[str, npt.NDArray[np.floating]]) -> None:
        """`columns` need the vibration's frequency and amplitude, [samples] as `t_s`."""
        self.rate_Hz = (len(t_s) - 1) / float(t_s[-1] - t_s[0])
        self._t_s = t_s
        self._rows = round(WINDOW_S * self.rate_Hz)
        self.lowest_Hz, self._highest_Hz = np.zeros(0), np.zeros(0)
        frequency_Hz = np.where(columns["vibration_amplitude_m"] > 0.0, columns["vibration_frequency_Hz"], 0.0)
        if self._rows > 0:
            windows = self._windows(frequency_Hz)
            self.lowest_Hz, self._highest_Hz = windows.min(axis=1), windows.max(axis=1)
        self.used = np.flatnonzero((self.lowest_Hz > 2.0 / WINDOW_S) & (self._highest_Hz < _HIGHEST * self.rate_Hz))
        self._turns = np.concatenate(([0.0], np.cumsum(frequency_Hz[1:] * np.diff(t_s))))

    def _windows(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        count = len(values) // self._rows
        return values[: count * self._rows].reshape(count, self._rows)

    def steady(self) -> list[npt.NDArray[np.int64]]:
        """Numbers of the windows of every frequency that is held long enough."""
        held = self.used[self.lowest_Hz[self.used] == self._highest_Hz[self.used]]
        alike = [held[self.lowest_Hz[held] == each_Hz] for each_Hz in np.unique(self.lowest_Hz[held])]
        return [own for own in alike if len(own) >= FEWEST_WINDOWS]

    def amplitude(self, values: Floats, times: float = 1.0, apart_Hz: float = 0.0) -> Floats:
        """Of `values` [samples] at `times` the commanded frequency, and so far beside it, [windows]."""
        turned = values * np.exp(-2j * np.pi * (times * self._turns + apart_Hz * (self._t_s - self._t_s[0])))
        weights = np.hanning(self._rows)
        result: Floats = np.abs(self._windows(turned) @ weights) * 2.0 / float(weights.sum())
        return result
