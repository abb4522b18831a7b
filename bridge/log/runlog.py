"""Writing a run log: MCAP with schemas, in chunks of 0.1 s, so that a kill loses little; in one file or several."""

import contextlib
import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.log.block_rows import rows
from bridge.log.mcap_chunks import ChunkWriter
from bridge.log.storage.log_files import LogFiles, Rotation
from bridge.log.storage.parts import PART, LogPart, parts_of
from bridge.log.storage.verdict_file import remove_verdict
from bridge.log.viewers import foxglove_log
from bridge.log.viewers.scope import ScopeMaker
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import file_descriptor_set, parsed, sequence_and_time
from bridge.wire.topics import RECORDER_EVENT, SCOPE, TOPICS, Topic

# Duration of a chunk. Longer: a kill loses more (at most the open chunk, 0.25 s). Shorter: larger files.
FLUSH_PERIOD_S = 0.1
LARGEST_CHUNK_BYTES = 1 << 20  # size at which a chunk ends earlier; lockstep may fill more than this in 0.1 s
_LATEST_MESSAGES = 256  # largest delay of a message, in numbers; a larger step back means that the sender restarted
NO_ROTATION = Rotation()


class RunLog:
    """A log that is being written. Not thread safe: one thread owns it. Raises Fault LOG_WRITE.

    If its file is taken away or the disk is full, it continues in a new file as soon as possible; `close` then raises the fault.

    Args:
        path: the first file; its folder is made.
        lockstep: log times are simulated times, so that the same run gives the same bytes.
        rotation: when the log continues in a new file.
        patient: a full disk does not end the log: it waits for space, and counts the messages lost until then.
        on_event: called with every event of the recorder.

    """

    def __init__(
        self,
        path: Path,
        lockstep: bool,
        rotation: Rotation = NO_ROTATION,
        patient: bool = False,
        on_event: Callable[[wire.Event], None] | None = None,
    ) -> None:
        self.path = path
        self.t_ns = 0  # time of the latest message
        self._lockstep = lockstep
        self._on_event = on_event
        self._next: dict[str, int] = {}  # next expected number by topic
        self._events = 0
        self._holding: dict[str, str] = {}  # texts of events that are valid for the whole log, by code
        self._due_s = self._now_s() + FLUSH_PERIOD_S
        self._scope = ScopeMaker()
        self.tables: dict[str, dict[str, str]] = {}  # metadata, repeated in every file
        self._channels: dict[str, int] = {}
        old = parts_of(path)[1:] if path.is_file() else []
        self._files = LogFiles(path, self, rotation, patient)
        for part in old:  # later files of the replaced log
            with contextlib.suppress(OSError):
                part.unlink()
        remove_verdict(path)
        self._files.begin()

    def begin(self, writer: ChunkWriter, part: LogPart) -> None:
        """Write the beginning of a file of the log: schemas, channels, place in the log, tables."""
        schemas: dict[str, int] = {}
        for topic in (*TOPICS, SCOPE):
            if topic.logged:
                name = topic.message.DESCRIPTOR.full_name
                if name not in schemas:
                    schemas[name] = writer.add_schema(name, "protobuf", file_descriptor_set(topic.message))
                self._channels[topic.name] = writer.add_channel(
                    "/" + topic.name, "protobuf", schemas[name], {"rate_Hz": f"{topic.rate_Hz:g}"}
                )
        schema_id = writer.add_schema(foxglove_log.SCHEMA, "protobuf", foxglove_log.FILES.SerializeToString())
        name = foxglove_log.TOPIC
        self._channels[name] = writer.add_channel("/" + name, "protobuf", schema_id, {"rate_Hz": "0"})
        writer.more = lambda data, entries: self._scope.of_chunk(data, entries, self._channels)
        if part.number:
            writer.add_metadata(PART, part.as_texts())
        for name, fields in self.tables.items():
            writer.add_metadata(name, fields)

    def add_header(self, header: wire.Header) -> None:
        """Write the configuration and versions of one process, so that a run can be repeated from its log alone."""
        fields = {
            "schema_version": str(header.schema_version),
            "configuration": header.configuration,
            "versions": header.versions,
            "rig": header.rig,
        }
        self._add_table(header.role, fields)

    def add_metadata(self, name: str, fields: dict[str, Any]) -> None:
        """Write a table of values, each as JSON."""
        self._add_table(name, {key: json.dumps(value) for key, value in fields.items()})

    def _add_table(self, name: str, fields: dict[str, str]) -> None:
        self.tables[name] = fields
        self._files.guarded(lambda writer: writer.add_metadata(name, fields))

    def write(self, topic: Topic, payload: bytes) -> None:
        """Write one message, and an event for a gap in its sequence. Raises Fault BAD_MESSAGE, LOG_WRITE."""
        sequence, t_ns = sequence_and_time(payload, topic.message)
        if t_ns < 0:
            line = f"{topic.name}: t_ns = {t_ns}: must be 0 or more; count it from the start of the run"
            raise Fault("BAD_MESSAGE", line)
        expected = self._next.get(topic.name, sequence if topic.rate_Hz else 0)
        if sequence > expected:
            self.add_event("GAP", f"/{topic.name}: {sequence - expected} lost before {sequence}", t_ns)
        if sequence + _LATEST_MESSAGES < expected:
            self.add_event("RESTART", f"/{topic.name}: {sequence} after {expected - 1}: its sender restarted", t_ns)
            expected = 0
        if sequence >= expected:
            expected = sequence + 1
        self._next[topic.name] = expected
        self.t_ns = max(self.t_ns, t_ns)
        self._add(topic, payload, sequence, t_ns)
        if topic.message is wire.Event:
            self._repeat_event(parsed(wire.Event, payload, topic.name))
        self.flush_when_due()

    def write_blocks(self, each: Mapping[Topic, Records], after: Mapping[Topic, Records]) -> None:
        """Write the messages of consecutive blocks of a lockstep run.

        Args:
            each: topics with one message per block, [blocks].
            after: topics with one message after every n blocks, [blocks / n]; may be empty.

        """
        by_channel = [{self._channels[topic.name]: table for topic, table in part.items()} for part in (each, after)]
        laid_out = rows(by_channel[0], by_channel[1])
        self.t_ns = max(self.t_ns, laid_out.last_ns)
        if (writer := self._files.writer) is not None:
            writer.add_rows(laid_out)

    def flush(self) -> None:
        """End the open chunk, check the file, and start a new file if due. Raises Fault LOG_WRITE."""
        self._files.guarded(ChunkWriter.flush)
        self._files.look_after()

    def flush_when_due(self) -> None:
        """End the open chunk when it is old enough. Raises Fault LOG_WRITE."""
        if self._now_s() > self._due_s or (
            (writer := self._files.writer) is not None and writer.open_chunk.size > LARGEST_CHUNK_BYTES
        ):
            self._due_s = self._now_s() + FLUSH_PERIOD_S
            self.flush()

    def _now_s(self) -> float:
        """The time by which chunks end: in lockstep the simulated one, so that the same run gives the same bytes."""
        return self.t_ns * 1e-9 if self._lockstep else time.monotonic()

    def add_event(self, code: str, text: str, t_ns: int | None = None, holds: bool = False) -> wire.Event:
        """Write an event of the recorder, and return it; its time is `t_ns`, or the time of the latest message.

        `holds`: the event is valid for the whole log; it is repeated if the first file is taken away.
        """
        if holds:
            self._holding[code] = text
        at_ns = self.t_ns if t_ns is None else t_ns
        event = wire.Event(sequence=self._events, t_ns=at_ns, source="recorder", code=code, text=text)
        self._add(RECORDER_EVENT, event.SerializeToString(), self._events, at_ns)
        self._repeat_event(event)
        self._events += 1
        if self._on_event is not None:
            self._on_event(event)
        return event

    def repeat_events(self) -> None:
        """Write the events that are valid for the whole log again, into a file that replaces a lost one."""
        for code, text in self._holding.items():
            self.add_event(code, text)

    def _add(self, topic: Topic, payload: bytes, sequence: int, t_ns: int) -> None:
        writer = self._files.writer
        if writer is None:
            self._files.unwritten += 1
            return
        log_time_ns = t_ns if self._lockstep else time.time_ns()
        writer.add_message(self._channels[topic.name], log_time_ns, payload, t_ns, sequence & 0xFFFFFFFF)

    def _repeat_event(self, event: wire.Event) -> None:
        """Write an event again, in the topic that Foxglove shows as a list."""
        writer = self._files.writer
        if writer is not None:
            log_time_ns = event.t_ns if self._lockstep else time.time_ns()
            payload = foxglove_log.of_event(event, log_time_ns)
            writer.add_message(self._channels[foxglove_log.TOPIC], log_time_ns, payload, event.t_ns, 0)

    def close(self) -> None:
        """Write the index and close the file. Raises Fault LOG_WRITE, LOG_LOST for failures during the run."""
        self._scope.ends = True
        writer = self._files.writer
        if writer is not None and not writer.open_chunk.size and (rest := self._scope.rest(self._channels)) is not None:
            writer.add_rows(rest)
        self._files.close()
