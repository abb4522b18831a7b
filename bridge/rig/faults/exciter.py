"""Faults of the exciter, as changes of its numbers; a device's exciter has them in front of it."""

import math
from collections.abc import Mapping

from bridge.rig.faults.table import FaultTable

_HEALTHY = {
    "delivered_ratio": 1.0, "mount_resonance_Hz": 0.0, "mount_damping_ratio": 0.05, "amplitude_max_m": math.inf,
    "amplitude_slew_m_per_s": 0.0, "always_on": 0.0,
}  # fmt: skip
FIELDS = tuple(_HEALTHY)
_WARMING_S = 1.0  # time constant of the fault `hot`
_CHATTER_S = 0.08  # part of each second in which the fault `chattering` acts
_LOOSE_DAMPING = 0.05  # damping ratio of the mount in the fault `resonant`


def spoiled(healthy: Mapping[str, float], faults: list[tuple[FaultTable, float]]) -> dict[str, float]:
    """The numbers of an exciter for the acting `faults`, each with the time since its begin [s]."""
    now = dict(healthy)
    for table, since_s in faults:
        size = table.size
        if table.kind == "weak":
            now["delivered_ratio"] *= size
        elif table.kind == "chattering":
            now["delivered_ratio"] *= size if since_s % 1.0 < _CHATTER_S else 1.0
        elif table.kind == "hot":
            now["delivered_ratio"] *= size + (1.0 - size) * math.exp(-since_s / _WARMING_S)
        elif table.kind == "dead":
            now["delivered_ratio"] = 0.0
        elif table.kind == "resonant":
            now["mount_resonance_Hz"], now["mount_damping_ratio"] = size, _LOOSE_DAMPING
        elif table.kind == "always-on":
            now["always_on"] = 1.0
        elif table.kind == "clipping":
            now["amplitude_max_m"] = min(now["amplitude_max_m"], size)
        else:
            now["amplitude_slew_m_per_s"] = size
    return now


class SpoiledExciter:
    """The amplitudes that an exciter with faults executes and delivers for its orders.

    Args:
        block_s: time from an order to the next.

    """

    def __init__(self, block_s: float) -> None:
        self._block_s, self._now = block_s, dict(_HEALTHY)
        self._executed_m = 0.0

    def set(self, faults: list[tuple[FaultTable, float]]) -> None:
        """Set the acting faults."""
        self._now = spoiled(_HEALTHY, faults)

    @property
    def is_always_on(self) -> bool:
        """Whether its enable line is dead."""
        return self._now["always_on"] != 0.0

    @property
    def executed_m(self) -> float | None:
        """Amplitude that it reports as executed; None: it is healthy, and the device's report holds."""
        return self._executed_m if self._now != _HEALTHY else None

    def delivered_m(self, frequency_Hz: float, amplitude_m: float) -> float:
        """The amplitude of the base for an order [m]."""
        now = self._now
        target_m, step_m = min(amplitude_m, now["amplitude_max_m"]), now["amplitude_slew_m_per_s"] * self._block_s
        if step_m > 0.0:
            target_m = min(max(target_m, self._executed_m - step_m), self._executed_m + step_m)
        self._executed_m = target_m
        share = now["delivered_ratio"]
        if (resonance_Hz := now["mount_resonance_Hz"]) > 0.0:
            r = frequency_Hz / resonance_Hz
            share /= math.hypot(1.0 - r * r, 2.0 * now["mount_damping_ratio"] * r)
        return share * target_m
