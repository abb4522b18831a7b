"""A cut or damaged log made whole: every message that can be read, in a new file with an index."""

from pathlib import Path
from typing import NamedTuple

from bridge.faults import Fault
from bridge.files import LOG, check_file, refuse_to_replace
from bridge.log.chunk_messages import Messages
from bridge.log.damage import Damage
from bridge.log.library import LIBRARY
from bridge.log.live import refuse_a_live_log
from bridge.log.log_reader import LogReader
from bridge.log.mcap_chunks import ChunkWriter
from bridge.wire.payloads import file_descriptor_set
from bridge.wire.topics import BY_NAME


class Recovered(NamedTuple):
    """The result of `recover`."""

    messages: int
    damage: Damage


class _Copy:
    """A new log that copies definitions, tables and messages of another log in the order in which they are read."""

    def __init__(self, writer: ChunkWriter, reader: LogReader) -> None:
        self.writer = writer
        self.reader = reader
        self.schema_ids: dict[str, int] = {}
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
    """Write every readable message of a cut or damaged log to `out`, with an index; `out` may be `path`.

    Raises Fault BAD_LOG when nothing can be read, LOG_WRITE when `out` cannot be written or is being recorded.
    """
    check_file(path, "BAD_LOG", "give the path of a run log, .mcap")
    if out.resolve() != path.resolve():
        refuse_to_replace(out, LOG, f"--out {out}")
    refuse_a_live_log(out, "--out")
    reader = LogReader(path)
    beside = out.with_name(out.name + ".part")
    messages = 0
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with beside.open("wb") as file:
            copy = _Copy(ChunkWriter(file, LIBRARY), reader)
            for chunk in reader.messages():
                copy.take_metadata()
                for channel_id in reader.channels:
                    copy.take_channel(channel_id)
                copy.take_messages(chunk)
                messages += len(chunk.start)
                copy.writer.flush()
            copy.take_metadata()
            copy.writer.finish()
        if not messages:
            line = f"{path}: holds no message that can be read, so nothing can be saved; the file stays as it is"
            raise Fault("BAD_LOG", line)
        beside.replace(out)
    except OSError as error:
        raise Fault("LOG_WRITE", f"{out}: cannot be written: {error.strerror}; choose another --out") from None
    finally:
        beside.unlink(missing_ok=True)
    return Recovered(messages, reader.damage)
