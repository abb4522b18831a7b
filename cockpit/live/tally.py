"""Lost messages and latency of commands, since the viewer first saw the run."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.watches.histogram import Histogram
from bridge.wire.messages import Records


class Lost(NamedTuple):
    """Numbers of messages; each loss belongs to a different link."""

    controller: int  # blocks lost before the controller
    viewer: int  # blocks lost before this viewer
    dropped: int  # messages received but dropped by a full inbox
    commands: int  # commands received by the rig
    late: int  # commands later than 1 ms
    refused: int  # commands from another run, out of order, or not finite


class Tally:
    """Counters of one run."""

    def __init__(self) -> None:
        self._controller = self._viewer = self._commands = self._late = self._refused = 0
        self._expected: int | None = None
        self.latency_us = Histogram()

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
        self.latency_us.add(applied["round_trip_ns"][applied["round_trip_ns"] > 0] * 1e-3)

    def lost(self, dropped: int) -> Lost:
        """Counts so far; `dropped`: messages dropped by the inbox."""
        return Lost(self._controller, self._viewer, dropped, self._commands, self._late, self._refused)

    def percentile_us(self, share: float) -> float | None:
        """Quantile of the latency [us]; None without commands."""
        return self.latency_us.quantile(share) if self.latency_us.count else None
