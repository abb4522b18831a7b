"""The messages of `stickslip.proto` as records that kernels read and write in place.

A streaming message has only fields of fixed width, so each field has a fixed place in the protobuf bytes. `Layout` is a numpy
record with these places: a filled record is an encoded message, and a topic of a log is one array. If a client omits zeros or
reorders fields, the protobuf library first converts the bytes to this form.
"""

import functools
from typing import Any, cast
from zlib import crc32

import numpy as np
import numpy.typing as npt
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.internal.encoder import TagBytes  # pyright: ignore[reportPrivateImportUsage]
from google.protobuf.message import Message

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed

NO_BLOCK = 2**64 - 1  # `command_block` of /applied without a command in force

BLOCK, GAP, STALE, STOP, RESET, ANNOUNCED, LATE = (1 << bit for bit in range(7))  # bits of `Trace.events`

_SCALARS = {  # NumPy type and protobuf wire type of each field type
    FieldDescriptor.TYPE_DOUBLE: ("<f8", 1),
    FieldDescriptor.TYPE_FIXED64: ("<u8", 1),
    FieldDescriptor.TYPE_SFIXED64: ("<i8", 1),
    FieldDescriptor.TYPE_FIXED32: ("<u4", 5),
    FieldDescriptor.TYPE_FLOAT: ("<f4", 5),
    FieldDescriptor.TYPE_ENUM: ("u1", 0),  # a varint: one byte up to 127; zeros are written too
}
_PACKED_WIRE_TYPE = 2
_SUM_BYTES = 4  # length of the checksum of a sensor block, without its tag of one byte


def _varint(value: int) -> bytes:
    head = b""
    while value > 0x7F:
        head += bytes([value & 0x7F | 0x80])
        value >>= 7
    return head + bytes([value])


class Layout:
    """Places of the fields in the bytes of one streaming message.

    Args:
        message: class of the message.
        samples: length of its repeated fields.

    """

    def __init__(self, message: type[Message], samples: int = 0) -> None:
        self.message = message
        self.samples = samples
        names: list[str] = []
        formats: list[Any] = []
        offsets: list[int] = []
        template = bytearray()
        fixed = bytearray()
        ends: list[int] = []
        for field in sorted(message.DESCRIPTOR.fields, key=lambda field: field.number):
            code, wire_type = _SCALARS[field.type]
            if field.is_repeated:
                head = TagBytes(field.number, _PACKED_WIRE_TYPE) + _varint(4 * samples)
                value: Any = (code, (samples,))
            else:
                head = TagBytes(field.number, wire_type)
                value = code
            template += head
            fixed += b"\xff" * len(head)
            names.append(field.name)
            formats.append(value)
            offsets.append(len(template))
            width = np.dtype(value).itemsize
            template += bytes(width)
            fixed += bytes(width)
            ends.append(len(template))
        self.size = len(template)
        self.whole_sizes = frozenset(ends)  # lengths of the message in this version and in versions with fewer fields
        fields = np.dtype(cast(Any, {"names": names, "formats": formats, "offsets": offsets, "itemsize": self.size}))
        self.dtype: np.dtype[Any] = np.dtype((np.record, fields))
        self._fields = fields
        self._template = bytes(template)
        self._tags = int.from_bytes(template, "little")
        self._mask = int.from_bytes(fixed, "little")
        self._tag_places = np.flatnonzero(np.frombuffer(fixed, np.uint8))
        self._tag_bytes = np.frombuffer(self._template, np.uint8)[self._tag_places]

    def blank(self, count: int = 1) -> Records:
        """`count` messages of zeros, [count]; their `tobytes()` is their protobuf encoding."""
        # copied as bytes: numpy's copy of a record omits the tags between the fields
        messages = np.empty((count, self.size), np.uint8)
        messages[:] = np.frombuffer(self._template, np.uint8)
        return np.frombuffer(messages, self.dtype)

    def row(self, messages: Records) -> Any:
        """The first message, for reads by name in each block: a read takes 0.1 us, of a record 1 us."""
        return messages.view(self._fields)[0]

    def is_canonical(self, payload: bytes) -> bool:
        """Whether every field is written, in the order of the field numbers."""
        return len(payload) == self.size and int.from_bytes(payload, "little") & self._mask == self._tags

    def all_canonical(self, payloads: npt.NDArray[np.uint8]) -> bool:
        """Whether all payloads are canonical, [payloads, size] of the message's size."""
        return bool((payloads[:, self._tag_places] == self._tag_bytes).all())

    def canonical(self, payload: bytes, topic: str) -> bytes:
        """The bytes of a message with every field written, in order. Raises Fault BAD_MESSAGE naming `topic`."""
        if self.is_canonical(payload):
            return payload
        message = parsed(self.message, payload, topic)
        record = self.blank()
        for field in self.message.DESCRIPTOR.fields:
            value = getattr(message, field.name)
            if field.is_repeated and len(value) != self.samples:
                line = (
                    f"{topic}: {field.name} has {len(value)} samples: must have {self.samples}; "
                    "set rig.solver.samples_per_block and controller.samples_per_block to the same number"
                )
                raise Fault("BAD_MESSAGE", line)
            record[field.name] = value
        return record.tobytes()

    def read(self, payload: bytes, topic: str) -> Records:
        """One record from the bytes of one message. Raises Fault BAD_MESSAGE naming `topic`."""
        return self.record(self.canonical(payload, topic))

    def record(self, canonical: bytes) -> Records:
        """One record from the bytes of a canonical message."""
        return np.frombuffer(bytearray(canonical), self.dtype)


