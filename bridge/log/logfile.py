"""A run log, whole or cut: its topics as arrays, at once or chunk by chunk; and recovery of a cut log."""

import contextlib
import fcntl
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.files import LOG, check_file, refuse_to_replace
from bridge.kernel import kernel
from bridge.log.log_reader import CHANNEL, END, LOG_TIME, START, Bytes, Damage, LogReader, MessageRows
from bridge.log.mcap_chunks import ChunkWriter
from bridge.log.metadata import configuration_of
from bridge.log.runlog import LIBRARY
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import (
    APPLIED,
    COMMAND,
    STATE,
    TRACE,
    Layout,
    Records,
    file_descriptor_set,
    parsed,
    sensor_block,
)
from bridge.wire.topics import BY_NAME

__all__ = ["Damage", "LogReader", "Piece", "RunData", "iter_pieces", "read_run", "recover"]

STREAMING = ("sensors", "applied", "command", "trace", "state")
_LAYOUTS = {"applied": APPLIED, "command": COMMAND, "trace": TRACE, "state": STATE}
_DEFAULT_SAMPLES = 20
_UINT64 = 2**64 - 1


class Piece(NamedTuple):
    """The messages of one topic in one chunk, in file order."""

    topic: str
    log_time_ns: npt.NDArray[np.int64]  # [messages], time of arrival
    records: Records  # [messages] for a streaming topic; empty for another topic
    payloads: list[bytes]  # [messages] for a topic that does not stream; empty for a streaming topic


def iter_pieces(reader: LogReader) -> Iterator[Piece]:
    """Every message of a log, chunk by chunk, in memory that does not grow with the log.

    Bytes that are not a message of their topic are left out and counted in the reader's damage. Raises Fault BAD_LOG when the
    file is not a run log of this project.
    """
    layouts: dict[str, Layout] = dict(_LAYOUTS)
    for data, rows in reader.messages():
        for channel_id in np.unique(rows[:, CHANNEL]):
            topic = reader.topic(int(channel_id))
            mine = rows[rows[:, CHANNEL] == channel_id]
            log_time_ns = mine[:, LOG_TIME].copy()
            if topic in STREAMING:
                if topic not in layouts:
                    layouts[topic] = sensor_block(_samples(data, mine))
                stacked, kept = _stacked(data, mine, layouts[topic], "/" + topic)
                reader.count_bad_messages(len(mine) - len(kept))
                yield Piece(topic, log_time_ns[kept], np.frombuffer(stacked, layouts[topic].dtype), [])
            else:
                payloads = [data[row[START] : row[END]].tobytes() for row in mine]
                kept = _readable(topic, payloads)
                reader.count_bad_messages(len(mine) - len(kept))
                yield Piece(topic, log_time_ns[kept], np.empty(0), [payloads[index] for index in kept])


def _samples(data: Bytes, rows: MessageRows) -> int:
    """Samples of a channel in a sensor block: the most frequent number in the first chunk, as single blocks may be wrong."""
    found: Counter[int] = Counter()
    for row in rows:
        with contextlib.suppress(Fault):
            block = parsed(wire.SensorBlock, data[row[START] : row[END]].tobytes(), "/sensors")
            found[len(block.drive_force_N) or _DEFAULT_SAMPLES] += 1
    return found.most_common(1)[0][0] if found else _DEFAULT_SAMPLES


@kernel
def _gather(data: Bytes, starts: npt.NDArray[np.int64], template: Bytes, fixed: Bytes, out: Bytes) -> bool:
    """Copy messages of the template's length into `out`; False when one does not have the template's tags."""
    size = template.shape[0]
    for row in range(starts.shape[0]):
        start, to = starts[row], row * size
        for i in range(size):
            value = data[start + i]
            if fixed[i] != 0 and value != template[i]:
                return False
            out[to + i] = value
    return True


def _stacked(data: Bytes, rows: MessageRows, layout: Layout, topic: str) -> tuple[bytes, npt.NDArray[np.int64]]:
    """The readable payloads of one topic, joined, with every field written and in order; and the indices of their rows."""
    if (rows[:, END] - rows[:, START] == layout.size).all():
        template = np.frombuffer(layout.blank().tobytes(), np.uint8)
        fixed = np.ones(layout.size, np.uint8)
        for field in (layout.dtype.fields or {}).values():
            fixed[field[1] : field[1] + field[0].itemsize] = 0
        out = np.empty(len(rows) * layout.size, np.uint8)
        if _gather(data, np.ascontiguousarray(rows[:, START]), template, fixed, out):
            return out.tobytes(), np.arange(len(rows))
    good: list[bytes] = []
    kept: list[int] = []
    for index, row in enumerate(rows):
        with contextlib.suppress(Fault):
            good.append(layout.canonical(data[row[START] : row[END]].tobytes(), topic))
            kept.append(index)
    return b"".join(good), np.array(kept, np.int64)


