"""The topic `scope`, made from the chunks of a log."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.log.block_rows import FIELDS_BYTES, MessageRows, rows
from bridge.log.chunk_messages import HEAD, INDEX_ENTRY, Bytes, Column, cut
from bridge.log.viewers.stretches import ScopeBlocks, Stretches, last_of_stretches
from bridge.wire import topics
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import APPLIED, TRACE, Layout, sensor_block

# Blocks that become messages at once: one second. Fewer: numpy's call overhead dominates; with the 100 blocks of a chunk it is a
# third of the cost of writing the log. More: a kill loses more of this topic, and viewers must look further ahead.
AT_ONCE_BLOCKS = 1000


class ScopeMaker:
    """Makes the messages of the topic from chunks of a log, in order."""

    def __init__(self) -> None:
        self.ends = False  # True: no block follows the next chunk
        self._waiting: list[tuple[bytes, dict[str, bytes]]] = []  # chunks, and their indexes by topic
        self._blocks_waiting = 0
        self._layout: Layout | None = None  # layout of the sensor blocks
        self._stretches = Stretches()

    def of_chunk(
        self, data: bytes, entries: Mapping[int, Sequence[bytes]], channels: Mapping[str, int]
    ) -> MessageRows | None:
        """The messages due with this chunk; None for none.

        Args:
            data: bytes of the chunk, uncompressed.
            entries: entries of the chunk's index, by channel.
            channels: channel numbers by topic.

        """
        names = topics.SENSORS.name, topics.APPLIED.name, topics.TRACE.name
        indexes = {name: b"".join(entries.get(channels[name], ())) for name in names}
        self._waiting.append((data, indexes))
        self._blocks_waiting += len(indexes[topics.SENSORS.name]) // INDEX_ENTRY.itemsize
        due = self.ends or self._blocks_waiting >= AT_ONCE_BLOCKS
        return self._made(channels, last=self.ends) if due else None

    def rest(self, channels: Mapping[str, int]) -> MessageRows | None:
        """The messages of the remaining blocks at the end of a run; None for none."""
        return self._made(channels, last=True)

    def _made(self, channels: Mapping[str, int], last: bool) -> MessageRows | None:
        waiting, self._waiting, self._blocks_waiting = self._waiting, [], 0
        joined = waiting[0][0] if len(waiting) == 1 else b"".join([data for data, _ in waiting])
        data = np.frombuffer(joined, np.uint8)
        begins = np.cumsum([0, *(len(data) for data, _ in waiting)])
        for topic, layout in ((topics.APPLIED.name, APPLIED), (topics.TRACE.name, TRACE)):
            heads, starts = _heads_and_starts(data, [indexes[topic] for _, indexes in waiting], begins)
            right = np.flatnonzero(heads["length"] == FIELDS_BYTES + layout.size)
            last_rows = right[last_of_stretches(heads["publish_ns"].astype(np.int64)[right])]
            self._stretches.add(topic, cut(data, starts[last_rows], layout.size).view(layout.dtype))
        blocks = self._blocks(
            data, *_heads_and_starts(data, [indexes[topics.SENSORS.name] for _, indexes in waiting], begins)
        )
        records, log_ns = self._stretches.made(blocks, last)
        return None if records is None else rows({channels[topics.SCOPE.name]: records}, {}, log_ns)

    def _blocks(self, data: Bytes, heads: npt.NDArray[Any], starts: Column) -> ScopeBlocks | None:
        """Blocks by their heads and starts; None for none. A change of the number of samples starts a new layout."""
        if not len(starts):
            return None
        lengths, t_ns, log_ns = (heads[name].astype(np.int64) for name in ("length", "publish_ns", "log_ns"))
        lengths -= FIELDS_BYTES
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
        return ScopeBlocks(t_ns[right], log_ns[right], samples)


def _heads_and_starts(data: Bytes, indexes: Sequence[bytes], begins: Column) -> tuple[npt.NDArray[Any], Column]:
    """Heads of the messages in the joined chunks (publish time = `t_ns`), and the starts of their payloads."""
    each = [np.frombuffer(index, "<i8")[1::2] + begin for index, begin in zip(indexes, begins, strict=False)]
    offsets = np.concatenate([np.empty(0, np.int64), *each])
    return cut(data, offsets, HEAD.itemsize).view(HEAD), offsets + HEAD.itemsize


def _of_blocks(payload_bytes: int) -> Layout | None:
    """The layout of canonical sensor blocks of this length; None if no number of samples gives this length."""
    about = (payload_bytes - sensor_block(1).size) // (len(CHANNELS) * 4) + 1
    likely = [sensor_block(samples) for samples in range(max(about - 1, 1), about + 2)]
    return next((layout for layout in likely if layout.size == payload_bytes), None)
