"""The topic `scope`, made from the chunks of a log: a few scalars at 200 Hz in place of messages of 20 samples.

A viewer draws one number a message. The blocks of a stretch of 5 ms become one message with the smallest, mean and largest
sample of each signal. A stretch ends where `t_ns` passes a multiple of 5 ms, whatever the length of a block is.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.block_rows import FIELDS_BYTES, HEAD_BYTES, Rows, rows
from bridge.log.chunk_messages import Bytes, Column, cut
from bridge.wire import topics
from bridge.wire.messages import APPLIED, CHANNELS, SCOPE, TRACE, Layout, Records, sensor_block

PERIOD_NS = 5_000_000
# Blocks that are made into messages at once, those of a second. Fewer: numpy's calls cost more than their work, a third of what
# writing the log costs with the 100 blocks of a chunk; more: a kill loses more of this topic, and viewers look further ahead.
AT_ONCE_BLOCKS = 1000
_ENTRY_BYTES = 16  # of an index
_TIME_AT = 10  # of `t_ns` in every canonical message
_UNIT_AT = {name: name.rindex("_") for name in CHANNELS}
_NAMES = {
    which: [f"{name[: _UNIT_AT[name]]}_{which}{name[_UNIT_AT[name] :]}" for name in CHANNELS]
    for which in ("min", "mean", "max")
}
_OF_APPLIED = ("frequency_Hz", "amplitude_m", "guard_state", "cause")
_OF_TRACE = (
    "vibration_velocity_mps",
    "drive_velocity_mps",
    "wanted_velocity_mps",
    "time_to_slip_s",
    "mode",
    "state",
    "reason",
    "limit",
)


class _Blocks(NamedTuple):
    """Blocks, in order."""

    t_ns: Column  # [blocks]
    log_ns: Column  # [blocks]
    samples: npt.NDArray[np.float32]  # [channels, blocks, samples]


class _Said:
    """What one topic says: the last message of each stretch. Kept are those that were not used, and the newest that was."""

    def __init__(self, topic: str, layout: Layout, fields: Sequence[str]) -> None:
        self.topic, self.layout, self.fields = topic, layout, fields
        self._kept = np.empty(0, f"V{layout.size}")

    def add(self, data: Bytes, starts: Column) -> None:
        """Messages by their starts; those that are not canonical are left out."""
        starts = starts[_lengths(data, starts) == self.layout.size]
        last = np.flatnonzero(np.diff((_times(data, starts) - 1) // PERIOD_NS, append=-1))
        self._kept = np.concatenate([self._kept, cut(data, starts[last], self.layout.size)])

    def fill(self, records: Records) -> None:
        """Write the fields of the newest message up to the end of each stretch; they stay 0 before the first."""
        messages = self._kept.view(self.layout.dtype)
        newest = np.searchsorted(messages["t_ns"], records["t_ns"], side="right") - 1
        known = slice(int(np.searchsorted(newest, 0)), None)
        for field in self.fields:
            records[field][known] = messages[field][newest[known]]
        self._kept = self._kept[max(int(newest[-1]), 0) :]


class ScopeMaker:
    """Makes the messages of the topic from chunks of a log, in order."""

    def __init__(self) -> None:
        self.ends = False  # no block comes after the next chunk
        self._sequence = 0
        self._waiting: list[tuple[bytes, dict[str, bytes]]] = []  # chunks, and the indexes of what is taken from them
        self._blocks_waiting = 0
        self._layout: Layout | None = None  # of the blocks
        self._rest: _Blocks | None = None  # those of the stretch that is not over
        self._said = (
            _Said(topics.APPLIED.name, APPLIED, _OF_APPLIED),
            _Said(topics.TRACE.name, TRACE, _OF_TRACE),
        )

    def of_chunk(self, data: bytes, entries: Mapping[int, Sequence[bytes]], channels: Mapping[str, int]) -> Rows | None:
        """The messages that are due with this chunk; None for none.

        Args:
            data: of the chunk, uncompressed.
            entries: of its index, by channel.
            channels: by topic.

        """
        names = topics.SENSORS.name, topics.APPLIED.name, topics.TRACE.name
        indexes = {name: b"".join(entries.get(channels[name], ())) for name in names}
        self._waiting.append((data, indexes))
        self._blocks_waiting += len(indexes[topics.SENSORS.name]) // _ENTRY_BYTES
        due = self.ends or self._blocks_waiting >= AT_ONCE_BLOCKS
        return self._made(channels, last=self.ends) if due else None

    def rest(self, channels: Mapping[str, int]) -> Rows | None:
        """The messages of what still waits, as no more blocks come; None for none."""
        return self._made(channels, last=True)

    def _made(self, channels: Mapping[str, int], last: bool) -> Rows | None:
        waiting, self._waiting, self._blocks_waiting = self._waiting, [], 0
        joined = waiting[0][0] if len(waiting) == 1 else b"".join([data for data, _ in waiting])
        data = np.frombuffer(joined, np.uint8)
        begins = np.cumsum([0, *(len(data) for data, _ in waiting)])
        for said in self._said:
            starts, _ = _places([indexes[said.topic] for _, indexes in waiting], begins)
            said.add(data, starts)
        blocks = self._blocks(data, *_places([indexes[topics.SENSORS.name] for _, indexes in waiting], begins))
        records, log_ns = self._make(blocks, last) if blocks is not None else (None, np.empty(0, np.int64))
        return None if records is None else rows({channels[topics.SCOPE.name]: records}, {}, log_ns)

    def _blocks(self, data: Bytes, starts: Column, log_ns: Column) -> _Blocks | None:
        """Blocks by their starts, with those that wait; None for none. Another number of samples than before begins anew."""
        if not len(starts):
            return self._rest
        lengths = _lengths(data, starts)
        if self._layout is None or lengths[0] != self._layout.size:
            self._layout = _of_blocks(int(lengths[0])) or self._layout
        if self._layout is None:
            return None
        right = np.flatnonzero(lengths == self._layout.size)
        starts = starts[right]
        fields: Any = self._layout.dtype.fields
        places = np.array([fields[name][1] for name in CHANNELS])
        samples = cut(data, (places[:, None] + starts).ravel(), 4 * self._layout.samples).view("<f4")
        samples = samples.reshape(len(CHANNELS), len(starts), self._layout.samples)
        blocks = _Blocks(_times(data, starts), log_ns[right], samples)
        before = self._rest
        if before is None or before.samples.shape[2] != self._layout.samples:
            return blocks
        return _Blocks(
            np.concatenate([before.t_ns, blocks.t_ns]),
            np.concatenate([before.log_ns, blocks.log_ns]),
            np.concatenate([before.samples, blocks.samples], axis=1),
        )

    def _make(self, blocks: _Blocks, last: bool) -> tuple[Records | None, Column]:
        """Messages of the stretches that are over, and log times; of the last stretch only where no more blocks come."""
        starts = np.flatnonzero(np.diff((blocks.t_ns - 1) // PERIOD_NS, prepend=-1))
        ends = np.append(starts[1:], len(blocks.t_ns))
        self._rest = None
        if not last:  # what the other topics say of it may come in the next chunk
            few = slice(int(starts[-1]), None)
            self._rest = _Blocks(blocks.t_ns[few].copy(), blocks.log_ns[few].copy(), blocks.samples[:, few].copy())
            starts, ends = starts[:-1], ends[:-1]
        if not len(starts):
            return None, ends
        records = SCOPE.blank(len(starts))
        records["sequence"] = self._sequence + np.arange(len(starts), dtype=np.uint64)
        records["t_ns"] = blocks.t_ns[ends - 1]
        self._sequence += len(starts)
        _, count, samples = blocks.samples.shape
        each = blocks.samples.reshape(len(CHANNELS), count * samples)[:, : ends[-1] * samples]
        places = starts * samples
        figures = {
            "min": np.minimum.reduceat(each, places, axis=1),
            "mean": np.add.reduceat(each, places, axis=1) / ((ends - starts) * samples),
            "max": np.maximum.reduceat(each, places, axis=1),
        }
        for which, figure in figures.items():
            for row, field in enumerate(_NAMES[which]):
                records[field] = figure[row]
        for said in self._said:
            said.fill(records)
        return records, blocks.log_ns[ends - 1]


def _places(indexes: Sequence[bytes], begins: Column) -> tuple[Column, Column]:
    """Where the payloads of the messages are in the joined data of chunks, and their log times, from the chunks' indexes."""
    each = [np.frombuffer(index, "<i8").reshape(-1, 2) for index in indexes]
    starts = [index[:, 1] + (begin + HEAD_BYTES) for index, begin in zip(each, begins, strict=False)]
    log_ns = [index[:, 0] for index in each]
    none = np.empty(0, np.int64)
    return np.concatenate([none, *starts]), np.concatenate([none, *log_ns])


def _lengths(data: Bytes, starts: Column) -> Column:
    """The number of bytes of each payload."""
    return cut(data, starts + (1 - HEAD_BYTES), 8).view("<i8") - FIELDS_BYTES


def _times(data: Bytes, starts: Column) -> Column:
    """`t_ns` of each canonical message."""
    return cut(data, starts + _TIME_AT, 8).view("<i8")


def _of_blocks(payload_bytes: int) -> Layout | None:
    """The layout of canonical sensor blocks of this length; None where no number of samples gives it."""
    about = (payload_bytes - sensor_block(1).size) // (len(CHANNELS) * 4) + 1
    likely = [sensor_block(samples) for samples in range(max(about - 1, 1), about + 2)]
    return next((layout for layout in likely if layout.size == payload_bytes), None)
