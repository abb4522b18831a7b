"""Events as `foxglove.Log`, the public message type that the log panels of viewers show.

`foxglove/Log.proto` defines it. The type is made in a private pool, so that another package's definition of the same name does
not conflict.
"""

from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import EVENTS
from bridge.wire.words import CHECK, FAILURE, MAINTENANCE, NEWS, OUTSIDE

TOPIC = "log"
SCHEMA = "foxglove.Log"
_LEVEL = {FAILURE: 4, OUTSIDE: 3, MAINTENANCE: 3, CHECK: 2, NEWS: 2}

FILES = descriptor_pb2.FileDescriptorSet.FromString((Path(__file__).parent / "foxglove" / "Log.desc").read_bytes())
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
