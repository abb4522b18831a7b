"""Faults of the exciter: the true motion of the base under an allowed command. They change the rig's parameters."""

from typing import Any

from bridge.rig.faults.exciter import FIELDS, spoiled
from bridge.rig.faults.table import FaultTable


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
        for name, value in spoiled(self._healthy, faults).items():
            self._params[name] = value
