"""Vibrations of a run that no effect of the library makes: in the force signal, and of the base at other frequencies.

A force signal may hold a vibration that the spring cannot carry: the exciter's voltage in the sensor's cable. A base may vibrate
at multiples of the commanded frequency: an exciter whose motion is not a sine. The rest of the diagnosis compares means over
1 ms, which remove a vibration, and the rms of the shake over all frequencies, so that without this check harmonics of the piezo
pass for a resonance (docs/method/diagnosis.md).
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats, Indices
from bridge.units import percent, quantity
from diagnosis.evidence.manifest import RigTable
from diagnosis.evidence.manifest_keys import VIBRATION, Columns

# Length of a window. Too short: neighbouring lines merge. Too long: every window holds a slip.
WINDOW_S = 0.02
FEWEST_WINDOWS = 5  # fewest windows of a frequency; the median of fewer may be a window with a slip
BESIDE_HZ = 3.5 / WINDOW_S  # distance to the neighbouring frequencies of a line; a line leaks over 2 / WINDOW_S at most
_HIGHEST = 0.45  # highest used frequency of a vibration, over the sampling rate: above half of it, it is aliased
PICK_UP, DISTORTED = "pick-up", "distorted"  # kinds of the findings
# A vibration of the force is reported above the largest of these three limits. Lower limits report ordinary rigs; higher limits
# miss a pick-up.
_SHARE_OF_STATIC = 0.005  # over the static friction: the largest vibration by a rough surface
_TIMES_SPRING = 3.0  # over the force that the spring carries by the described rig numbers, which are not exact
# over the amplitude at neighbouring frequencies, which noise and slips cause; also for a line of the base
_TIMES_BESIDE = 4.0
_MULTIPLES = (0.5, 1.5, 2.0, 3.0)  # multiples of the commanded frequency that are checked
# Smallest line that is reported, as a share of the commanded line's velocity: velocity decides whether slips end (v_a / v_d =
# 1.00 fails, 1.05 passes). Too small: the hysteresis of every piezo, some per cent, is reported. Too large: harmonics stay
# unseen. Counted on 56 synthetic rigs (docs/method/diagnosis.md).
_SHARE_OF_VELOCITY = 0.05


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


class ForeignVibration(NamedTuple):
    """The strongest vibration of one kind in a run."""

    limits: float  # size, as a multiple of the smallest size that is reported
    kind: str  # PICK_UP or DISTORTED
    column: str
    frequency_Hz: float
    text: str  # text of the finding

    @property
    def band_Hz(self) -> tuple[float, float]:
        """Lowest and highest frequency of the vibration, to the resolution of a window."""
        return self.frequency_Hz - 1.0 / WINDOW_S, self.frequency_Hz + 1.0 / WINDOW_S


def foreign_vibrations(rig: RigTable, t_s: Floats, columns: Columns) -> tuple[ForeignVibration, ...]:
    """The strongest pick-up and the strongest line of the base, where they are large enough; `columns` are [samples] as `t_s`."""
    if not VIBRATION.keys() <= columns.keys():
        return ()
    lock_in = LockIn(t_s, columns)
    strongest = (
        max(vibrations, key=lambda vibration: vibration.limits, default=None)
        for vibrations in (_pick_ups(rig, lock_in, columns), _lines(lock_in, columns))
    )
    return tuple(vibration for vibration in strongest if vibration is not None and vibration.limits > 1.0)


def _pick_ups(rig: RigTable, lock_in: LockIn, columns: Columns) -> Iterator[ForeignVibration]:
    """The vibration of the force at each frequency; needs a spring drive, the force and the mass acceleration.

    Each frequency counts with its median window, as few windows hold a slip. A pick-up of a voltage grows with the frequency.
    """
    needed = {"drive_force_N", "mass_accel_mps2"} <= columns.keys() and len(lock_in.used) >= FEWEST_WINDOWS
    if rig.drive_stiffness_N_per_m is None or not needed:
        return
    force_N, accel_mps2 = (lock_in.amplitude(columns[name]) for name in ("drive_force_N", "mass_accel_mps2"))
    beside_N = _beside(lock_in, columns["drive_force_N"], 1.0)
    for windows in lock_in.steady() or [lock_in.used]:
        angular = 2.0 * np.pi * lock_in.lowest_Hz[windows]
        yields = np.abs(rig.drive_stiffness_N_per_m + 1j * angular * (rig.drive_damping_Ns_per_m or 0.0))
        spring_N = float(np.median(yields * accel_mps2[windows] / angular**2))
        limits_N = _SHARE_OF_STATIC * rig.static_force_N, _TIMES_SPRING * spring_N, _around(beside_N, windows)
        size_N, frequency_Hz = float(np.median(force_N[windows])), float(np.median(lock_in.lowest_Hz[windows]))
        text = (
            f"vibrates with {_rounded(size_N)} at {frequency_Hz:.0f} Hz, where the spring carries {_rounded(spring_N)}: "
            "the exciter's voltage in the sensor's cable, or the sensor's mass; the compared means over 1 ms do not hold it"
        )
        yield ForeignVibration(size_N / max(limits_N), PICK_UP, "drive_force_N", frequency_Hz, text)


def _lines(lock_in: LockIn, columns: Columns) -> Iterator[ForeignVibration]:
    """The multiples of each vibration in the base's acceleration that exceed their neighbouring frequencies.

    A multiple above half the sampling rate is searched at its alias frequency; a filter may remove it before.
    """
    steady = lock_in.steady()
    if not steady or "base_accel_mps2" not in columns:
        return
    accel_mps2 = columns["base_accel_mps2"]
    base = lock_in.amplitude(accel_mps2)
    for multiple in _MULTIPLES:
        line, beside = lock_in.amplitude(accel_mps2, multiple), _beside(lock_in, accel_mps2, multiple)
        for windows in steady:
            commanded_Hz = float(lock_in.lowest_Hz[windows[0]])
            line_Hz, size = multiple * commanded_Hz, float(np.median(line[windows]))
            if not _is_apart(line_Hz, commanded_Hz, lock_in.rate_Hz) or size <= _around(beside, windows):
                continue
            share = size / (multiple * max(float(np.median(base[windows])), size / 1e3))
            text = (
                f"commanded to vibrate at {commanded_Hz:.0f} Hz, moves at {line_Hz:.0f} Hz as well, with {percent(share)} of "
                "that velocity: an overdriven or loose exciter, or a base that yields to friction"
            )
            yield ForeignVibration(share / _SHARE_OF_VELOCITY, DISTORTED, "base_accel_mps2", line_Hz, text)


def _beside(lock_in: LockIn, values: Floats, multiple: float) -> list[Floats]:
    return [lock_in.amplitude(values, multiple, apart_Hz) for apart_Hz in (-BESIDE_HZ, BESIDE_HZ)]


def _around(beside: list[Floats], windows: Indices) -> float:
    """The limit that the amplitudes at neighbouring frequencies set."""
    return _TIMES_BESIDE * max(float(np.median(amplitude[windows])) for amplitude in beside)


def _rounded(force_N: float) -> str:
    return quantity(float(f"{force_N:.2g}"), "N")


def _is_apart(line_Hz: float, commanded_Hz: float, rate_Hz: float) -> bool:
    """Whether the alias of a line, and its neighbouring frequencies, are away from 0 Hz and from the commanded line."""
    folded_Hz = abs((line_Hz + 0.5 * rate_Hz) % rate_Hz - 0.5 * rate_Hz)
    return folded_Hz > 2.0 * BESIDE_HZ and abs(folded_Hz - commanded_Hz) > 2.0 * BESIDE_HZ
