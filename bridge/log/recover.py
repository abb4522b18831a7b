"""A cut or damaged log made whole: every message that can be read, in a new file with an index."""

import json
from pathlib import Path
from typing import NamedTuple

from bridge.faults import Fault
from bridge.files import LOG, Replacement, check_file, refuse_to_replace
from bridge.log.chunk_messages import Messages
from bridge.log.damage import Damage
from bridge.log.library import LIBRARY
from bridge.log.live import refuse_a_live_log
from bridge.log.log_reader import LogReader
from bridge.log.mcap_chunks import ChunkWriter
from bridge.log.storage.parts import PART, RECOVERED, part_of, parts_of
from bridge.wire.payloads import file_descriptor_set
from bridge.wire.topics import BY_NAME


class Recovered(NamedTuple):
    """The result of `recover`."""

    messages: int
    damage: Damage


class _Copy:
    """A new log that copies definitions, tables and messages of another log in the order in which they are read."""

    def __init__(self, writer: ChunkWriter, reader: LogReader, merged: bool) -> None:
        self.writer = writer
        self.reader = reader
        self.schema_ids: dict[str, int] = {}
        said = None if merged else part_of(reader.path)
        begins = said.begins if said else ""
        writer.add_metadata(RECOVERED, {"from": reader.path.name, "begins": begins})
        if said and said.number:
            place = {"number": said.number, "begins": begins, "follows": said.follows}
            writer.add_metadata(PART, {key: json.dumps(value) for key, value in place.items()})
        self.channel_ids: dict[int, int] = {}
        self.kept: set[str] = set()

    def take_metadata(self) -> None:
        for name, fields in self.reader.metadata.items():
            if name not in self.kept:
                self.writer.add_metadata(name, fields)
                self.kept.add(name)

    def take_channel(self, channel_id: int) -> int:
        """Define the channel in the new log, and return its id there.

        A damaged definition is replaced by the one that every log of this version has.
        """
        if channel_id not in self.channel_ids:
            reader = self.reader
            channel = reader.channels.get(channel_id)
            topic = BY_NAME.get(reader.topic(channel_id))
            schema = reader.schemas.get(channel.schema_id) if channel else None
            name = schema.name if schema else topic.message.DESCRIPTOR.full_name if topic else "unknown"
            if name not in self.schema_ids:
                data = schema.data if schema else file_descriptor_set()
                self.schema_ids[name] = self.writer.add_schema(name, schema.encoding if schema else "protobuf", data)
            self.channel_ids[channel_id] = self.writer.add_channel(
                channel.topic if channel else "/" + reader.topic(channel_id),
                channel.message_encoding if channel else "protobuf",
                self.schema_ids[name],
                channel.metadata if channel else {"rate_Hz": f"{topic.rate_Hz if topic else 0.0:g}"},
            )
        return self.channel_ids[channel_id]

    def take_messages(self, messages: Messages) -> None:
        columns = (messages.heads[name].tolist() for name in ("channel", "sequence", "log_ns", "publish_ns"))
        for channel, sequence, log_ns, publish_ns, payload in zip(*columns, messages.payloads(), strict=True):
            self.writer.add_message(self.take_channel(channel), log_ns, payload, publish_ns, sequence)


def recover(path: Path, out: Path) -> Recovered:
    """Write every readable message of a cut or damaged log to `out`, with an index.

    `out` may be `path`: then each file of a log of several that is cut or damaged is made whole in its place. Else all of them
    become one.

    Raises Fault BAD_LOG when nothing can be read, LOG_WRITE when `out` cannot be written or is being recorded.
    """
    check_file(path, "BAD_LOG", "give the path of a run log, .mcap")
    if out.resolve() != path.resolve():
        refuse_to_replace(out, LOG, f"--out {out}")
        return _saved(LogReader(path), out, merged=True)
    parts = parts_of(path)
    if len(parts) == 1:
        return _saved(LogReader(path), out, merged=False)
    saved = [_saved(LogReader(part, alone=True), part, merged=False, only_damaged=True) for part in parts]
    damage = Damage(
        sum(one.damage.cut_bytes for one in saved),
        sum(one.damage.bad_chunks for one in saved),
        all(one.damage.closed for one in saved),
        sum(one.damage.bad_records for one in saved),
    )
    return Recovered(sum(one.messages for one in saved), damage)


def _saved(reader: LogReader, out: Path, merged: bool, only_damaged: bool = False) -> Recovered:
    """Write every readable message to `out`; with `only_damaged` nothing where all can be read."""
    refuse_a_live_log(out, "--out")
    messages = 0
    try:
        new = Replacement(out)
        try:
            copy = _Copy(ChunkWriter(new.file, LIBRARY, out.absolute().parent), reader, merged)
            for chunk in reader.messages():
                copy.take_metadata()
                for channel_id in reader.channels:
                    copy.take_channel(channel_id)
                copy.take_messages(chunk)
                messages += len(chunk.start)
                copy.writer.flush()
            copy.take_metadata()
            copy.writer.finish()
            if not messages and not only_damaged:
                line = f"{reader.path}: holds no message that can be read, so nothing can be saved; the file stays as it is"
                raise Fault("BAD_LOG", line)
            if not only_damaged or (messages and not reader.damage.whole):
                new.finish()
        finally:
            new.discard()
    except OSError as error:
        raise Fault("LOG_WRITE", f"{out}: cannot be written: {error.strerror}; choose another --out") from None
    return Recovered(messages, reader.damage)
