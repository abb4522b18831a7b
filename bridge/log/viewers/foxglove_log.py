"""Events as `foxglove.Log`, the public message type that the log panels of viewers show.

Its definition is https://docs.foxglove.dev/docs/sdk/schemas/log. It is built here in a private pool, so that another package's
definition of the same name does not conflict.
"""

from typing import Any

from google.protobuf import descriptor_pb2, timestamp_pb2
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import CHECK, EVENTS, FAILURE, MAINTENANCE, NEWS, OUTSIDE

TOPIC = "log"
SCHEMA = "foxglove.Log"
_LEVELS = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")
_LEVEL = {FAILURE: 4, OUTSIDE: 3, MAINTENANCE: 3, CHECK: 2, NEWS: 2}
_FIELDS = (
    ("timestamp", FieldDescriptor.TYPE_MESSAGE, ".google.protobuf.Timestamp"),
    ("level", FieldDescriptor.TYPE_ENUM, ".foxglove.Log.Level"),
    ("message", FieldDescriptor.TYPE_STRING, None),
    ("name", FieldDescriptor.TYPE_STRING, None),
    ("file", FieldDescriptor.TYPE_STRING, None),
    ("line", FieldDescriptor.TYPE_FIXED32, None),
)


def _described() -> descriptor_pb2.FileDescriptorSet:
    files = descriptor_pb2.FileDescriptorSet()
    timestamp_pb2.DESCRIPTOR.CopyToProto(files.file.add())
    file = files.file.add(name="foxglove/Log.proto", package="foxglove", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    message = file.message_type.add(name="Log")
    level = message.enum_type.add(name="Level")
    for number, name in enumerate(_LEVELS):
        level.value.add(name=name, number=number)
    for number, (name, kind, type_name) in enumerate(_FIELDS, 1):
        label = FieldDescriptor.LABEL_OPTIONAL
        message.field.add(name=name, number=number, type=kind, label=label, type_name=type_name)  # pyright: ignore[reportArgumentType]
    return files


FILES = _described()
_pool = DescriptorPool()
for _file in FILES.file:
    _pool.Add(_file)
Log: Any = GetMessageClass(_pool.FindMessageTypeByName(SCHEMA))


def of_event(event: wire.Event, log_time_ns: int) -> bytes:
    """The message for an event written at `log_time_ns`, with the level of the event's code."""
    seconds, nanos = divmod(log_time_ns, 1_000_000_000)
    known = EVENTS.get(event.code)
    level = _LEVEL[known.letter] if known else _LEVEL[OUTSIDE]
    text = f"{event.code}: {event.text}"
    message = Log(level=level, message=text, name=event.source)
    message.timestamp.seconds, message.timestamp.nanos = seconds, nanos
    return message.SerializeToString()
