"""A lock-in amplifier: amplitude of a signal at the commanded vibration, or at a multiple of its frequency, by window."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats

# Length of a window. Too short: neighbouring lines merge. Too long: every window holds a slip.
WINDOW_S = 0.02
FEWEST_WINDOWS = 5  # fewest windows of a frequency; the median of fewer may be a window with a slip
BESIDE_HZ = 3.5 / WINDOW_S  # distance to the neighbouring frequencies of a line; a line leaks over 2 / WINDOW_S at most
_HIGHEST = 0.45  # highest used frequency of a vibration, over the sampling rate: above half of it, it is aliased


class LockIn:
    """The windows of a run under a vibration that the sampling rate resolves.

    Attributes:
        rate_Hz: sampling rate.
        lowest_Hz: the smallest commanded frequency in each window, [windows].
        used: indices of the windows with vibration at every sample.

    """

    def __init__(self, t_s: Floats, columns: Mapping[str, npt.NDArray[np.floating]]) -> None:
        """`columns` needs the vibration's frequency and amplitude, [samples] as `t_s`."""
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
        """Indices of the windows of each frequency that is constant for `FEWEST_WINDOWS` or more."""
        held = self.used[self.lowest_Hz[self.used] == self._highest_Hz[self.used]]
        alike = [held[self.lowest_Hz[held] == each_Hz] for each_Hz in np.unique(self.lowest_Hz[held])]
        return [windows for windows in alike if len(windows) >= FEWEST_WINDOWS]

    def amplitude(self, values: Floats, times: float = 1.0, apart_Hz: float = 0.0) -> Floats:
        """Amplitude of `values` [samples] in each window, [windows], in their unit.

        Args:
            values: the signal.
            times: the wanted frequency, as a multiple of the commanded frequency.
            apart_Hz: offset that is added to this multiple.

        """
        turned = values * np.exp(-2j * np.pi * (times * self._turns + apart_Hz * (self._t_s - self._t_s[0])))
        weights = np.hanning(self._rows)
        result: Floats = np.abs(self._windows(turned) @ weights) * 2.0 / float(weights.sum())
        return result
