"""Writing a run log: MCAP with schemas, in chunks of 0.1 s, so that a kill loses little."""

import contextlib
import json
import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bridge.faults import Fault
from bridge.files import LOG, refuse_to_replace
from bridge.log.block_rows import rows
from bridge.log.library import LIBRARY
from bridge.log.live import locked
from bridge.log.mcap_chunks import ChunkWriter, ending_without_index
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import Records
from bridge.wire.payloads import file_descriptor_set, sequence_and_time
from bridge.wire.topics import RECORDER_EVENT, TOPICS, Topic

# Duration of a chunk. Longer: a kill loses more (it loses the open chunk, at most 0.25 s). Shorter: larger files.
FLUSH_PERIOD_S = 0.1
LARGEST_CHUNK_BYTES = 1 << 20  # ends a chunk earlier; lockstep may fill more than this in 0.1 s
_LATEST_MESSAGES = 256  # largest lag of a delayed message, in numbers; a larger lag means that the sender restarted


class RunLog:
    """One log file that is being written. Not thread safe: one thread owns it. Raises Fault LOG_WRITE.

    Args:
        path: the file; its folder is made.
        lockstep: log times are simulated times, so that the same run gives the same bytes.

    """

    def __init__(self, path: Path, lockstep: bool) -> None:
        self.path = path
        self._lockstep = lockstep
        self._next: dict[str, int] = {}
        self._last_t_ns = 0
        self._events = 0
        self._whole_bytes = 0
        self._whole_t_ns: int | None = None  # of the latest message in a chunk that is whole in the file
        self._due_s = time.monotonic() + FLUSH_PERIOD_S
        refuse_to_replace(path, LOG, str(path))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # not truncated when it is opened: the file may be the log of a run under way
            self._file = os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666), "wb")
            if not locked(self._file):
                self._file.close()
                line = f"{path}: is being recorded: must be another file than that of a run that goes on"
                raise Fault("LOG_WRITE", f"{line}; wait for the end of that one, or choose another --log")
            if path.is_file():
                self._file.truncate(0)
        except OSError as error:
            raise Fault("LOG_WRITE", f"{path}: cannot be written: {error.strerror}; choose another --log") from None
        self._channels: dict[str, int] = {}
        self._guarded(self._begin)

    def _begin(self) -> None:
        """Write header, schemas and channels."""
        self._writer = ChunkWriter(self._file, LIBRARY)
        schema_data = file_descriptor_set()
        schemas: dict[str, int] = {}
        for topic in TOPICS:
            if topic.logged:
                name = topic.message.DESCRIPTOR.full_name
                if name not in schemas:
                    schemas[name] = self._writer.add_schema(name, "protobuf", schema_data)
                self._channels[topic.name] = self._writer.add_channel(
                    "/" + topic.name, "protobuf", schemas[name], {"rate_Hz": f"{topic.rate_Hz:g}"}
                )

    def add_header(self, header: wire.Header) -> None:
        """Write the configuration and versions of one process, so that a run can be repeated from its log alone."""
        fields = {
            "schema_version": str(header.schema_version),
            "configuration": header.configuration,
            "versions": header.versions,
        }
        self._guarded(lambda: self._writer.add_metadata(header.role, fields))

    def add_metadata(self, name: str, fields: dict[str, Any]) -> None:
        """Write a table of values, each as JSON."""
        text = {key: json.dumps(value) for key, value in fields.items()}
        self._guarded(lambda: self._writer.add_metadata(name, text))

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
            self.add_event("RESTART", f"/{topic.name}: {sequence} after {expected - 1}: its sender began anew", t_ns)
            expected = 0
        self._next[topic.name] = max(expected, sequence + 1)
        self._last_t_ns = max(self._last_t_ns, t_ns)
        self._add(topic, payload, sequence, t_ns)
        self.flush_when_due()

    def write_blocks(self, each: Mapping[Topic, Records], after: Mapping[Topic, Records]) -> None:
        """Write the messages of blocks of a lockstep run, which follow one another without a gap.

        Args:
            each: topics with one message a block, [blocks].
            after: topics with one message after every so many blocks, [blocks / so many]; may be empty.

        """
        by_channel = [{self._channels[topic.name]: table for topic, table in part.items()} for part in (each, after)]
        made = rows(*by_channel)
        self._last_t_ns = max(self._last_t_ns, made.last_ns)
        self._writer.add_rows(made)

    def flush(self) -> None:
        """End the open chunk. Raises Fault LOG_WRITE."""
        self._guarded(self._writer.flush)

    def flush_when_due(self) -> None:
        """End the open chunk when it is old enough. Raises Fault LOG_WRITE."""
        if time.monotonic() > self._due_s or self._writer.open_bytes > LARGEST_CHUNK_BYTES:
            self._due_s = time.monotonic() + FLUSH_PERIOD_S
            self.flush()

    def add_event(self, code: str, text: str, t_ns: int | None = None) -> wire.Event:
        """Write an event of the recorder, and return it; its time is `t_ns`, or that of the latest message."""
        at_ns = self._last_t_ns if t_ns is None else t_ns
        event = wire.Event(sequence=self._events, t_ns=at_ns, source="recorder", code=code, text=text)
        self._add(RECORDER_EVENT, event.SerializeToString(), self._events, at_ns)
        self._events += 1
        return event

    def _add(self, topic: Topic, payload: bytes, sequence: int, t_ns: int) -> None:
        log_time_ns = t_ns if self._lockstep else time.time_ns()
        self._writer.add_message(self._channels[topic.name], log_time_ns, payload, t_ns, sequence & 0xFFFFFFFF)

    def _guarded(self, write: Callable[[], None]) -> None:
        try:
            write()
            self._file.flush()
            self._whole_bytes = self._file.tell()
            if self._next and not self._writer.open_bytes:
                self._whole_t_ns = self._last_t_ns
        except OSError as error:
            self._end_without_index()
            raise Fault("LOG_WRITE", f"{self.path}: {error.strerror}; {self._kept()}") from None

    def _kept(self) -> str:
        """What is in the file that a fault has closed, and what to do."""
        if self._whole_t_ns is None:
            return "the log was closed before anything was recorded; free space, or choose another --log"
        return (
            f"the log was closed at {self._whole_t_ns * 1e-9:.2f} s, what came before is kept; free space, then "
            f"`stickslip log recover {self.path}` gives it its index back"
        )

    def _end_without_index(self) -> None:
        """Close the file after its last whole chunk, with 50 bytes; removing the chunk that did not fit makes room for them."""
        with contextlib.suppress(OSError):
            self._file.close()
        with contextlib.suppress(OSError), self.path.open("r+b", buffering=0) as file:
            file.truncate(self._whole_bytes)
            file.seek(self._whole_bytes)
            file.write(ending_without_index())

    def close(self) -> None:
        """Write the index and close the file, unless a fault has closed it. Raises Fault LOG_WRITE."""
        if not self._file.closed:
            self._guarded(self._writer.finish)
            self._file.close()
