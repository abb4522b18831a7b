"""Messages of `stickslip.proto` from and to bytes, with the protobuf library alone, without arrays."""

import functools
import struct
from pathlib import Path
from typing import Any, TypeVar

from google.protobuf import descriptor_pb2
from google.protobuf.message import DecodeError, Message

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire

SCHEMA_VERSION = 3
READABLE_VERSIONS = (1, 2, 3)  # fields are only appended, so an older log lacks only the newer fields

# Longest message that is parsed [bytes]: eight times the longest block, 8 kB with 400 samples; snapshots and headers may be
# longer. Larger: invalid messages cost a process more time.
_LARGEST_BYTES = 1 << 16
_LONG: dict[type[Message], int] = {wire.Snapshot: 1 << 18, wire.Header: 1 << 18}

_DESCRIBED = Path(__file__).with_name("stickslip.desc")  # definitions with comments, which the generated module omits
_SEQUENCE_AND_TIME = struct.Struct("<QBq")  # first fields of a canonical message, with the tag between them
_MESSAGES, _ENUMS = 4, 5  # field numbers of message_type and enum_type in a FileDescriptorProto

M = TypeVar("M", bound=Message)


def largest_bytes(message: type[Message]) -> int:
    """The length of the longest message that is parsed [bytes]."""
    return _LONG.get(message, _LARGEST_BYTES)


def parsed(message: type[M], payload: bytes, topic: str) -> M:
    """A protobuf message from its bytes. Raises Fault BAD_MESSAGE naming `topic`."""
    name = message.DESCRIPTOR.name
    if len(payload) > (most := largest_bytes(message)):
        line = f"{topic}: a message of more than {most} bytes: a {name} must be shorter"
        raise Fault("BAD_MESSAGE", f"{line}; see bridge/wire/PROTOCOL.md")
    result = message()
    try:
        result.ParseFromString(payload)
    except DecodeError:
        line = f"{topic}: {len(payload)} bytes cannot be decoded as {name}"
        raise Fault("BAD_MESSAGE", f"{line}; see bridge/wire/PROTOCOL.md for its fields") from None
    return result


def refuse_other_schema(header: wire.Header) -> None:
    """Raise Fault BAD_MESSAGE if a process of the run uses an unsupported version of the messages."""
    if header.schema_version not in READABLE_VERSIONS:
        known = f"{READABLE_VERSIONS[0]} to {READABLE_VERSIONS[-1]}"
        line = f"header/{header.role}: schema_version = {header.schema_version}: must be {known}"
        raise Fault("BAD_MESSAGE", f"{line}; use versions of stickslip that agree on both sides")


def other_rig(rig: str, of_controller: str) -> str:
    """A warning about a controller whose scenario names another rig; empty without one, and for rigs without a name."""
    if rig == of_controller or {rig, of_controller} & {"", "unnamed"}:
        return ""
    line = f"controller: its scenario describes the rig {of_controller}, but the rig is {rig}"
    return f"{line}; start `stickslip controller` with the scenario of this rig"


def sequence_and_time(payload: bytes, message: type[Message]) -> tuple[int, int]:
    """Sequence and t_ns of a message that has both; read directly if the bytes are canonical. Raises Fault BAD_MESSAGE."""
    if len(payload) >= 18 and payload[0] == 0x09 and payload[9] == 0x11:
        sequence, _, t_ns = _SEQUENCE_AND_TIME.unpack_from(payload, 1)
        return sequence, t_ns
    decoded: Any = parsed(message, payload, message.DESCRIPTOR.name)
    return decoded.sequence, decoded.t_ns


@functools.cache
def file_descriptor_set(message: type[Message]) -> bytes:
    """The schema of a message for MCAP: a serialised FileDescriptorSet, with the comments on this message and its enums.

    Only the comments differ between messages; with the comments of all, a log would begin with 250 kB, twice.
    """
    files = descriptor_pb2.FileDescriptorSet()
    files.ParseFromString(_DESCRIBED.read_bytes())
    file = files.file[0]
    paths = [(_MESSAGES, [kind.name for kind in file.message_type].index(message.DESCRIPTOR.name))]
    enums = {field.enum_type.name for field in message.DESCRIPTOR.fields if field.enum_type is not None}
    paths += [(_ENUMS, at) for at, kind in enumerate(file.enum_type) if kind.name in enums]
    comments = [
        place
        for place in file.source_code_info.location
        if tuple(place.path[:2]) in paths and (place.leading_comments or place.trailing_comments)
    ]
    for field in (field for kind in file.message_type for field in kind.field):
        field.ClearField("json_name")  # readers derive it from the field's name
    del file.source_code_info.location[:]
    file.source_code_info.location.extend(comments)
    return files.SerializeToString()
