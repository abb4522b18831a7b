"""A run log as tables for other programs, streamed, so that the memory does not grow with the log."""

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.files import check_file, refuse_to_lose
from bridge.log.damage import Damage
from bridge.log.log_reader import LogReader
from bridge.log.logfile import STREAMING, block_period_ns, iter_pieces, sample_times_s
from bridge.log.metadata import configuration_of, is_number, value_at
from bridge.tables.writers import ArrowTable, Columns, MatFile, MatTable, TableWriter
from bridge.wire.channels import CHANNELS

SUFFIXES = (".parquet", ".csv", ".mat")


class Exported(NamedTuple):
    """The result of `export`."""

    files: list[Path]
    rows: dict[str, int]  # number by topic
    damage: Damage  # parts of the log that could not be read, and are not in the tables


def check_request(to: Path, topics: list[str], from_s: float, until_s: float) -> None:
    """Raise Fault CONFIG if the suffix of `to`, a topic or the times are invalid."""
    if to.suffix not in SUFFIXES:
        raise Fault("CONFIG", f"--to {to}: must end in {', '.join(SUFFIXES)}; choose one of these formats")
    unknown = [topic for topic in topics if topic not in STREAMING]
    if unknown or not topics:
        raise Fault("CONFIG", f"--topic {','.join(unknown)}: no streaming topic; known: {', '.join(STREAMING)}")
    if from_s >= until_s:
        raise Fault("CONFIG", f"--from {from_s:g} --until {until_s:g}: from must be before until; exchange them")


def export(
    path: Path,
    to: Path,
    topics: list[str],
    from_s: float = -np.inf,
    until_s: float = np.inf,
    progress: Callable[[float], None] | None = None,
    overwrite: bool = False,
    raw: bool = False,
) -> Exported:
    """Write streaming topics of a log as tables: a row for each sample of the sensors, a row for each message of other topics.

    `to` ends in .parquet, .csv or .mat. With several topics, .parquet and .csv get a file for each topic, FILE.TOPIC.parquet.
    With `raw` the sensors have also the values of the device, from the calibration in the header: see `raw_columns`.
    Only rows with from_s <= t_s < until_s are written. `progress` is called with the share of the log that was read, 0 to 1.
    An existing table is replaced only with `overwrite`.

    Raises Fault BAD_LOG, BAD_MESSAGE, CONFIG, LOG_WRITE; nothing unfinished is left behind.
    """
    check_request(to, topics, from_s, until_s)
    check_file(path, "BAD_LOG", "give the path of a run log, .mcap")
    for file in _files(to, topics).values():
        refuse_to_lose([path], "the log", "--to", file)
        if file.is_file() and not overwrite:
            line = f"--to {file}: exists already, and would be lost; choose another name, or add --overwrite"
            raise Fault("CONFIG", line)
    reader = LogReader(path)
    owners: list[TableWriter | MatFile] = []
    finished = False
    try:
        to.parent.mkdir(parents=True, exist_ok=True)
        writers = _writers(to, topics)
        mat_files = {writer.file for writer in writers.values() if isinstance(writer, MatTable)}
        owners = [*writers.values(), *mat_files]
        rows = _stream(reader, writers, from_s, until_s, progress, raw)
        files = [file for owner in owners for file in owner.finish()]
        finished = True
    except OSError as error:
        line = f"{to}: {error.strerror or error}; free space or choose another --to"
        raise Fault("LOG_WRITE", line) from None
    finally:
        if not finished:
            for owner in owners:
                with contextlib.suppress(OSError, pa.ArrowException):
                    owner.discard()
    return Exported(files, rows, reader.damage)


def _files(to: Path, topics: list[str]) -> dict[str, Path]:
    """The file of each topic."""
    if to.suffix == ".mat" or len(topics) == 1:
        return dict.fromkeys(topics, to)
    return {topic: to.with_name(f"{to.stem}.{topic}{to.suffix}") for topic in topics}


def _writers(to: Path, topics: list[str]) -> dict[str, TableWriter]:
    if to.suffix == ".mat":
        file = MatFile(to)
        return {topic: MatTable(file, topic) for topic in topics}
    return {topic: ArrowTable(path) for topic, path in _files(to, topics).items()}


def _stream(
    reader: LogReader,
    writers: dict[str, TableWriter],
    from_s: float,
    until_s: float,
    progress: Callable[[float], None] | None,
    raw: bool,
) -> dict[str, int]:
    rows = dict.fromkeys(writers, 0)
    period_ns = 0.0
    for piece in iter_pieces(reader):
        if piece.topic not in writers or not len(piece.records):  # empty if no message of its chunk is readable
            continue
        if piece.topic == "sensors":
            period_ns = period_ns or block_period_ns(piece.records)
            columns = sensor_columns(piece.records, period_ns)
            columns |= raw_columns(columns, configuration_of(reader.metadata, "plant", reader.path)) if raw else {}
        else:
            columns = message_columns(piece.records)
        t_s = columns["t_s"]
        if not (from_s <= t_s[0] and t_s[-1] < until_s) or (np.diff(t_s) < 0).any():
            inside = (t_s >= from_s) & (t_s < until_s)
            columns = {name: values[inside] for name, values in columns.items()}
        if len(columns["t_s"]):
            writers[piece.topic].append(columns)
            rows[piece.topic] += len(columns["t_s"])
        if progress is not None:
            progress(reader.position_bytes / max(reader.size_bytes, 1))
    return rows


def sensor_columns(sensors: Records, period_ns: float) -> Columns:
    """Sensor blocks as columns, [samples] each: `t_s` float64, the channels float32 as they were sent."""
    columns: Columns = {"t_s": sample_times_s(sensors, period_ns).ravel()}
    return columns | {name: sensors[name].ravel() for name in CHANNELS}


def raw_columns(columns: Columns, plant: Mapping[str, Any]) -> Columns:
    """The samples in units of the device, float64, such as `raw_drive_force`: (value - offset) / (sign x scale).

    Calibrated values are in the log as float32: a raw value is exact to their rounding, 6e-8 of the calibrated value. Derived and
    absent channels have none. `plant` is the configuration of the rig's process. Raises Fault CONFIG without a calibration.
    """
    made: Columns = {}
    for name in CHANNELS:
        channel = value_at(plant, f"rig.channels.{name}")
        numbers = [value_at(channel, key) for key in ("source", "sign", "scale", "offset")]
        if all(map(is_number, numbers)):
            _, sign, scale, offset = numbers
            made[f"raw_{name.rpartition('_')[0]}"] = (columns[name].astype(np.float64) - offset) / (sign * scale)
    if not made:
        rule = "the header of the log has no calibration, as its rig is simulated"
        raise Fault("CONFIG", f"--raw: {rule}; leave it out")
    return made


def message_columns(records: Records) -> Columns:
    """Messages as columns, [messages] each: `t_s`, then every field as it was sent."""
    names = records.dtype.names or ()
    columns: Columns = {"t_s": records["t_ns"] / 1e9}
    return columns | {name: np.ascontiguousarray(records[name]) for name in names}
