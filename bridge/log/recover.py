"""Recovery of a cut or damaged log: every readable message, in a new file with an index."""

from pathlib import Path
from typing import NamedTuple

from bridge.faults import Fault
from bridge.files import LOG, Replacement, check_file, refuse_to_replace
from bridge.log.chunk_messages import Messages
from bridge.log.damage import CHANGED, Damage, also_before, lost_in_words, of_all_files
from bridge.log.library import LIBRARY
from bridge.log.log_reader import LogReader
from bridge.log.mcap_chunks import ChunkWriter
from bridge.log.storage.checksums import checksums_of
from bridge.log.storage.part_file import refuse_a_live_log
from bridge.log.storage.parts import LOST, PART, RECOVERED, part_of, parts_of
from bridge.log.storage.verdict_file import remove_verdict


class Recovered(NamedTuple):
    """The result of `recover`."""

    out: Path
    messages: int
    damage: Damage
    attachments: int  # number of attachments that were left out
    JSON_MERGED = "damage"


class _Copy:
    """A new log that copies definitions, tables and messages of another log in the order in which they are read."""

    def __init__(self, writer: ChunkWriter, reader: LogReader, merged: bool) -> None:
        self.writer = writer
        self.reader = reader
        self.messages = 0
        self.nameless = 0
        self._changed = [f"{name}: {CHANGED}" for name in checksums_of(reader.path, not merged).damaged]
        writer.add_metadata(RECOVERED, {"from": reader.path.name})
        if not merged and (place := part_of(reader.path)) is not None:
            writer.add_metadata(PART, place.as_texts())
        self._schema_ids: dict[tuple[str, str, bytes], int] = {}
        self._channel_ids: dict[tuple[str, str, int, tuple[tuple[str, str], ...]], int] = {}
        self._kept: set[str] = set()

    def take_metadata(self) -> None:
        """Write the tables that are new."""
        for name, fields in self.reader.metadata.items():
            if name not in self._kept:
                self.writer.add_metadata(name, fields)
                self._kept.add(name)

    def _new_id(self, channel_id: int) -> int | None:
        """Define a channel of the old log in the new log, and return its new number; None if its definition is lost."""
        self.reader.topic(channel_id)  # takes a missing definition from the file's summary
        channel = self.reader.definitions.channels.get(channel_id)
        if channel is None:
            return None
        schema_id = 0  # as in the old log, for no schema
        schema = self.reader.definitions.schemas.get(channel.schema_id)
        if schema is not None:
            known = schema.name, schema.encoding, schema.data
            if known not in self._schema_ids:
                self._schema_ids[known] = self.writer.add_schema(*known)
            schema_id = self._schema_ids[known]
        key = channel.topic, channel.message_encoding, schema_id, tuple(sorted(channel.metadata.items()))
        if key not in self._channel_ids:
            self._channel_ids[key] = self.writer.add_channel(*key[:3], channel.metadata)
        return self._channel_ids[key]

    def take(self, messages: Messages) -> None:
        """Write messages and their definitions. Messages of a channel without a definition have no topic; they count as lost."""
        self.take_metadata()
        ids = {
            channel_id: self._new_id(channel_id)
            for channel_id in {*self.reader.definitions.channels, *messages.by_channel}
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
        """Record losses and changes in the new log, which looks undamaged: a reader cannot find them otherwise."""
        damage = self.damage()
        if words := lost_in_words(damage):
            damage = also_before(damage, f"{self.reader.path.name}: {words}")
        if damage.before:
            self.writer.add_metadata(LOST, {"what": damage.before})

    def damage(self) -> Damage:
        """The losses of the new log, and the changes of the old one."""
        damage = self.reader.damage.and_also(nameless=self.nameless)
        for change in self._changed:
            damage = also_before(damage, change)
        return damage


def recover(path: Path, out: Path) -> Recovered:
    """Write every readable message of a log to `out`, with an index, in the topics given by its definitions.

    If `out` is `path`, each cut or damaged file of the log is recovered in its place. Otherwise all files are merged into one.

    Raises Fault BAD_LOG when nothing can be read, LOG_WRITE when `out` cannot be written or is being recorded.
    """
    check_file(path, "BAD_LOG", "give the path of a run log, .mcap")
    merged = out.resolve() != path.resolve()
    if merged:
        refuse_to_replace(out, LOG, f"--out {out}")
    parts = [path] if merged else parts_of(path)
    several = len(parts) > 1
    saved = [
        _saved(LogReader(part, alone=not merged), out if merged else part, merged, only_damaged=several)
        for part in parts
    ]
    damage = of_all_files([part.damage for part in saved])
    if not (several and damage.whole):
        remove_verdict(out)
    return Recovered(out, sum(part.messages for part in saved), damage, sum(part.attachments for part in saved))


def _saved(reader: LogReader, out: Path, merged: bool, only_damaged: bool) -> Recovered:
    """Write every readable message to `out`; with `only_damaged` only if a part of the log cannot be read."""
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
    return Recovered(out, copy.messages, copy.damage(), reader.attachments)
