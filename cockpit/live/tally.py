"""What was lost on the way, and how late commands were, since a viewer has listened to a run."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.wire.messages import Records

_PER_DECADE, _DECADES = 20, 7  # bars of the histogram, from 1 us on
_EDGES_US = 10.0 ** (np.arange(_PER_DECADE * _DECADES + 1) / _PER_DECADE)


class Lost(NamedTuple):
    """Numbers of messages; each is a loss of another link."""

    controller: int  # blocks that the controller never got
    viewer: int  # blocks that never came to this viewer
    dropped: int  # messages that came, and were dropped here as it was too slow
    commands: int  # commands that the rig got
    late: int  # of them, those that took longer than 1 ms
    refused: int  # of them, those of another run, out of order, or no numbers


class Tally:
    """Counts over one run."""

    def __init__(self) -> None:
        self._controller = self._viewer = self._commands = self._late = self._refused = 0
        self._expected: int | None = None
        self._bins = np.zeros(len(_EDGES_US) - 1, np.int64)

    def add_blocks(self, numbers: npt.NDArray[np.int64]) -> None:
        """Take the numbers of blocks, in order."""
        expected = int(numbers[0]) if self._expected is None else self._expected
        self._viewer += int(numbers[-1]) + 1 - expected - len(numbers)
        self._expected = int(numbers[-1]) + 1

    def add_trace(self, trace: Records) -> None:
        """Take steps of the controller."""
        self._controller += int(trace["gap_blocks"].sum())

    def add_applied(self, applied: Records) -> None:
        """Take what the rig did."""
        self._commands += int(applied["commands"].sum())
        self._late += int(applied["commands_late"].sum())
        self._refused += int(applied["commands_refused"].sum())
        round_trip_ns = applied["round_trip_ns"]
        self._bins += np.histogram(round_trip_ns[round_trip_ns > 0] * 1e-3, _EDGES_US)[0]

    def lost(self, dropped: int) -> Lost:
        """The numbers up to now; `dropped`: messages that did not fit into the inbox."""
        return Lost(self._controller, self._viewer, dropped, self._commands, self._late, self._refused)

    def latency(self) -> dict[str, Any] | None:
        """Edges of bars [us] and how many commands are in each, as a page of `cockpit.review` has it; None without commands."""
        known = np.flatnonzero(self._bins)
        if not len(known):
            return None
        first, end = int(known[0]), int(known[-1]) + 1
        edges = [round(float(one), 3) for one in _EDGES_US[first : end + 1]]
        return {"edges_us": edges, "counts": self._bins[first:end].tolist()}

    def percentile_us(self, share: float) -> float | None:
        """The upper edge of the bar [us] that holds this share of the commands; None without commands."""
        total = int(self._bins.sum())
        if not total:
            return None
        at = int(np.searchsorted(np.cumsum(self._bins), math.ceil(share * total)))
        return float(_EDGES_US[at + 1])
