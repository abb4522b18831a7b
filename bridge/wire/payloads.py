"""Messages of `stickslip.proto` from and to bytes, with the protobuf library alone: what only talks needs no arrays."""

from typing import Any, TypeVar

from google.protobuf import descriptor_pb2
from google.protobuf.message import DecodeError, Message

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire

SCHEMA_VERSION = 2
READABLE_VERSIONS = (1, 2)  # fields are only appended, so an older log lacks what came later and no more

# Bytes of a message beyond which nobody parses it. Ten times the longest block, 8 kB with 400 samples; a memory and a
# configuration may be longer. Larger: who sends rubbish costs more of a process's time.
_LARGEST_BYTES = 1 << 16
_LONG: dict[type[Message], int] = {wire.Snapshot: 1 << 18, wire.Header: 1 << 18}

M = TypeVar("M", bound=Message)


def largest_bytes(message: type[Message]) -> int:
    """The length of a message beyond which it is refused unread."""
    return _LONG.get(message, _LARGEST_BYTES)


def refuse_oversized(payload: bytes, message: type[Message], topic: str) -> None:
    """Raise Fault BAD_MESSAGE for a message that is too long to be parsed."""
    most = largest_bytes(message)
    if len(payload) > most:
        line = f"{topic}: a message of more than {most} bytes: a {message.DESCRIPTOR.name} must be shorter"
        raise Fault("BAD_MESSAGE", f"{line}; see bridge/wire/PROTOCOL.md")


def parsed(message: type[M], payload: bytes, topic: str) -> M:
    """A protobuf message from its bytes. Raises Fault BAD_MESSAGE naming `topic`."""
    refuse_oversized(payload, message, topic)
    result = message()
    try:
        result.ParseFromString(payload)
    except DecodeError:
        line = f"{topic}: {len(payload)} bytes are no {message.DESCRIPTOR.name}; see bridge/wire/PROTOCOL.md for its fields"
        raise Fault("BAD_MESSAGE", line) from None
    return result


def refuse_other_schema(header: wire.Header) -> None:
    """Raise Fault BAD_MESSAGE where a process of the run speaks a version of the messages that is not known here."""
    if header.schema_version not in READABLE_VERSIONS:
        known = " or ".join(map(str, READABLE_VERSIONS))
        line = f"header/{header.role}: schema_version = {header.schema_version}: must be {known}"
        raise Fault("BAD_MESSAGE", f"{line}; use versions of stickslip that agree on both sides")


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
