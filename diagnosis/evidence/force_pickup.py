"""Whether the force signal holds a vibration that the spring cannot carry: the exciter's voltage in the sensor's cable.

The rest of the diagnosis compares means over 1 ms, which remove a vibration (docs/method/diagnosis.md).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from bridge.units import quantity
from diagnosis.evidence.lock_in import BESIDE_HZ, FEWEST_WINDOWS, WINDOW_S, LockIn
from diagnosis.evidence.manifest import RigTable

PICK_UP = "pick-up"  # kind of the finding
# A vibration of the force is reported above the largest of these three limits. Lower limits report ordinary rigs; higher limits
# miss a pick-up.
_SHARE = 0.005  # over the static friction: the largest vibration by a rough surface
_TIMES_SPRING = 3.0  # over the force that the spring carries by the described rig numbers, which are not exact
_TIMES_BESIDE = 4.0  # over the amplitude at neighbouring frequencies, which noise and quick slips cause


class PickUp(NamedTuple):
    """A vibration in the force signal of one run."""

    frequency_Hz: float  # commanded frequency; the median of a sweep
    force_N: float  # amplitude, median over the windows
    spring_N: float  # amplitude that the spring would carry
    limit_N: float  # amplitude above which the vibration is reported

    @property
    def limits(self) -> float:
        """Amplitude, as a multiple of the smallest amplitude that is reported."""
        return self.force_N / self.limit_N

    @property
    def band_Hz(self) -> tuple[float, float]:
        """Lowest and highest frequency of the vibration, to the resolution of a window."""
        return self.frequency_Hz - 1.0 / WINDOW_S, self.frequency_Hz + 1.0 / WINDOW_S

    @property
    def text(self) -> str:
        """Text of the finding."""
        return (
            f"vibrates with {_rounded(self.force_N)} at {self.frequency_Hz:.0f} Hz, where the spring carries "
            f"{_rounded(self.spring_N)}: "
            "the exciter's voltage in the sensor's cable, or the sensor's mass; the compared means over 1 ms do not hold it"
        )


def _rounded(force_N: float) -> str:
    return quantity(float(f"{force_N:.2g}"), "N")


def pick_up(rig: RigTable, t_s: Floats, columns: Mapping[str, npt.NDArray[np.floating]]) -> PickUp | None:
    """The vibration in the force signal of a run with a spring drive; None where it is small or cannot be known.

    `columns` needs force, mass acceleration, and the vibration's frequency and amplitude, [samples] as `t_s`. Each frequency
    counts with its median window, as few windows hold a slip. Of several frequencies, the one farthest above its limit is
    returned: a pick-up of a voltage grows with the frequency.
    """
    stiffness_N_per_m = rig.drive_stiffness_N_per_m
    needed = {"drive_force_N", "mass_accel_mps2", "vibration_frequency_Hz", "vibration_amplitude_m"}
    if stiffness_N_per_m is None or not needed <= columns.keys():
        return None
    lock_in = LockIn(t_s, columns)
    if len(lock_in.used) < FEWEST_WINDOWS:
        return None
    force_N, accel_mps2 = (lock_in.amplitude(columns[name]) for name in ("drive_force_N", "mass_accel_mps2"))
    beside_N = [lock_in.amplitude(columns["drive_force_N"], apart_Hz=apart_Hz) for apart_Hz in (-BESIDE_HZ, BESIDE_HZ)]

    def of(windows: npt.NDArray[np.int64]) -> PickUp:
        angular = 2.0 * np.pi * lock_in.lowest_Hz[windows]
        yields = np.abs(stiffness_N_per_m + 1j * angular * (rig.drive_damping_Ns_per_m or 0.0))
        spring_N = float(np.median(yields * accel_mps2[windows] / angular**2))
        around_N = max(float(np.median(each[windows])) for each in beside_N)
        limit_N = max(_SHARE * rig.static_force_N, _TIMES_SPRING * spring_N, _TIMES_BESIDE * around_N)
        return PickUp(
            float(np.median(lock_in.lowest_Hz[windows])), float(np.median(force_N[windows])), spring_N, limit_N
        )

    each = [of(windows) for windows in lock_in.steady()] or [of(lock_in.used)]
    strongest = max(each, key=lambda pickup: pickup.limits)
    return strongest if strongest.limits > 1.0 else None
