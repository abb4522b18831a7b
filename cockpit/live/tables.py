"""A batch of messages of one topic (some 0.05 s of them) as one array."""

import contextlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import Layout, Records, sensor_block
from bridge.wire.payloads import parsed
from bridge.wire.topics import SENSORS

_MOST_SAMPLES = 400  # most samples per channel and block


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
