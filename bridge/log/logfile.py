"""A run log, whole or cut: its topics as arrays, at once or chunk by chunk."""

import contextlib
import mmap
import os
from collections import Counter
from collections.abc import Container, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.files import check_file
from bridge.log.chunk_messages import Bytes, Messages
from bridge.log.damage import Damage
from bridge.log.log_reader import LogReader
from bridge.log.metadata import configuration_of
from bridge.log.reading.definitions import DERIVED
from bridge.log.storage.chain import HashChain
from bridge.log.storage.parts import chain_of_log, later_names
from bridge.log.watches.arrays import median
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import ANNOUNCE, APPLIED, COMMAND, STATE, TRACE, Layout, Records, sensor_block
from bridge.wire.payloads import parsed
from bridge.wire.topics import BY_NAME

STREAMING = ("sensors", "applied", "command", "trace", "state", "announce")
_LAYOUTS = {"applied": APPLIED, "command": COMMAND, "trace": TRACE, "state": STATE, "announce": ANNOUNCE}
_DEFAULT_SAMPLES = 20
_COUNTED_BLOCKS = 100  # for their number of samples; a chunk of a run in real time holds as many
_FIRST_BYTES = 1 << 26  # initial memory for a topic; a short run never outgrows it


class Piece(NamedTuple):
    """The messages of one topic in one chunk, in file order."""

    topic: str
    log_time_ns: npt.NDArray[np.int64]  # [messages], time of arrival
    records: Records  # [messages] for a streaming topic; empty for another topic
    payloads: list[bytes]  # [messages] for a topic that does not stream; empty for a streaming topic


def iter_pieces(reader: LogReader, only: Container[str] | None = None) -> Iterator[Piece]:
    """Every message of a log, chunk by chunk, in constant memory; topics made for viewers are skipped.

    Bytes that are not a message of their topic are left out and counted in the reader's damage, messages of other programs in
    its `foreign`. With `only` other topics are skipped. Raises Fault BAD_LOG when the file is not a run log of this project.
    """
    layouts: dict[str, Layout] = dict(_LAYOUTS)
    for messages in reader.messages():
        channels: dict[str, list[int]] = {}
        for channel_id, mine in messages.by_channel.items():
            topic = reader.topic(channel_id)
            if topic is None:
                reader.pass_over(channel_id, len(mine.start))
            # channels of one topic may alternate: two publishers, or a log that was merged
            elif topic not in DERIVED and (only is None or topic in only):
                channels.setdefault(topic, []).append(channel_id)
        for topic, same in channels.items():
            mine = messages.by_channel[same[0]] if len(same) == 1 else messages.of(same)
            log_ns = mine.heads["log_ns"].astype(np.int64)
            if topic in STREAMING:
                if topic not in layouts:
                    layouts[topic] = sensor_block(_samples(mine))
                layout = layouts[topic]
                stacked, kept, why = _stacked(mine, layout, "/" + topic)
                reader.count_bad_messages(len(log_ns) - len(kept), why)
                yield Piece(topic, log_ns[kept], np.frombuffer(stacked, layout.dtype), [])
            else:
                payloads = mine.payloads()
                kept, why = _readable(topic, payloads)
                reader.count_bad_messages(len(payloads) - len(kept), why)
                yield Piece(topic, log_ns[kept], np.empty(0), [payloads[index] for index in kept])


def _samples(messages: Messages) -> int:
    """Samples of a channel in a sensor block: the most frequent number at the beginning, as single blocks may be wrong."""
    sizes: Counter[int] = Counter()
    for payload in messages.payloads(_COUNTED_BLOCKS):
        with contextlib.suppress(Fault):
            sizes[len(parsed(wire.SensorBlock, payload, "/sensors").drive_force_N) or _DEFAULT_SAMPLES] += 1
    return sizes.most_common(1)[0][0] if sizes else _DEFAULT_SAMPLES


def _stacked(messages: Messages, layout: Layout, topic: str) -> tuple[Bytes, npt.NDArray[np.int64], str]:
    """The readable payloads with all fields in order, [messages, size]; their rows; why the first other cannot be read."""
    stacked = messages.stacked
    if stacked is not None and (length := stacked.shape[1]) in layout.whole_sizes:
        if length < layout.size:  # of an older schema, without the last fields
            whole = np.frombuffer(layout.blank(len(stacked)).tobytes(), np.uint8).reshape(-1, layout.size).copy()
            whole[:, :length] = stacked
            stacked = whole
        if layout.all_canonical(stacked):
            return stacked, np.arange(len(stacked)), ""
    good: list[bytes] = []
    kept: list[int] = []
    why = ""
    for index, payload in enumerate(messages.payloads()):
        try:
            good.append(layout.canonical(payload, topic))
            kept.append(index)
        except Fault as fault:
            why = why or _without_remedy(fault)
    return np.frombuffer(b"".join(good), np.uint8).reshape(-1, layout.size), np.array(kept, np.int64), why


