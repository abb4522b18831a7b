"""Curves of the last minute: stretches of `bridge.log.viewers` as columns on an even time grid.

A bucket is 5 ms, or one block where a block is longer. Lost blocks leave a hole in a curve instead of a line drawn across it.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.viewers.stretches import PERIOD_NS, Envelope, ScopeBlocks, Stretches, fields_of
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import Records
from cockpit.figures.signals import BANDS, PANELS, SIGNALS

# Stretches held back: the unfinished stretch, and two more until the messages of rig and controller about them have arrived.
# Fewer: these messages are missing.
_BEHIND = 3
_MOST = 12_000  # buckets kept for newly opened pages: 60 s
_CURVES = [signal for panel in PANELS for signal in panel.signals]
_RANGES = {
    f"{signal.name}.{which}": field
    for signal in _CURVES
    if signal.topic == "sensors"
    for which, field in zip(Envelope._fields, fields_of(signal.name), strict=True)
}
_VALUES = (*(signal.name for signal in _CURVES if signal.topic != "sensors"), *(band.field for band in BANDS), "slips")
_FIELDS = _RANGES | {name: name for name in _VALUES}  # field of a stretch by column
COLUMNS = tuple(_FIELDS)
_STRETCH = np.dtype([("sequence", "u8"), ("t_ns", "i8"), *((field, "f4") for field in _FIELDS.values())])


class Buckets(NamedTuple):
    """Consecutive buckets."""

    first: int  # number of the first bucket; bucket n ends (n + 1) bucket lengths after the start of the run
    values: npt.NDArray[np.float32]  # [columns, buckets], SI units; nan: not known, or lost

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
        self._period_ns = max(PERIOD_NS, block_ns)
        self.step_s = self._period_ns * 1e-9
        self.blocks = self._period_ns // block_ns  # blocks per bucket
        self._stretches = Stretches(lambda count: np.zeros(count, _STRETCH), self._period_ns, _BEHIND, self._period_ns)
        self._kept: list[Buckets] = []

    def add(self, topic: str, messages: Records) -> None:
        """Add messages of `applied` or `trace`, in order."""
        self._stretches.add(topic, messages)

    def made(self, blocks: Records | None) -> Buckets | None:
        """Buckets completed by these blocks, in order; None without any."""
        if blocks is None:
            return None
        t_ns = blocks["t_ns"]
        samples = np.stack([blocks[channel] for channel in CHANNELS])
        records, _ = self._stretches.made(ScopeBlocks(t_ns, t_ns, samples), last=False)
        if records is None:
            return None
        at = (records["t_ns"] - 1) // self._period_ns
        first = self._kept[-1].end if self._kept else int(at[0])
        values = np.full((len(COLUMNS), int(at[-1]) + 1 - first), np.nan, np.float32)
        for row, (column, field) in zip(values, _FIELDS.items(), strict=True):
            row[at - first] = records[field]
            if column in SIGNALS:
                row[row == SIGNALS[column].unknown] = np.nan
        self._kept.append(Buckets(first, values))
        while self._kept[-1].end - self._kept[0].end >= _MOST:
            del self._kept[0]
        return self._kept[-1]

    def kept(self) -> Buckets | None:
        """All buckets of the last minute; None before the first."""
        if not self._kept:
            return None
        values = np.concatenate([bucket.values for bucket in self._kept], axis=1)[:, -_MOST:]
        return Buckets(self._kept[-1].end - values.shape[1], values)


def block_numbers(topic: str, table: Records) -> npt.NDArray[np.int64]:
    """Block numbers of messages, [messages]."""
    numbers = table["block"] if topic == "trace" else table["sequence"]
    return np.minimum(numbers, np.uint64(2**62)).astype(np.int64)
