"""Signals reduced to buckets of a few blocks: smallest, mean and largest sample, so that a slip of a few ms stays visible.

A bucket is 5 ms, or one block where a block is longer. Buckets are aligned to block numbers, so that lost blocks leave a hole
in a curve instead of a line drawn across it.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.wire.messages import CHANNELS, Records

_BUCKET_NS = 5_000_000
# Buckets held back until the rig's and the controller's messages about their blocks have arrived. Fewer: those are missing
_BEHIND = 2
# Queue of a topic for messages whose block has not arrived: 4 s. A controller whose rig is silent repeats itself at 1 kHz
_WAIT = 4096
_MOST = 12_000  # buckets kept for newly opened pages: 60 s
_OF_TRACE = (
    *("vibration_velocity_mps", "drive_velocity_mps", "wanted_velocity_mps", "wanted_amplitude_m"),
    *("time_to_slip_s", "breakaway_force_N", "slips", "mode", "state", "reason", "limit"),
)
_OF_APPLIED = (*("amplitude_m", "frequency_Hz", "guard_state", "cause", "guard_limit", "fallback", "heat_share"),)
_UNKNOWN = {"time_to_slip_s": -1.0, "breakaway_force_N": 0.0, "frequency_Hz": 0.0}  # values that mean "not known"
LEAST, MEAN, MOST = "least", "mean", "most"
COLUMNS = (
    *(f"{channel}.{which}" for channel in CHANNELS for which in (LEAST, MEAN, MOST)),
    *_OF_TRACE,
    *_OF_APPLIED,
)

Floats = npt.NDArray[np.float32]


class Buckets(NamedTuple):
    """Consecutive buckets."""

    first: int  # number of the first; bucket n ends (n + 1) bucket lengths after the start of the run
    values: Floats  # [columns, buckets], SI units; nan: not known, or lost

    @property
    def end(self) -> int:
        """Number after the last bucket."""
        return self.first + self.values.shape[1]


class Bucketing:
    """Reduces one run to buckets.

    Args:
        block_ns: duration of a block.

    """

    def __init__(self, block_ns: int) -> None:
        self.blocks = max(1, round(_BUCKET_NS / block_ns))  # per bucket
        self.step_s = self.blocks * block_ns * 1e-9
        self._rest: dict[str, list[Records]] = {"sensors": [], "trace": [], "applied": []}
        self._next: int | None = None
        self._newest = -1
        self._kept: list[Buckets] = []

    def add(self, topic: str, table: Records, blocks: npt.NDArray[Any]) -> None:
        """Add messages in order; `blocks`: numbers of their blocks, [messages]."""
        if not len(table):
            return
        rest = [*self._rest[topic], table]
        while sum(map(len, rest)) > _WAIT:
            rest = rest[1:] or [rest[0][-_WAIT:]]
        self._rest[topic] = rest
        if topic == "sensors":
            self._newest = max(self._newest, int(blocks[-1]))
            if self._next is None:
                self._next = int(blocks[0]) // self.blocks

    def ready(self) -> Buckets | None:
        """Buckets completed since the last call; None without any."""
        if self._next is None:
            return None
        end = (self._newest + 1) // self.blocks - _BEHIND
        if end <= self._next:
            return None
        first, count = self._next, end - self._next
        values = np.full((len(COLUMNS), count), np.nan, np.float32)
        rows = dict(zip(COLUMNS, values, strict=True))
        for topic in self._rest:
            table, at = self._taken(topic, end)
            inside = at >= first
            table, at = table[inside], at[inside] - first
            if not len(table):
                continue
            starts = np.flatnonzero(np.diff(at, prepend=-1))
            places = at[starts]
            if topic == "sensors":
                for channel in CHANNELS:
                    for which, made in _range(table[channel], starts).items():
                        rows[f"{channel}.{which}"][places] = made
                continue
            last = np.append(starts[1:], len(at)) - 1
            for name in _OF_TRACE if topic == "trace" else _OF_APPLIED:
                known = table[name][last].astype(np.float32)
                rows[name][places] = np.where(known == _UNKNOWN.get(name, np.nan), np.nan, known)
        self._next = end
        made = Buckets(first, values)
        self._keep(made)
        return made

    def kept(self) -> Buckets | None:
        """All buckets of the last minute; None before the first."""
        if not self._kept:
            return None
        values = np.concatenate([bucket.values for bucket in self._kept], axis=1)[:, -_MOST:]
        return Buckets(self._kept[-1].end - values.shape[1], values)

    def _keep(self, made: Buckets) -> None:
        self._kept.append(made)
        while self._kept[-1].end - self._kept[0].end >= _MOST:
            del self._kept[0]

    def _taken(self, topic: str, end: int) -> tuple[Records, npt.NDArray[np.int64]]:
        """Remove and return the messages of buckets before `end`, with their bucket numbers."""
        if not self._rest[topic]:
            return np.empty(0, np.uint8), np.empty(0, np.int64)
        table = np.concatenate(self._rest[topic]) if len(self._rest[topic]) > 1 else self._rest[topic][0]
        at = (block_numbers(topic, table) // self.blocks).astype(np.int64)
        until = int(np.searchsorted(at, end))
        self._rest[topic] = [table[until:]] if until < len(table) else []
        return table[:until], at[:until]


def block_numbers(topic: str, table: Records) -> npt.NDArray[Any]:
    """Block numbers of messages, [messages]."""
    numbers = table["block"] if topic == "trace" else table["sequence"]
    return np.minimum(numbers, np.uint64(2**62)).astype(np.int64)


def _range(samples: Records, starts: npt.NDArray[np.int64]) -> dict[str, Records]:
    """Smallest, mean and largest sample per group of blocks, [groups]; `samples` is [blocks, samples]."""
    blocks = np.diff(np.append(starts, len(samples)))
    return {
        LEAST: np.minimum.reduceat(samples.min(axis=1), starts),
        MEAN: np.add.reduceat(samples.mean(axis=1, dtype=np.float64), starts) / blocks,
        MOST: np.maximum.reduceat(samples.max(axis=1), starts),
    }
