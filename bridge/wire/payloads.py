"""Messages of `stickslip.proto` from and to bytes, with the protobuf library alone: what only talks needs no arrays."""

from typing import Any, TypeVar

from google.protobuf import descriptor_pb2
from google.protobuf.message import DecodeError, Message

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire

SCHEMA_VERSION = 2
READABLE_VERSIONS = (1, 2)  # fields are only appended, so an older log lacks what came later and no more

M = TypeVar("M", bound=Message)


def parsed(message: type[M], payload: bytes, topic: str) -> M:
    """A protobuf message from its bytes. Raises Fault BAD_MESSAGE naming `topic`."""
    result = message()
    try:
        result.ParseFromString(payload)
    except DecodeError:
        line = f"{topic}: {len(payload)} bytes are no {message.DESCRIPTOR.name}; see bridge/wire/PROTOCOL.md for its fields"
        raise Fault("BAD_MESSAGE", line) from None
    return result


def sequence_and_time(payload: bytes, message: type[Message]) -> tuple[int, int]:
    """Sequence and t_ns of a message that has both; read directly where the bytes are canonical. Raises Fault BAD_MESSAGE."""
    if len(payload) >= 18 and payload[0] == 0x09 and payload[9] == 0x11:
        return int.from_bytes(payload[1:9], "little"), int.from_bytes(payload[10:18], "little", signed=True)
    whole: Any = parsed(message, payload, message.DESCRIPTOR.name)
    return whole.sequence, whole.t_ns


def file_descriptor_set() -> bytes:
    """The schema for MCAP: a serialised FileDescriptorSet."""
    files = descriptor_pb2.FileDescriptorSet()
    wire.DESCRIPTOR.CopyToProto(files.file.add())
    return files.SerializeToString()