def _readable(topic: str, payloads: list[bytes]) -> list[int]:
    """Indices of the payloads that are messages of their topic; all of them for a topic that this version does not know."""
    if topic not in BY_NAME:
        return list(range(len(payloads)))
    kept: list[int] = []
    for index, payload in enumerate(payloads):
        with contextlib.suppress(Fault):
            parsed(BY_NAME[topic].message, payload, "/" + topic)
            kept.append(index)
    return kept


def block_period_ns(sensors: Records) -> float:
    """Time between two sensor blocks [ns], from their numbers and times; 1 ms where these do not show it."""
    numbers = np.diff(sensors["sequence"].astype(np.int64))
    forward = numbers > 0
    if forward.any():
        return float(np.median(np.diff(sensors["t_ns"])[forward] / numbers[forward]))
    if len(sensors) and sensors["t_ns"][0] > 0:
        return float(sensors["t_ns"][0]) / (float(sensors["sequence"][0]) + 1.0)
    return 1e6


def sample_times_s(sensors: Records, period_ns: float) -> npt.NDArray[np.float64]:
    """Time of every sample, [blocks, samples]: equally spaced, the last of a block at its `t_ns`."""
    samples = sensors["drive_force_N"].shape[1]
    before_ns = (np.arange(samples) + 1 - samples) * (period_ns / samples)
    return (sensors["t_ns"][:, None] + before_ns) / 1e9


class RunData(NamedTuple):
    """A whole log in memory."""

    path: Path
    sensors: Records
    applied: Records
    command: Records
    trace: Records
    state: Records
    snapshots: list[wire.Snapshot]
    events: list[wire.Event]
    headers: dict[str, dict[str, str]]  # by role: schema_version, configuration, versions
    damage: Damage

    def configuration(self, role: str) -> dict[str, Any]:
        """The configuration of `role`, every default included. Raises Fault BAD_LOG when the log has none."""
        return configuration_of(self.headers, role, self.path)


def read_run(path: Path) -> RunData:
    """Read a log, whole or cut, into memory. Raises Fault BAD_LOG when the file is not a run log of this project."""
    check_file(path, "BAD_LOG", "give the path of a run log, .mcap")
    reader = LogReader(path)
    # joined as bytes: numpy would join the fields of the records and drop the tags between them
    stored: dict[str, list[memoryview]] = {name: [] for name in STREAMING}
    dtypes: dict[str, np.dtype[Any]] = {name: layout.dtype for name, layout in _LAYOUTS.items()}
    dtypes["sensors"] = sensor_block(_DEFAULT_SAMPLES).dtype
    payloads: dict[str, list[bytes]] = {name: [] for name in BY_NAME}
    for piece in iter_pieces(reader):
        if piece.topic in stored:
            dtypes[piece.topic] = piece.records.dtype
            stored[piece.topic].append(piece.records.view(np.uint8).data)
        elif piece.topic in payloads:
            payloads[piece.topic].extend(piece.payloads)
    tables = {name: np.frombuffer(b"".join(stored[name]), dtypes[name]) for name in STREAMING}
    events = [
        parsed(wire.Event, payload, "/event/" + name)
        for name in ("plant", "controller", "recorder")
        for payload in payloads["event/" + name]
    ]
    return RunData(
        path,
        *(tables[name] for name in STREAMING),
        snapshots=[parsed(wire.Snapshot, payload, "/snapshot") for payload in payloads["snapshot"]],
        events=events,
        headers=reader.metadata,
        damage=reader.damage,
    )


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

    def take_messages(self, data: Bytes, rows: MessageRows) -> None:
        raw = data.tobytes()
        for channel, sequence, log_time_ns, publish_time_ns, start, end in rows.tolist():
            self.writer.add_message(
                self.take_channel(channel), log_time_ns & _UINT64, raw[start:end], publish_time_ns & _UINT64, sequence
            )


def refuse_a_live_log(path: Path, option: str) -> None:
    """Raise Fault LOG_WRITE when `path` is a log that is being recorded; `option` is the option that names another file."""
    if not path.is_file():
        return
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            line = f"{path}: is being recorded: must be closed before it is replaced, or what follows is lost"
            raise Fault("LOG_WRITE", f"{line}; wait for the end of the run, or give another {option}") from None
        except OSError:  # a file system without locks
            return


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
            for data, rows in reader.messages():
                copy.take_metadata()
                for channel_id in reader.channels:
                    copy.take_channel(channel_id)
                copy.take_messages(data, rows)
                messages += len(rows)
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
