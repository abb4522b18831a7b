"""Faults of the exciter: the true motion of the base under an allowed command. They change the rig's parameters."""

import math
from typing import Any

from bridge.rig.faults.table import FaultTable

FIELDS = (
    *("delivered_ratio", "mount_resonance_Hz", "mount_damping_ratio", "amplitude_max_m", "amplitude_slew_m_per_s"),
    "always_on",
)
_WARMING_S = 1.0  # time constant of the fault `hot`
_CHATTER_S = 0.08  # part of each second in which the fault `chattering` acts
_LOOSE_DAMPING = 0.05  # damping ratio of the mount in the fault `resonant`


class ExciterFaults:
    """Sets the exciter's numbers in `plant.records.PARAMS` from the healthy rig and the acting faults.

    Args:
        params: record of the rig.

    """

    def __init__(self, params: Any) -> None:
        self._params = params
        self._healthy = {name: float(params[name]) for name in FIELDS}

    def set(self, faults: list[tuple[FaultTable, float]]) -> None:
        """Set the numbers for the acting `faults`, each with the time since its begin [s]."""
        now = dict(self._healthy)
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
        for name, value in now.items():
            self._params[name] = value
