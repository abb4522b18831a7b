"""The topic `scope`, made from the chunks of a log."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bridge.log.block_rows import FIELDS_BYTES, HEAD_BYTES, Rows, rows
from bridge.log.chunk_messages import Bytes, Column, cut
from bridge.log.viewers.stretches import Blocks, Stretches
from bridge.wire import topics
from bridge.wire.messages import APPLIED, CHANNELS, TRACE, Layout, sensor_block

# Blocks that are made into messages at once, those of a second. Fewer: numpy's calls cost more than their work, a third of what
# writing the log costs with the 100 blocks of a chunk; more: a kill loses more of this topic, and viewers look further ahead.
AT_ONCE_BLOCKS = 1000
_ENTRY_BYTES = 16  # of an index
_TIME_AT = 10  # of `t_ns` in every canonical message


class ScopeMaker:
    """Makes the messages of the topic from chunks of a log, in order."""

    def __init__(self) -> None:
        self.ends = False  # no block comes after the next chunk
        self._waiting: list[tuple[bytes, dict[str, bytes]]] = []  # chunks, and the indexes of what is taken from them
        self._blocks_waiting = 0
        self._layout: Layout | None = None  # of the blocks
        self._stretches = Stretches()

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
        for topic, layout in ((topics.APPLIED.name, APPLIED), (topics.TRACE.name, TRACE)):
            starts, _ = _places([indexes[topic] for _, indexes in waiting], begins)
            starts = starts[_lengths(data, starts) == layout.size]
            self._stretches.say(topic, cut(data, starts, layout.size).view(layout.dtype))
        blocks = self._blocks(data, *_places([indexes[topics.SENSORS.name] for _, indexes in waiting], begins))
        records, log_ns = self._stretches.made(blocks, last)
        return None if records is None else rows({channels[topics.SCOPE.name]: records}, {}, log_ns)

    def _blocks(self, data: Bytes, starts: Column, log_ns: Column) -> Blocks | None:
        """Blocks by their starts; None for none. Another number of samples than before begins anew."""
        if not len(starts):
            return None
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
        return Blocks(_times(data, starts), log_ns[right], samples)


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
