"""Messages of ROS 2 in an MCAP file as channels, each topic on its own clock."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bridge.faults import Fault
from bridge.tables.table import ChannelClock, Table

_DEEPEST = 6  # deepest level of nested messages that is read
_MOST_ITEMS = 64  # longest array whose elements are channels: joints are, the pixels of a picture are not


def read_ros_log(path: Path) -> Table:
    """Numbers of all messages as `TOPIC.FIELD.FIELD`; elements of arrays as `TOPIC.FIELD[0]`, or by the joint's name.

    Time is the stamp in the header of a message, or else its log time; it counts from the earliest.
    Raises Fault BAD_TABLE for a file without messages of ROS 2.
    """
    times: dict[str, list[int]] = {}
    values: dict[str, list[float]] = {}
    for topic, message, logged_ns in _messages(path):
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        at_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec) if stamp is not None and stamp.sec else logged_ns
        for name, value in _numbers(message, topic, 0):
            times.setdefault(name, []).append(at_ns)
            values.setdefault(name, []).append(value)
    if not values:
        raise Fault("BAD_TABLE", f"{path.name}: has no numbers in messages of ROS 2; give another file")
    began_ns = min(at[0] for at in times.values())
    columns = {name: np.array(numbers) for name, numbers in values.items()}
    clocks: dict[str, ChannelClock] = {}
    for name, at in times.items():
        since_s = (np.array(at, np.int64) - np.int64(began_ns)).astype(np.float64) * 1e-9
        clocks[name] = ChannelClock(0.0, 0.0, np.asarray(since_s, np.float64))
    return Table(path, columns, clocks=clocks)


def _messages(path: Path) -> Iterator[tuple[str, Any, int]]:
    """Topic, message and log time [ns] of every message of ROS 2."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    factory: Any = DecoderFactory()
    decoders: dict[int, Any] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.id not in decoders:
                decoders[channel.id] = factory.decoder_for(channel.message_encoding, schema)
            if decoders[channel.id] is not None:
                yield channel.topic, decoders[channel.id](message.data), message.log_time


def _numbers(message: Any, key: str, depth: int) -> Iterator[tuple[str, float]]:
    if depth > _DEEPEST:
        return
    fields = [name for name in getattr(message, "__slots__", ()) if name not in ("header", "layout", "_type")]
    names = getattr(message, "name", None)
    for field in fields:
        value = getattr(message, field)
        at = f"{key}.{field}"
        if isinstance(value, bool | int | float):
            yield at, float(value)
        elif isinstance(value, list | tuple | np.ndarray) and 0 < len(value) <= _MOST_ITEMS:
            items: list[Any] = list(value)
            named = names if isinstance(names, list) and len(names) == len(items) else list(range(len(items)))
            for label, item in zip(named, items, strict=True):
                if isinstance(item, int | float | np.number):
                    yield f"{at}[{label}]", float(item)
        elif hasattr(value, "__slots__"):
            yield from _numbers(value, at, depth + 1)
