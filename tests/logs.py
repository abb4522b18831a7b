"""Small logs for tests: one short run, and copies of it with something wrong."""

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from bridge.log.logfile import STREAMING, RunData, read_run
from bridge.log.runlog import NO_ROTATION, Rotation, RunLog
from bridge.wire.messages import ANNOUNCE, APPLIED, COMMAND, STATE, TRACE, sensor_block
from bridge.wire.topics import BY_NAME
from cockpit.judge.judged import judge_tables
from cockpit.judge.verdict import RunVerdict
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from diagnosis.slips import Cycles

Tables = dict[str, Any]


@cache
def short_log() -> bytes:
    """A run of 0.4 s, 400 blocks and one announcement, in several chunks."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "short.mcap"
        scenario = load_scenario("paper-c45-c45", ["duration_s=0.4", "rig.drive.announce_ahead_s=0.02"])
        run_onboard(scenario, path, {"scenario": scenario.name})
        return in_chunks(path, 40)


def in_chunks(path: Path, blocks: int) -> bytes:
    """The log again, with a chunk every `blocks` blocks."""
    run = read_run(path)
    again = path.with_name("again.mcap")
    write(again, tables_of(run), run, blocks)
    return again.read_bytes()


def verdict_of(run: RunData) -> RunVerdict:
    """The verdict on a log that was read, and perhaps changed since."""
    return judge_tables(run)[0]


def cycles_of(run: RunData) -> Cycles | None:
    """Its slips."""
    return judge_tables(run)[1]


def tables_of(run: RunData) -> Tables:
    """The streaming topics of a run, writable."""
    return {
        name: np.frombuffer(bytearray(getattr(run, name).tobytes()), getattr(run, name).dtype) for name in STREAMING
    }


def with_tags(name: str, table: Any) -> Any:
    """The records as messages again: numpy's copies leave the tags between the fields behind."""
    layout = (
        sensor_block(20)
        if name == "sensors"
        else {"applied": APPLIED, "command": COMMAND, "trace": TRACE, "state": STATE, "announce": ANNOUNCE}[name]
    )
    messages = np.frombuffer(bytearray(layout.blank().tobytes() * len(table)), layout.dtype)
    for field in layout.dtype.names or ():
        messages[field] = table[field]
    return messages


def write(path: Path, tables: Tables, run: RunData, blocks: int = 40, rotation: Rotation = NO_ROTATION) -> None:
    """Write messages in the order of their rows, a chunk every `blocks` of them."""
    log = RunLog(path, lockstep=True, rotation=rotation)
    log._due_s = math.inf  # no chunk ends by the clock: on a busy computer the two ENDs would be in two chunks
    for name, fields in run.headers.items():
        log._add_table(name, fields)
    for event in run.events:
        if event.code in {"START", "GUARD"}:  # both before the first block
            log.write(BY_NAME["event/plant"], event.SerializeToString())
    whole = {name: with_tags(name, table) for name, table in tables.items()}
    for start in range(0, max(len(table) for table in tables.values()), blocks):
        for name, table in whole.items():
            for record in table[start : start + blocks]:
                log._add(BY_NAME[name], record.tobytes(), int(record["sequence"]), int(record["t_ns"]))
        log.flush()
    for event in run.events:
        if event.code == "END":
            log.write(BY_NAME["event/" + event.source], event.SerializeToString())
    log.close()


def doctored(folder: Path, change: Callable[[Tables], None], name: str = "doctored.mcap") -> Path:
    """The short log with its tables changed."""
    path = folder / "whole.mcap"
    path.write_bytes(short_log())
    run = read_run(path)
    tables = tables_of(run)
    change(tables)
    out = folder / name
    write(out, tables, run)
    return out


def empty_log(folder: Path) -> Path:
    """A log of a run that ended before its first block."""

    def change(tables: Tables) -> None:
        for name, table in tables.items():
            tables[name] = table[:0]

    return doctored(folder, change, "empty.mcap")
