"""Messages of a topic as an array; lost messages and latency; curves of the last minute as columns on an even time grid.

The curves are stretches of `bridge.log.viewers`. A bucket is 5 ms, or one block where a block is longer. Lost blocks leave a
hole in a curve instead of a line drawn across it.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.log.viewers.stretches import PERIOD_NS, Envelope, ScopeBlocks, Stretches, fields_of
from bridge.log.watches.histogram import Histogram
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import Layout, sensor_block
from bridge.wire.payloads import parsed
from bridge.wire.topics import SENSORS
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
_MOST_SAMPLES = 400  # most samples per channel of a block; a block with more counts as unreadable


class Buckets(NamedTuple):
    """Consecutive buckets, the curves of 5 ms each."""

    first: int  # number of the first bucket; bucket n ends (n + 1) bucket lengths after the start of the run
    values: npt.NDArray[np.float32]  # [columns, buckets], SI units; nan: not known, or lost

    @property
    def end(self) -> int:
        """Number after the last bucket."""
        return self.first + self.values.shape[1]


class Bucketing:
    """Reduces one run, with blocks of `block_ns`, to buckets."""

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
        for row, (column, name) in zip(values, _FIELDS.items(), strict=True):
            row[at - first] = records[name]
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


def table_of(layout: Layout, payloads: Sequence[bytes], topic: str) -> Records:
    """The messages, [messages], without unreadable ones."""
    if all(len(payload) == layout.size for payload in payloads):
        joined = np.frombuffer(b"".join(payloads), np.uint8).reshape(len(payloads), layout.size)
        if layout.all_canonical(joined):
            return joined.reshape(-1).view(layout.dtype)
    good: list[bytes] = []
    for payload in payloads:
        with contextlib.suppress(Fault):
            good.append(layout.canonical(payload, topic))
    return np.frombuffer(b"".join(good), layout.dtype)


class SensorTables:
    """Reads the blocks of one rig. Keeps the block length of the first readable block until no block has it."""

    def __init__(self) -> None:
        self._layout: Layout | None = None

    def of(self, payloads: Sequence[bytes]) -> Records | None:
        """Blocks of one length, [blocks]; None if none is readable."""
        for layout in (self._layout, None):
            known = layout or next((sensor_block(samples) for samples in map(_samples, payloads) if samples), None)
            table = table_of(known, payloads, SENSORS.name) if known is not None else None
            if table is not None and len(table):
                self._layout = known
                return table
        return None


def _samples(payload: bytes) -> int:
    """Number of samples per channel in a block; 0 for an unreadable block."""
    with contextlib.suppress(Fault):
        block: Any = parsed(wire.SensorBlock, payload, SENSORS.name)
        lengths = {len(getattr(block, channel)) for channel in CHANNELS}
        if len(lengths) == 1 and 0 < max(lengths) <= _MOST_SAMPLES:
            return max(lengths)
    return 0


@dataclass
class Tally:
    """Counters of one run; each loss belongs to a different link."""

    controller: int = 0  # blocks lost before the controller
    viewer: int = 0  # blocks lost before this viewer
    commands: int = 0  # commands received by the rig
    late: int = 0  # commands later than 1 ms
    refused: int = 0  # commands from another run, out of order, or not finite
    latency_us: Histogram = field(default_factory=Histogram)
    _expected: int | None = None

    def add_blocks(self, numbers: npt.NDArray[np.int64]) -> None:
        """Add block numbers, in order."""
        expected = int(numbers[0]) if self._expected is None else self._expected
        self.viewer += int(numbers[-1]) + 1 - expected - len(numbers)
        self._expected = int(numbers[-1]) + 1

    def add_applied(self, applied: Records) -> None:
        """Add `applied` messages of the rig."""
        self.commands += int(applied["commands"].sum())
        self.late += int(applied["commands_late"].sum())
        self.refused += int(applied["commands_refused"].sum())
        self.latency_us.add(applied["round_trip_ns"][applied["round_trip_ns"] > 0] * 1e-3)
