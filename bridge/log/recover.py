"""Recovery of a cut or damaged log: every readable message, in a new file with an index."""

import json
from pathlib import Path
from typing import NamedTuple

from bridge.faults import Fault
from bridge.files import LOG, Replacement, check_file, refuse_to_replace
from bridge.log.chunk_messages import Messages
from bridge.log.damage import Damage, also_before, lost_in_words
from bridge.log.library import LIBRARY
from bridge.log.live import refuse_a_live_log
from bridge.log.log_reader import LogReader
from bridge.log.mcap_chunks import ChunkWriter
from bridge.log.storage.parts import LOST, PART, RECOVERED, part_of, parts_of


class Recovered(NamedTuple):
    """The result of `recover`."""

    messages: int
    damage: Damage
    attachments: int = 0  # that were left out


class _Copy:
    """A new log that copies definitions, tables and messages of another log in the order in which they are read."""

    def __init__(self, writer: ChunkWriter, reader: LogReader, merged: bool) -> None:
        self.writer = writer
        self.reader = reader
        self.messages = 0
        self.nameless = 0
        place = None if merged else part_of(reader.path)
        begins = place.begins if place else ""
        writer.add_metadata(RECOVERED, {"from": reader.path.name, "begins": begins})
        if place and place.number:
            fields = {"number": place.number, "begins": begins, "follows": place.follows}
            writer.add_metadata(PART, {key: json.dumps(value) for key, value in fields.items()})
        self._schema_ids: dict[tuple[str, str, bytes], int] = {}
        self._channel_ids: dict[tuple[str, str, int, tuple[tuple[str, str], ...]], int] = {}
        self._kept: set[str] = set()

    def take_metadata(self) -> None:
        """Write the tables that are new."""
        for name, fields in self.reader.metadata.items():
            if name not in self._kept:
                self.writer.add_metadata(name, fields)
                self._kept.add(name)

    def _take_schema(self, schema_id: int) -> int:
        """Define a schema in the new log, and return its new number; 0, as in the old log, for no schema."""
        schema = self.reader.schemas.get(schema_id)
        if schema is None:
            return 0
        key = schema.name, schema.encoding, schema.data
        if key not in self._schema_ids:
            self._schema_ids[key] = self.writer.add_schema(*key)
        return self._schema_ids[key]

    def take_channel(self, channel_id: int) -> int | None:
        """Define a channel of the old log in the new log, and return its new number; None if its definition is lost."""
        self.reader.topic(channel_id)  # searches for a missing definition
        channel = self.reader.channels.get(channel_id)
        if channel is None:
            return None
        schema_id = self._take_schema(channel.schema_id)
        key = channel.topic, channel.message_encoding, schema_id, tuple(sorted(channel.metadata.items()))
        if key not in self._channel_ids:
            self._channel_ids[key] = self.writer.add_channel(*key[:3], channel.metadata)
        return self._channel_ids[key]

    def take(self, messages: Messages) -> None:
        """Write messages and their definitions. Messages of a channel without a definition have no topic; they count as lost."""
        self.take_metadata()
        ids = {
            channel_id: self.take_channel(channel_id) for channel_id in {*self.reader.channels, *messages.by_channel}
        }
        columns = (messages.heads[name].tolist() for name in ("channel", "sequence", "log_ns", "publish_ns"))
        for channel, sequence, log_ns, publish_ns, payload in zip(*columns, messages.payloads(), strict=True):
            channel_id = ids[channel]
            if channel_id is None:
                self.nameless += 1
            else:
                self.writer.add_message(channel_id, log_ns, payload, publish_ns, sequence)
                self.messages += 1
        self.writer.flush()

    def record_losses(self) -> None:
        """Record the losses in the new log, which looks whole: they could not be known later."""
        damage = self.damage()
        if words := lost_in_words(damage):
            damage = also_before(damage, f"{self.reader.path.name}: {words}")
        if damage.before:
            self.writer.add_metadata(LOST, {"what": damage.before})

    def damage(self) -> Damage:
        """The losses of the new log."""
        return self.reader.damage.and_also(nameless=self.nameless)


def recover(path: Path, out: Path) -> Recovered:
    """Write every readable message of a log to `out`, with an index, in the topics given by its definitions.

    If `out` is `path`, each cut or damaged file of the log is recovered in its place. Otherwise all files are merged into one.

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
        sum(part.damage.cut_bytes for part in saved),
        sum(part.damage.bad_chunks for part in saved),
        all(part.damage.closed for part in saved),
        sum(part.damage.bad_records for part in saved),
        sum(part.damage.nameless for part in saved),
        sum(part.damage.missing for part in saved),
        "; ".join(part.damage.before for part in saved if part.damage.before),
    )
    return Recovered(sum(part.messages for part in saved), damage, sum(part.attachments for part in saved))


def _saved(reader: LogReader, out: Path, merged: bool, only_damaged: bool = False) -> Recovered:
    """Write every readable message to `out`; with `only_damaged` only if something cannot be read."""
    refuse_a_live_log(out, "--out")
    try:
        new = Replacement(out)
        try:
            copy = _Copy(ChunkWriter(new.file, LIBRARY, out.absolute().parent), reader, merged)
            for chunk in reader.messages():
                copy.take(chunk)
            copy.take_metadata()
            copy.record_losses()
            copy.writer.finish()
            if not copy.messages and not only_damaged:
                line = f"{reader.path}: holds no readable message, so nothing can be saved; the file is unchanged"
                raise Fault("BAD_LOG", line)
            if not only_damaged or (copy.messages and not reader.damage.whole):
                new.finish()
        finally:
            new.discard()
    except OSError as error:
        raise Fault("LOG_WRITE", f"{out}: cannot be written: {error.strerror}; choose another --out") from None
    return Recovered(copy.messages, copy.damage(), len(reader.attachments))
