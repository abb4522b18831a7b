"""Whether the base vibrates at other frequencies than the commanded one: an exciter whose motion is not a sine.

Every model of the library shakes the base with a sine. The rest of the diagnosis compares the rms of the shake over all
frequencies, so without this check harmonics of the piezo pass for a resonance of the piezo (docs/method/diagnosis.md).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.units import percent
from diagnosis.evidence.lock_in import BESIDE_HZ, WINDOW_S, Floats, LockIn

DISTORTED = "distorted"  # kind of the finding
_MULTIPLES = (0.5, 1.5, 2.0, 3.0)  # multiples of the commanded frequency that are checked
# Smallest line that is reported, as a share of the commanded line's velocity: velocity decides whether slips end (v_a / v_d =
# 1.00 fails, 1.05 passes). Too small: the hysteresis of every piezo, some per cent, is reported. Too large: harmonics stay
# unseen. Counted on 56 synthetic rigs (docs/method/diagnosis.md).
_SHARE = 0.05
# Smallest ratio of a line to the amplitude at its neighbouring frequencies; noise and slips contribute to both
_TIMES_BESIDE = 4.0


class Distortion(NamedTuple):
    """The strongest line besides the commanded line in the base's acceleration of one run."""

    commanded_Hz: float
    multiple: float  # frequency over the commanded frequency
    share: float  # velocity over the commanded line's velocity

    @property
    def limits(self) -> float:
        """Share of the line, as a multiple of the smallest share that is reported."""
        return self.share / _SHARE

    @property
    def band_Hz(self) -> tuple[float, float]:
        """Lowest and highest frequency of the line, to the resolution of a window."""
        centre_Hz = self.multiple * self.commanded_Hz
        return centre_Hz - 1.0 / WINDOW_S, centre_Hz + 1.0 / WINDOW_S

    @property
    def text(self) -> str:
        """Text of the finding."""
        return (
            f"commanded to vibrate at {self.commanded_Hz:.0f} Hz, moves at {self.multiple * self.commanded_Hz:.0f} Hz as well, "
            f"with {percent(self.share)} of that velocity: an overdriven or loose exciter, or a base that yields to friction"
        )


def distortion(t_s: Floats, columns: Mapping[str, npt.NDArray[np.floating]]) -> Distortion | None:
    """The strongest multiple of the vibration in the base's acceleration; None where it is small or cannot be known.

    `columns` needs the base's acceleration and the vibration's frequency and amplitude, [samples] as `t_s`. A multiple above half
    the sampling rate is searched at its alias frequency; a filter may remove it before.
    """
    needed = {"base_accel_mps2", "vibration_frequency_Hz", "vibration_amplitude_m"}
    if not needed <= columns.keys():
        return None
    lock_in = LockIn(t_s, columns)
    accel_mps2 = columns["base_accel_mps2"]
    lines: list[Distortion] = []
    if steady := lock_in.steady():
        base = lock_in.amplitude(accel_mps2)
        for multiple in _MULTIPLES:
            line = lock_in.amplitude(accel_mps2, multiple)
            beside = [lock_in.amplitude(accel_mps2, multiple, apart_Hz) for apart_Hz in (-BESIDE_HZ, BESIDE_HZ)]
            for windows in steady:
                commanded_Hz = float(lock_in.lowest_Hz[windows[0]])
                size, commanded = float(np.median(line[windows])), float(np.median(base[windows]))
                around = max(float(np.median(each[windows])) for each in beside)
                if _is_apart(multiple * commanded_Hz, commanded_Hz, lock_in.rate_Hz) and size > _TIMES_BESIDE * around:
                    lines.append(Distortion(commanded_Hz, multiple, size / (multiple * max(commanded, size / 1e3))))
    strongest = max(lines, key=lambda line: line.share, default=None)
    return strongest if strongest is not None and strongest.limits > 1.0 else None


def _is_apart(line_Hz: float, commanded_Hz: float, rate_Hz: float) -> bool:
    """Whether the alias of a line, and its neighbouring frequencies, are away from 0 Hz and from the commanded line."""
    folded_Hz = abs((line_Hz + 0.5 * rate_Hz) % rate_Hz - 0.5 * rate_Hz)
    return folded_Hz > 2.0 * BESIDE_HZ and abs(folded_Hz - commanded_Hz) > 2.0 * BESIDE_HZ
