"""Faults of the rig's clock: wrong times and numbers of its blocks, while the rig itself continues."""

from typing import Any

from bridge.rig.faults.table import FaultTable


class ClockFault:
    """One fault of the clock."""

    def __init__(self, table: FaultTable) -> None:
        self._kind, self._size = table.kind, table.size
        self._held_ns: int | None = None

    def misdate(self, message: Any, since_s: float) -> None:
        """Change the time or the number of a message, a record with `sequence` and `t_ns`, in place."""
        t_ns = int(message["t_ns"])
        if self._kind == "renumbered":
            message["sequence"] = max(int(message["sequence"]) + round(self._size), 0)
            return
        if self._held_ns is None:
            self._held_ns = t_ns
        error_ns = {"jump": self._size * 1e9, "fast": self._size * since_s * 1e9}.get(self._kind, self._held_ns - t_ns)
        message["t_ns"] = max(t_ns + round(error_ns), 0)