COMMAND = Layout(wire.Command)
APPLIED = Layout(wire.Applied)
TRACE = Layout(wire.Trace)
STATE = Layout(wire.State)
ANNOUNCE = Layout(wire.Announce)
SCOPE = Layout(wire.Scope)


@functools.cache
def sensor_block(samples: int) -> Layout:
    """The layout of sensor blocks with `samples` samples a channel."""
    return Layout(wire.SensorBlock, samples)


_EMPTY = sensor_block(1).blank().tobytes()
_PLACES = dict(sensor_block(1).dtype.fields or {})
_AFTER = _PLACES["checksum"][1] + _SUM_BYTES - len(_EMPTY)  # end of the checksum, counted from the block's end
_UNKNOWN = _EMPTY[_AFTER:]  # the fields after the checksum in a block of schema 2


def _checksum(block: bytes | memoryview) -> int:
    return crc32(block[_AFTER:], crc32(block[: _AFTER - _SUM_BYTES - 1]))


def _written(block: bytes) -> int:
    return int.from_bytes(block[_AFTER - _SUM_BYTES : _AFTER], "little")


def sealed(block: bytes) -> bytes:
    """A canonical sensor block with its checksum, which reveals any corruption between the rig and a reader."""
    return block[: _AFTER - _SUM_BYTES] + _checksum(block).to_bytes(_SUM_BYTES, "little") + block[_AFTER:]


def seal_all(blocks: Records) -> None:
    """Write the checksum of each sensor block, in place."""
    data, size = memoryview(blocks.tobytes()), blocks.dtype.itemsize
    blocks["checksum"] = [_checksum(data[at : at + size]) for at in range(0, len(data), size)]


def has_checksum(block: bytes) -> bool:
    """Whether a canonical sensor block has a checksum."""
    return _written(block) != 0


def is_whole(block: bytes) -> bool:
    """Whether the checksum of a canonical sensor block matches its bytes; a block of schema 2 had no bytes after it."""
    schema_2 = block[_AFTER:] == _UNKNOWN and crc32(block[: _AFTER - _SUM_BYTES - 1]) == _written(block)
    return schema_2 or _checksum(block) == _written(block)
