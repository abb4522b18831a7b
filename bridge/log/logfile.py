"""A run log, whole or cut: its topics as arrays, at once or chunk by chunk."""

import os
from collections import Counter
from collections.abc import Callable, Container, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Indices, Records
from bridge.faults import Fault
from bridge.files import check_file
from bridge.log.chunk_messages import Bytes, Messages
from bridge.log.damage import Damage
from bridge.log.definitions import DERIVED
from bridge.log.log_reader import LogReader
from bridge.log.metadata import configuration_of
from bridge.log.storage.checksums import Checksums, checksums_of
from bridge.log.storage.parts import later_names
from bridge.log.watches.arrays import median
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import ANNOUNCE, APPLIED, COMMAND, STATE, TRACE, Layout, sensor_block
from bridge.wire.payloads import parsed
from bridge.wire.topics import BY_NAME

STREAMING = ("sensors", "applied", "command", "trace", "state", "announce")
_LAYOUTS = {"applied": APPLIED, "command": COMMAND, "trace": TRACE, "state": STATE, "announce": ANNOUNCE}
_DEFAULT_SAMPLES = 20  # samples of a channel in a block, in a log without a readable block
_COUNTED_BLOCKS = 100  # first blocks, which show the number of samples; a chunk of a run in real time holds as many


class Piece(NamedTuple):
    """The messages of one topic in one chunk, in file order."""

    topic: str
    log_time_ns: npt.NDArray[np.int64]  # [messages], time of arrival
    records: Records  # [messages] for a streaming topic; empty for another topic
    messages: list[Any]  # parsed messages of a topic that does not stream; payloads of a topic unknown to this version


def feed(reader: LogReader, watch: Any, progress: Callable[[float], None] | None = None) -> Checksums:
    """Pass every message of a log to a watch with the methods of `LogWatch`; a second thread computes the checksums.

    `progress` is called with the share of the log read so far, 0 to 1. Raises Fault BAD_LOG.
    """
    with ThreadPoolExecutor(max_workers=1) as worker:
        checksums = worker.submit(checksums_of, reader.path, reader.alone)
        for piece in iter_pieces(reader):
            if piece.topic in STREAMING:
                watch.add(piece.topic, piece.records, piece.log_time_ns)
            else:
                watch.add_others(piece.topic, piece.messages)
            if progress is not None:
                progress(reader.position_bytes / max(reader.size_bytes, 1))
        return checksums.result().with_tables(reader.metadata)


def iter_pieces(reader: LogReader, only: Container[str] | None = None) -> Iterator[Piece]:
    """Every message of a log, chunk by chunk, in constant memory; topics made for viewers are skipped.

    Bytes that are not a message of their topic are left out and counted in the reader's damage, messages of other programs in
    its `foreign`. With `only` other topics are skipped. Raises Fault BAD_LOG when the file is not a run log of this project.
    """
    layouts: dict[str, Layout] = dict(_LAYOUTS)
    for messages in reader.messages():
        channels: dict[str, list[int]] = {}
        for channel_id, selected in messages.by_channel.items():
            topic = reader.topic(channel_id)
            if topic is None:
                reader.pass_over(channel_id, len(selected.start))
            # channels of one topic may alternate: two publishers, or a log that was merged
            elif topic not in DERIVED and (only is None or topic in only):
                channels.setdefault(topic, []).append(channel_id)
        for topic, ids in channels.items():
            selected = messages.by_channel[ids[0]] if len(ids) == 1 else messages.of(ids)
            log_ns = selected.heads["log_ns"].astype(np.int64)
            if topic in STREAMING:
                if topic not in layouts:
                    layouts[topic] = sensor_block(_samples(selected))
                layout = layouts[topic]
                stacked, kept, why = _stacked(selected, layout, "/" + topic)
                yield Piece(topic, log_ns[kept], np.frombuffer(stacked, layout.dtype), [])
            else:
                read, kept, why = _readable(selected.payloads(), partial(_message, topic))
                yield Piece(topic, log_ns[kept], np.empty(0), read)
            reader.count_bad_messages(len(log_ns) - len(kept), why)


def _samples(messages: Messages) -> int:
    """Samples of a channel in a sensor block: the most frequent number at the beginning, as single blocks may be wrong."""
    blocks, _, _ = _readable(messages.payloads(_COUNTED_BLOCKS), partial(_message, "sensors"))
    sizes = Counter(len(block.drive_force_N) or _DEFAULT_SAMPLES for block in blocks)
    return sizes.most_common(1)[0][0] if sizes else _DEFAULT_SAMPLES


