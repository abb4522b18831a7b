"""Schemas and channels of one file of a log: the topic of each channel, and whether it belongs to this project.

A channel is identified by its definition, never by its number, because other programs renumber channels. The definition comes
before the first message of the channel, inside or outside of a chunk, and again in the summary at the end of the file.
"""

import contextlib
from functools import cached_property
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.summary import Summary

from bridge.log.chunk_bytes import UNREADABLE
from bridge.log.viewers import foxglove_log
from bridge.wire.stickslip_pb2 import DESCRIPTOR
from bridge.wire.topics import BY_NAME, SCOPE

_OWN = DESCRIPTOR.package + "."
# topics that the recorder derives from other topics for viewers
DERIVED = {SCOPE.name: SCOPE.message.DESCRIPTOR.full_name, foxglove_log.TOPIC: foxglove_log.SCHEMA}
_KNOWN = BY_NAME.keys() | DERIVED.keys()


class Definitions:
    """The schemas and channels defined by a file.

    Args:
        path: the file; its summary is read if a definition is missing.

    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}

    def learn(self, opcode: int, content: bytes) -> None:
        """Add a definition. Raises one of UNREADABLE if it is damaged."""
        stream = ReadDataStream(BytesIO(content))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.channels[channel.id] = channel

    def find(self, channel_id: int) -> bool:
        """Whether the channel is defined; a missing or wrong definition is taken from the summary."""
        channel = self.channels.get(channel_id)
        if channel is not None and channel.schema_id in self.schemas and _name(channel) in _KNOWN:
            return True
        listed = self._summary.channels.get(channel_id)
        if listed is not None and (channel is None or _name(listed) in _KNOWN):
            channel = self.channels[channel_id] = listed
        if channel is not None and channel.schema_id in self._summary.schemas:
            self.schemas.setdefault(channel.schema_id, self._summary.schemas[channel.schema_id])
        return channel is not None

    @cached_property
    def _summary(self) -> Summary:
        """The summary of the file; empty if it cannot be read."""
        with contextlib.suppress(OSError, ValueError, *UNREADABLE), self._path.open("rb") as file:
            return make_reader(file).get_summary() or Summary()
        return Summary()

    def topic(self, channel_id: int) -> str | None:
        """The topic of a channel of this project without the leading slash; None for a channel of another program."""
        channel = self.channels[channel_id]
        name = _name(channel)
        schema = self.schemas.get(channel.schema_id)
        if schema is None:  # schema lost: the topic's name decides
            return name if name in BY_NAME else None
        return name if schema.name.startswith(_OWN) or DERIVED.get(name) == schema.name else None

    def any_own(self) -> bool:
        """Whether any channel belongs to this project."""
        topics = {self.topic(channel_id) for channel_id in self.channels}
        return bool(topics - {None, foxglove_log.TOPIC})

    def foreign_schemas(self) -> list[str]:
        """The names of the schemas of other programs."""
        return sorted({schema.name for schema in self.schemas.values() if not schema.name.startswith(_OWN)})


def _name(channel: Channel) -> str:
    return channel.topic.removeprefix("/")