def _without_remedy(fault: Fault) -> str:
    """The place and the rule of a fault. Its remedy concerns messages on the bus, so it is cut off."""
    return fault.line.partition("; ")[0]


def _readable(topic: str, payloads: list[bytes]) -> tuple[list[int], str]:
    """Indices of the payloads that are messages of their topic, all for an unknown topic; why the first other cannot be read."""
    if topic not in BY_NAME:
        return list(range(len(payloads))), ""
    kept: list[int] = []
    why = ""
    for index, payload in enumerate(payloads):
        try:
            parsed(BY_NAME[topic].message, payload, "/" + topic)
            kept.append(index)
        except Fault as fault:
            why = why or _without_remedy(fault)
    return kept, why


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
    headers: dict[str, dict[str, str]]  # by role: schema_version, configuration, versions
    damage: Damage
    chain: HashChain  # whether the bytes are those that were written
    foreign: dict[str, int]  # messages of topics of other programs, which were passed over

    def configuration(self, role: str) -> dict[str, Any]:
        """The configuration of `role`, every default included. Raises Fault BAD_LOG when the log has none."""
        return configuration_of(self.headers, role, self.path)


class _Stack:
    """Bytes of one topic, joined piece by piece.

    The memory grows in its place: the system moves its pages to where there is room, and copies nothing, so that a log is never
    in memory twice. In large pages to fill 40 MB takes 10 ms of processor time, and 30 to 80 ms in small ones.
    """

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, _FIRST_BYTES, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        self._in_large_pages()
        self._used = 0

    def add(self, data: Bytes) -> None:
        """Put bytes after those that are there."""
        end = self._used + len(data)
        if end > len(self._memory):
            self._memory.resize(2 * end)  # memory that is not filled costs nothing
            self._in_large_pages()
        np.frombuffer(self._memory, np.uint8)[self._used : end] = data
        self._used = end

    def _in_large_pages(self) -> None:
        with contextlib.suppress(OSError):  # of a system that has none
            self._memory.madvise(mmap.MADV_HUGEPAGE)

    def records(self, dtype: np.dtype[Any]) -> Records:
        """All of it as messages, [messages]."""
        return np.frombuffer(self._memory, np.uint8)[: self._used].view(dtype)


def read_run(path: Path) -> RunData:
    """Read a log, whole or cut, all of its files, into memory. Raises Fault BAD_LOG when it is not a run log of this project."""
    check_log_file(path)
    with ThreadPoolExecutor(max_workers=1) as worker:
        chain = worker.submit(chain_of_log, path)
        return _read(LogReader(path), path, chain)


def check_log_file(path: Path) -> None:
    """Raise Fault BAD_LOG if `path` is not a file; if the first file of a log is lost, the message names the next file."""
    later = [] if os.path.lexists(path) else later_names(path)
    other = f"{later[0].name} in the same folder seems to be a later part of that log; " if later else ""
    check_file(path, "BAD_LOG", f"{other}give the path of a run log, .mcap")


def _read(reader: LogReader, path: Path, chain: "Future[HashChain]") -> RunData:
    # joined as bytes: numpy would join the fields of the records and drop the tags between them
    stored = {name: _Stack() for name in STREAMING}
    dtypes: dict[str, np.dtype[Any]] = {name: layout.dtype for name, layout in _LAYOUTS.items()}
    dtypes["sensors"] = sensor_block(_DEFAULT_SAMPLES).dtype
    payloads: dict[str, list[bytes]] = {name: [] for name in BY_NAME}
    for piece in iter_pieces(reader):
        if piece.topic in stored:
            dtypes[piece.topic] = piece.records.dtype
            stored[piece.topic].add(np.frombuffer(piece.records, np.uint8))
        elif piece.topic in payloads:
            payloads[piece.topic].extend(piece.payloads)
    tables = {name: stored[name].records(dtypes[name]) for name in STREAMING}
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
        chain=chain.result(),
        foreign=reader.foreign,
    )
