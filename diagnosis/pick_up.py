"""Whether the force signal holds a vibration that the spring cannot carry: the exciter's voltage in the sensor's cable.

The rest of the diagnosis compares means over 1 ms, in which the vibration is gone: of the four such rigs of two sealed sets, 0.13
to 0.45 N beside a spring that carries 0.03 to 0.07 mN (seeds 4742003 and 8156207), it saw none.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.manifest import RigTable
from diagnosis.wording import quantity

Floats = npt.NDArray[np.floating[Any]]
PICK_UP = "pick-up"  # kind of the finding
_WINDOW_S = 0.02
_FEWEST_WINDOWS = 5
_SHARE = 0.005  # of the static friction: what a surface's roughness counts as at most
_OF_SPRING = 3.0  # times what the spring carries by the described numbers, which are not exact
_OF_BESIDE = 4.0  # times what is found where nothing vibrates: noise, and slips where they are quick
_BESIDE_HZ = 3.5 / _WINDOW_S  # to either side: the vibration itself leaks no further than two lines
_HIGHEST = 0.45  # of the sampling rate: above it the vibration is folded down


class PickUp(NamedTuple):
    """A vibration in the force signal of one run."""

    frequency_Hz: float  # as commanded; of a sweep the median
    force_N: float  # amplitude, median over the windows
    spring_N: float  # what the spring would carry
    limit_N: float  # above which it is told

    @property
    def limits(self) -> float:
        """How many times what is ordinary."""
        return self.force_N / self.limit_N

    @property
    def band_Hz(self) -> tuple[float, float]:
        """Where it lies, to one line of a window."""
        return self.frequency_Hz - 1.0 / _WINDOW_S, self.frequency_Hz + 1.0 / _WINDOW_S

    @property
    def text(self) -> str:
        """The finding."""
        return (
            f"vibrates with {_rounded(self.force_N)} at {self.frequency_Hz:.0f} Hz, where the spring carries "
            f"{_rounded(self.spring_N)}: "
            "the exciter's voltage in the sensor's cable, or the sensor's own mass; not in the means over 1 ms that are compared"
        )


def _rounded(force_N: float) -> str:
    return quantity(float(f"{force_N:.2g}"), "N")


def pick_up(rig: RigTable, t_s: Floats, columns: Mapping[str, npt.NDArray[np.floating]]) -> PickUp | None:
    """The vibration in the force signal of a run of a spring drive; None where it is ordinary or cannot be known.

    Force, mass acceleration and the vibration's frequency are needed in `columns`, [samples] as `t_s`. Every window of 20 ms is
    multiplied with the commanded vibration (a lock-in amplifier), the median window of each frequency counts: a slip is in few
    of them. Of several frequencies the one where it stands out most is told: a pick-up of a voltage grows with the frequency.
    """
    needed = {"drive_force_N", "mass_accel_mps2", "vibration_frequency_Hz", "vibration_amplitude_m"}
    if rig.drive_stiffness_N_per_m is None or not needed <= columns.keys():
        return None
    rate_Hz = (len(t_s) - 1) / float(t_s[-1] - t_s[0])
    rows = round(_WINDOW_S * rate_Hz)
    frequency_Hz = np.where(columns["vibration_amplitude_m"] > 0.0, columns["vibration_frequency_Hz"], 0.0)
    if rows == 0:
        return None
    windows = len(t_s) // rows
    lowest_Hz, highest_Hz = (
        at(frequency_Hz[: windows * rows].reshape(windows, rows), axis=1) for at in (np.min, np.max)
    )
    used = np.flatnonzero((lowest_Hz > 2.0 / _WINDOW_S) & (highest_Hz < _HIGHEST * rate_Hz))
    if len(used) < _FEWEST_WINDOWS:
        return None
    turns = np.concatenate(([0.0], np.cumsum(frequency_Hz[1:] * np.diff(t_s))))
    weights = np.hanning(rows)

    def amplitude(name: str, apart_Hz: float = 0.0) -> Floats:
        turned = columns[name] * np.exp(-2j * np.pi * (turns + apart_Hz * (t_s - t_s[0])))
        own = turned[: windows * rows].reshape(windows, rows)
        return np.abs(own @ weights) * 2.0 / float(weights.sum())

    force_N, accel_mps2 = amplitude("drive_force_N"), amplitude("mass_accel_mps2")
    beside_N = [amplitude("drive_force_N", apart_Hz) for apart_Hz in (-_BESIDE_HZ, _BESIDE_HZ)]

    def of(own: npt.NDArray[np.int64]) -> PickUp:
        angular = 2.0 * np.pi * lowest_Hz[own]
        yields = np.abs(rig.drive_stiffness_N_per_m + 1j * angular * (rig.drive_damping_Ns_per_m or 0.0))
        spring_N = float(np.median(yields * accel_mps2[own] / angular**2))
        around_N = max(float(np.median(each[own])) for each in beside_N)
        limit_N = max(_SHARE * rig.static_force_N, _OF_SPRING * spring_N, _OF_BESIDE * around_N)
        return PickUp(float(np.median(lowest_Hz[own])), float(np.median(force_N[own])), spring_N, limit_N)

    steady = used[lowest_Hz[used] == highest_Hz[used]]
    alike = [steady[lowest_Hz[steady] == each_Hz] for each_Hz in np.unique(lowest_Hz[steady])]
    each = [of(own) for own in alike if len(own) >= _FEWEST_WINDOWS] or [of(used)]
    found = max(each, key=lambda one: one.limits)
    return found if found.limits > 1.0 else None
