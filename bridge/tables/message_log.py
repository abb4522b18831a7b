"""Messages of an MCAP file as channels, each topic on its own clock: ROS 2, protobuf and JSON."""

import json
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.table import ChannelClock, Table
from bridge.units import counted

_DEEPEST = 6  # deepest level of nested messages that is read
_MOST_ITEMS = 64  # longest array whose elements are channels: joints are, the pixels of a picture are not
_FURTHER_ON = (
    'record it as ROS 2 with "ros2msg" schemas, as protobuf or as JSON; `rosbags-convert` converts a bag of ROS 1'
)


def read_message_log(path: Path) -> Table:
    """Numbers of all messages as `TOPIC.FIELD.FIELD`; elements of arrays as `TOPIC.FIELD[0]`, or by the joint's name.

    Time is the stamp in the header of a message, or else its log time; it counts from the earliest.
    Raises Fault BAD_TABLE for a file without messages that can be decoded.
    """
    times: dict[str, list[int]] = {}
    values: dict[str, list[float]] = {}
    unread: Counter[str] = Counter()
    findings: list[Finding] = []
    for topic, message, logged_ns in _messages(path, unread, findings):
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        seconds, nanos = (getattr(stamp, name, 0) for name in ("sec", "nanosec"))
        at_ns = int(seconds) * 1_000_000_000 + int(nanos) if seconds else logged_ns
        for name, value in _numbers(message, topic, 0):
            times.setdefault(name, []).append(at_ns)
            values.setdefault(name, []).append(value)
    others = ", ".join(f"{topic} ({count})" for topic, count in unread.items())
    if not values:
        line = f"{path.name}: holds no numbers in messages that are decoded here"
        raise Fault("BAD_TABLE", f"{line}: {others}; {_FURTHER_ON}" if others else f"{line}; give another file")
    if others:
        findings.append(Finding("missing", path.name, f"messages that are not decoded here left out: {others}"))
    began_ns = min(at[0] for at in times.values())
    columns = {name: np.array(numbers) for name, numbers in values.items()}
    clocks: dict[str, ChannelClock] = {}
    for name, at in times.items():
        since_s = (np.array(at, np.int64) - np.int64(began_ns)).astype(np.float64) * 1e-9
        clocks[name] = ChannelClock(0.0, 0.0, np.asarray(since_s, np.float64))
    return Table(path, columns, clocks=clocks, findings=findings, names_are_paths=True)


def _messages(path: Path, unread: Counter[str], findings: list[Finding]) -> Iterator[tuple[str, Any, int]]:
    """Topic, message and log time [ns] of every message; topics that cannot be decoded are counted in `unread`."""
    from mcap_protobuf.decoder import DecoderFactory as Protobuf
    from mcap_ros2.decoder import DecoderFactory as Ros2

    factories: list[Any] = [Ros2(), Protobuf()]
    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    with path.open("rb") as file:
        for schema, channel, message in _records(file, path.name, findings):
            if channel.id not in decoders:
                choices = (factory.decoder_for(channel.message_encoding, schema) for factory in factories)
                of_json = json.loads if channel.message_encoding == "json" else None
                decoders[channel.id] = next((decoder for decoder in choices if decoder is not None), of_json)
            decoder = decoders[channel.id]
            if decoder is None:
                how = f"{channel.message_encoding} with {schema.encoding}" if schema else channel.message_encoding
                unread[f"{channel.topic}, {how}"] += 1
            else:
                yield channel.topic, decoder(message.data), message.log_time


def _records(file: Any, name: str, findings: list[Finding]) -> Iterator[tuple[Any, Any, Any]]:
    """Schema, channel and message, in the order of their log times; of a file without an end up to where it is cut."""
    from mcap.exceptions import McapError
    from mcap.reader import make_reader
    from mcap.records import Channel, Message, Schema
    from mcap.stream_reader import StreamReader

    reader = make_reader(file)
    with suppress(McapError, struct.error, EOFError):
        if reader.get_summary() is not None:
            yield from reader.iter_messages()
            return
    file.seek(0)
    schemas: dict[int, Any] = {}
    channels: dict[int, Any] = {}
    messages: list[Any] = []
    with suppress(McapError, struct.error, EOFError):
        for record in StreamReader(file).records:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                messages.append(record)
    text = f"its end is missing, as after a recorder that was killed: {counted(len(messages), 'message')} up to the cut are read"
    findings.append(Finding("cut", name, text, len(messages)))
    for message in sorted(messages, key=lambda message: message.log_time):
        channel = channels[message.channel_id]
        yield schemas.get(channel.schema_id), channel, message


def _fields_of(message: Any) -> dict[str, Any]:
    """The fields of a message of ROS 2, of protobuf or of JSON."""
    if isinstance(message, dict):
        return message
    if hasattr(message, "DESCRIPTOR"):
        return {field.name: getattr(message, field.name) for field in message.DESCRIPTOR.fields}
    return {name: getattr(message, name) for name in getattr(message, "__slots__", ())}


def _numbers(message: Any, key: str, depth: int) -> Iterator[tuple[str, float]]:
    if depth > _DEEPEST:
        return
    fields = _fields_of(message)
    names = fields.get("name")
    for field, value in fields.items():
        if field in ("header", "layout", "_type"):
            continue
        at = f"{key}.{field}"
        if isinstance(value, bool | int | float):
            yield at, float(value)
        elif _is_list(value):
            items: list[Any] = list(value)[: _MOST_ITEMS + 1]
            if not 0 < len(items) <= _MOST_ITEMS:
                continue
            named = list(names) if _is_list(names) and len(names) == len(items) else list(range(len(items)))
            for label, item in zip(named, items, strict=True):
                if isinstance(item, int | float | np.number):
                    yield f"{at}[{label}]", float(item)
        elif isinstance(value, dict) or hasattr(value, "__slots__") or hasattr(value, "DESCRIPTOR"):
            yield from _numbers(value, at, depth + 1)


def _is_list(value: Any) -> TypeGuard[Sequence[Any]]:
    return hasattr(value, "__len__") and hasattr(value, "__iter__") and not isinstance(value, str | bytes | dict)
