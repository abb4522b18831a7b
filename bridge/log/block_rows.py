"""Messages of many blocks as the bytes of an MCAP chunk, without a loop over messages."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode

from bridge.arrays import Records
from bridge.log.chunk_messages import FIELDS_BYTES, HEAD, INDEX_ENTRY


class MessageRows(NamedTuple):
    """The message records of a part of a chunk, and their places."""

    data: memoryview  # the bytes of the records
    entries: dict[int, npt.NDArray[Any]]  # log time [ns] and offset in `data` of each message, by channel
    first_ns: int
    last_ns: int


def _record(payload_bytes: int) -> np.dtype[Any]:
    return np.dtype([*HEAD.descr, ("payload", f"V{payload_bytes}")])


def _fill(place: npt.NDArray[Any], channel: int, messages: Records, log_ns: npt.NDArray[np.int64]) -> None:
    """Write message records into `place`, whose shape gives their order."""
    payloads = messages.view(f"V{messages.dtype.itemsize}").reshape(place.shape)
    place["opcode"], place["channel"] = Opcode.MESSAGE, channel
    place["length"] = FIELDS_BYTES + messages.dtype.itemsize
    place["sequence"] = (messages["sequence"] & 0xFFFFFFFF).reshape(place.shape)
    place["publish_ns"] = messages["t_ns"].reshape(place.shape)
    place["log_ns"] = log_ns.reshape(place.shape)
    place["payload"] = payloads


def rows(
    each: Mapping[int, Records], after: Mapping[int, Records], log_ns: npt.NDArray[np.int64] | None = None
) -> MessageRows:
    """Lay messages out in order of time.

    Args:
        each: topics with one message per block, by channel, [blocks].
        after: topics with one message after every n blocks, by channel, [blocks / n]; may be empty.
        log_ns: log time of the blocks, for an empty `after`; default: the time of the run.

    """
    blocks = len(next(iter(each.values())))
    groups = len(next(iter(after.values()))) if after else 1
    block = np.dtype([(str(channel), _record(table.dtype.itemsize)) for channel, table in each.items()])
    last = [(str(channel), _record(table.dtype.itemsize)) for channel, table in after.items()]
    group = np.dtype([("blocks", block, (blocks // groups,)), *last])
    laid_out = np.empty(groups, group)  # without gaps; every byte is filled
    starts = np.arange(groups, dtype=np.uint64) * np.uint64(group.itemsize)
    block_starts = np.arange(blocks // groups, dtype=np.uint64) * np.uint64(block.itemsize)
    entries: dict[int, npt.NDArray[Any]] = {}
    places = [
        *(
            (channel, each[channel], laid_out["blocks"][str(channel)], block, starts[:, None] + block_starts)
            for channel in each
        ),
        *((channel, after[channel], laid_out[str(channel)], group, starts) for channel in after),
    ]
    for channel, messages, place, outer, offsets in places:
        log_times = messages["t_ns"] if log_ns is None else log_ns
        _fill(place, channel, messages, log_times)
        fields: Any = outer.fields
        entries[channel] = np.empty(len(messages), INDEX_ENTRY)
        entries[channel]["log_ns"] = log_times
        entries[channel]["offset"] = (offsets + np.uint64(fields[str(channel)][1])).ravel()
    times = next(iter(each.values()))["t_ns"] if log_ns is None else log_ns
    return MessageRows(laid_out.view(np.uint8).data, entries, int(times[0]), int(times[-1]))
