"""Whether the base vibrates at other frequencies than the commanded one: an exciter that is no sine.

Every model of the library shakes the base with a sine. The rest of the diagnosis compares how strongly it shakes, whatever the
frequency: harmonics of the piezo passed for a resonance of it on two sealed sets (seeds 1995661 and 3736536).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.units import percent
from diagnosis.evidence.lock_in import BESIDE_HZ, WINDOW_S, Floats, LockIn

DISTORTED = "distorted"  # kind of the finding
_MULTIPLES = (0.5, 1.5, 2.0, 3.0)
# Of the velocity, which decides where slips end: v_a / v_d of 1.00 fails and 1.05 passes. A piezo's hysteresis makes some per
# cent; of 56 made rigs those with a rigid base show 0.1 % at most, harmonics of 2.1 detection limits and more 6 %.
_SHARE = 0.05
_OF_BESIDE = 4.0  # times what is found beside: noise, and slips


class Distortion(NamedTuple):
    """The strongest line beside the commanded one in the base's acceleration of one run."""

    commanded_Hz: float
    multiple: float  # of the commanded frequency
    share: float  # of the commanded line's velocity

    @property
    def limits(self) -> float:
        """How many times what is ordinary."""
        return self.share / _SHARE

    @property
    def band_Hz(self) -> tuple[float, float]:
        """Where it lies, to one line of a window."""
        centre_Hz = self.multiple * self.commanded_Hz
        return centre_Hz - 1.0 / WINDOW_S, centre_Hz + 1.0 / WINDOW_S

    @property
    def text(self) -> str:
        """The finding."""
        return (
            f"commanded to vibrate at {self.commanded_Hz:.0f} Hz, moves at {self.multiple * self.commanded_Hz:.0f} Hz as well, "
            f"with {percent(self.share)} of that velocity: an exciter driven too hard or loose, or a base that yields to friction"
        )


def distortion(t_s: Floats, columns: Mapping[str, npt.NDArray[np.floating]]) -> Distortion | None:
    """The strongest multiple of the vibration in the base's acceleration; None where it is ordinary or cannot be known.

    The base's acceleration and the vibration's frequency and amplitude are needed in `columns`, [samples] as `t_s`. A multiple
    above half the sampling rate is found where the sampling folds it to, unless a filter before it takes it away.
    """
    needed = {"base_accel_mps2", "vibration_frequency_Hz", "vibration_amplitude_m"}
    if not needed <= columns.keys():
        return None
    lock_in = LockIn(t_s, columns)
    accel_mps2 = columns["base_accel_mps2"]
    found: list[Distortion] = []
    if steady := lock_in.steady():
        base = lock_in.amplitude(accel_mps2)
        for multiple in _MULTIPLES:
            line = lock_in.amplitude(accel_mps2, multiple)
            beside = [lock_in.amplitude(accel_mps2, multiple, apart_Hz) for apart_Hz in (-BESIDE_HZ, BESIDE_HZ)]
            for own in steady:
                commanded_Hz = float(lock_in.lowest_Hz[own[0]])
                size, whole = float(np.median(line[own])), float(np.median(base[own]))
                around = max(float(np.median(each[own])) for each in beside)
                if _is_apart(multiple * commanded_Hz, commanded_Hz, lock_in.rate_Hz) and size > _OF_BESIDE * around:
                    found.append(Distortion(commanded_Hz, multiple, size / (multiple * max(whole, size / 1e3))))
    strongest = max(found, key=lambda one: one.share, default=None)
    return strongest if strongest is not None and strongest.limits > 1.0 else None


def _is_apart(line_Hz: float, commanded_Hz: float, rate_Hz: float) -> bool:
    """Whether a line lies, folded down, away from rest and from the commanded one, and what is looked at beside it as well."""
    folded_Hz = abs((line_Hz + 0.5 * rate_Hz) % rate_Hz - 0.5 * rate_Hz)
    return folded_Hz > 2.0 * BESIDE_HZ and abs(folded_Hz - commanded_Hz) > 2.0 * BESIDE_HZ