def _stacked(messages: Messages, layout: Layout, topic: str) -> tuple[Bytes, Indices, str]:
    """The readable payloads with all fields in order, [messages, size]; their rows; the fault of the first unreadable one."""
    stacked = messages.stacked
    if stacked is not None and (length := stacked.shape[1]) in layout.whole_sizes:
        if length < layout.size:  # messages of an older schema, without the last fields
            padded = np.frombuffer(layout.blank(len(stacked)).tobytes(), np.uint8).reshape(-1, layout.size).copy()
            padded[:, :length] = stacked
            stacked = padded
        if layout.all_canonical(stacked):
            return stacked, np.arange(len(stacked)), ""
    good, kept, why = _readable(messages.payloads(), lambda payload: layout.canonical(payload, topic))
    return np.frombuffer(b"".join(good), np.uint8).reshape(-1, layout.size), kept, why


def _message(topic: str, payload: bytes) -> Any:
    """A message of its topic; the payload itself for an unknown topic. Raises Fault BAD_MESSAGE."""
    return parsed(BY_NAME[topic].message, payload, "/" + topic) if topic in BY_NAME else payload


def _readable(payloads: list[bytes], read: Callable[[bytes], Any]) -> tuple[list[Any], Indices, str]:
    """The readable payloads, as `read` returns them; their indices; the fault of the first unreadable one."""
    good: list[Any] = []
    kept: list[int] = []
    why = ""
    for index, payload in enumerate(payloads):
        try:
            good.append(read(payload))
            kept.append(index)
        except Fault as fault:
            why = why or fault.line.partition("; ")[0]  # the remedy concerns messages on the bus
    return good, np.array(kept, np.int64), why


def block_period_ns(sensors: Records) -> float:
    """Time between two sensor blocks [ns], from their numbers and times; 1 ms where these do not show it."""
    numbers, steps_ns = np.diff(sensors["sequence"].astype(np.int64)), np.diff(sensors["t_ns"])
    forward = (numbers > 0) & (steps_ns > 0)  # a stopped clock shows no period
    if forward.any():
        return median(steps_ns[forward] / numbers[forward])
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
    announce: Records  # empty for a rig that announces nothing, and in a log of schema 1
    snapshots: list[wire.Snapshot]
    events: list[wire.Event]
    headers: dict[str, dict[str, str]]  # schema_version, configuration and versions, by role
    damage: Damage
    checksums: Checksums
    foreign: dict[str, int]  # number of skipped messages by topic of another program

    def configuration(self, role: str) -> dict[str, Any]:
        """The configuration of `role`, every default included. Raises Fault BAD_LOG when the log has none."""
        return configuration_of(self.headers, role, self.path)


class _Tables:
    """Collects a log in memory. A topic is joined as bytes: numpy would join the fields and drop the tags between them."""

    def __init__(self) -> None:
        self.stored = {name: bytearray() for name in STREAMING}  # Linux enlarges long ones without a copy
        self.dtypes = {name: layout.dtype for name, layout in _LAYOUTS.items()}
        self.dtypes["sensors"] = sensor_block(_DEFAULT_SAMPLES).dtype
        self.messages: dict[str, list[Any]] = {name: [] for name in BY_NAME}

    def add(self, topic: str, records: Records, _log_time_ns: Indices) -> None:
        """Take messages of a streaming topic, [messages]."""
        self.dtypes[topic] = records.dtype
        self.stored[topic] += records.view(np.uint8).data

    def add_others(self, topic: str, messages: Sequence[Any]) -> None:
        """Take messages of another topic."""
        if topic in self.messages:
            self.messages[topic].extend(messages)


def read_run(path: Path) -> RunData:
    """Read a log, whole or cut, all of its files, into memory. Raises Fault BAD_LOG when it is not a run log of this project."""
    check_log_file(path)
    reader, tables = LogReader(path), _Tables()
    checksums = feed(reader, tables)
    return RunData(
        path,
        *(np.frombuffer(tables.stored[name], tables.dtypes[name]) for name in STREAMING),
        snapshots=tables.messages["snapshot"],
        events=[event for role in ("plant", "controller", "recorder") for event in tables.messages["event/" + role]],
        headers=reader.metadata,
        damage=reader.damage,
        checksums=checksums,
        foreign=reader.foreign,
    )


def check_log_file(path: Path) -> None:
    """Raise Fault BAD_LOG if `path` is not a file; if the first file of a log is lost, the message names the next file."""
    later = [] if os.path.lexists(path) else later_names(path)
    hint = f"{later[0].name} in the same folder seems to be a later part of that log; " if later else ""
    check_file(path, "BAD_LOG", f"{hint}give the path of a run log, .mcap")
