"""Lost messages and latency of commands, since the viewer first saw the run."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.wire.messages import Records

_PER_DECADE, _DECADES = 20, 7  # bins of the histogram, from 1 us
_EDGES_US = 10.0 ** (np.arange(_PER_DECADE * _DECADES + 1) / _PER_DECADE)


class Lost(NamedTuple):
    """Numbers of messages; each loss belongs to a different link."""

    controller: int  # blocks lost before the controller
    viewer: int  # blocks lost before this viewer
    dropped: int  # messages received but dropped by a full inbox
    commands: int  # commands received by the rig
    late: int  # of these, later than 1 ms
    refused: int  # of these, from another run, out of order, or not finite


class Tally:
    """Counters of one run."""

    def __init__(self) -> None:
        self._controller = self._viewer = self._commands = self._late = self._refused = 0
        self._expected: int | None = None
        self._bins = np.zeros(len(_EDGES_US) - 1, np.int64)

    def add_blocks(self, numbers: npt.NDArray[np.int64]) -> None:
        """Add block numbers, in order."""
        expected = int(numbers[0]) if self._expected is None else self._expected
        self._viewer += int(numbers[-1]) + 1 - expected - len(numbers)
        self._expected = int(numbers[-1]) + 1

    def add_trace(self, trace: Records) -> None:
        """Add steps of the controller."""
        self._controller += int(trace["gap_blocks"].sum())

    def add_applied(self, applied: Records) -> None:
        """Add reports of the rig."""
        self._commands += int(applied["commands"].sum())
        self._late += int(applied["commands_late"].sum())
        self._refused += int(applied["commands_refused"].sum())
        round_trip_ns = applied["round_trip_ns"]
        self._bins += np.histogram(round_trip_ns[round_trip_ns > 0] * 1e-3, _EDGES_US)[0]

    def lost(self, dropped: int) -> Lost:
        """Counts so far; `dropped`: messages dropped by the inbox."""
        return Lost(self._controller, self._viewer, dropped, self._commands, self._late, self._refused)

    def latency(self) -> dict[str, Any] | None:
        """Bin edges [us] and commands per bin, in the format of `cockpit.review`; None without commands."""
        known = np.flatnonzero(self._bins)
        if not len(known):
            return None
        first, end = int(known[0]), int(known[-1]) + 1
        edges = [round(float(edge), 3) for edge in _EDGES_US[first : end + 1]]
        return {"edges_us": edges, "counts": self._bins[first:end].tolist()}

    def percentile_us(self, share: float) -> float | None:
        """Quantile of the latency [us], as the upper edge of its bin; None without commands."""
        total = int(self._bins.sum())
        if not total:
            return None
        at = int(np.searchsorted(np.cumsum(self._bins), math.ceil(share * total)))
        return float(_EDGES_US[at + 1])
