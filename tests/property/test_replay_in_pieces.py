"""A log that is replayed piece by piece gives the answer of the log in whole, whatever it lacks and in which order it comes."""

import json
import random
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.faults import Fault
from bridge.log import log_reader
from bridge.log.logfile import RunData, read_run
from bridge.log.runlog import RunLog
from bridge.wire.topics import BY_NAME
from cockpit.run import replay as replaying
from cockpit.run.in_process import run_onboard
from cockpit.run.replay import changes_of, replay_log
from cockpit.run.scenario import load_scenario
from controller import replay as module
from controller.replay import Change, OutOfOrder, Replay, Replayer, replay
from tests.logs import tables_of, with_tags, write

TOPICS = ("announce", "sensors", "command", "trace")
WINDOW = 600  # steps


@cache
def whole_run() -> RunData:
    """2.5 s with two snapshots and an announcement."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        run_onboard(load_scenario("paper-c45-c45", ["duration_s=2.5", "rig.drive.announce_ahead_s=0.02"]), path, {})
        return read_run(path)


def rows_of(records: Any, rows: Any) -> Any:
    """Some messages, with the tags between their fields."""
    return records.view(f"V{records.dtype.itemsize}")[rows].view(records.dtype)


def lossy(chance: random.Random, disorder: bool) -> RunData:
    """The run without some of its messages, a changed one among them; some twice or in another order."""
    tables: dict[str, Any] = tables_of(whole_run())
    snapshots = list(whole_run().snapshots)
    for _ in range(chance.randrange(4)):
        topic = chance.choice(TOPICS)
        rows = np.arange(len(tables[topic]))
        at = chance.randrange(len(rows) + 1)
        until = at + chance.choice([1, 3, 50, 700])
        kind = chance.choice(["lost", "lost", "changed", "snapshot", *(["again", "turned"] if disorder else [])])
        if kind == "lost":
            tables[topic] = rows_of(tables[topic], np.delete(rows, slice(at, until)))
        elif kind == "again":
            tables[topic] = rows_of(tables[topic], np.concatenate([rows[:until], rows[at:]]))
        elif kind == "turned":
            rows[at:until] = rows[at:until][::-1]
            tables[topic] = rows_of(tables[topic], rows)
        elif kind == "changed" and len(rows):
            field = {"announce": "drive_velocity_mps", "sensors": "check_Hz", "command": "mode", "trace": "force_rate"}[
                topic
            ]
            tables[topic][field][at % len(rows)] += 1
        elif kind == "snapshot" and snapshots:
            at = chance.randrange(len(snapshots))
            snapshots[at : at + 1] = [snapshots[at]] * (2 if disorder else 0)
    return whole_run()._replace(snapshots=snapshots, **{topic: tables[topic] for topic in TOPICS})


def in_pieces(run: RunData, changes: list[Change], from_s: float, chance: random.Random, apart_ms: int) -> Replay:
    """The answer to a log whose topics are up to `apart_ms` apart."""
    replayer = Replayer(changes, from_s)
    piece_ms = chance.choice([7, 37, 100])
    done = dict.fromkeys(TOPICS, 0)
    snapshots = list(run.snapshots)
    for until_ms in range(piece_ms, 2500 + 2 * apart_ms + piece_ms, piece_ms):
        for topic in chance.sample(TOPICS, len(TOPICS)):
            table = getattr(run, topic)
            latest_ns = (until_ms - chance.randrange(apart_ms + 1)) * 1_000_000
            came = np.searchsorted(np.maximum.accumulate(table["t_ns"]), latest_ns, "right") if len(table) else 0
            end = max(done[topic], int(came))
            replayer.add(topic, table[done[topic] : end])
            done[topic] = end
        while snapshots and snapshots[0].t_ns <= until_ms * 1_000_000:
            replayer.add_snapshot(snapshots.pop(0))
    return replayer.result()


@pytest.fixture
def small_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "WINDOW", WINDOW)


def answer(run: RunData, changes: list[Change], from_s: float) -> Replay | str:
    try:
        return replay(run, changes, from_s)
    except Fault as fault:
        return str(fault)


@pytest.mark.usefixtures("small_window")
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.0, 0.4, 1.0005, 2.2]), st.booleans())
def test_replay_in_pieces_equals_replay_of_the_whole_log(seed: int, from_s: float, disorder: bool) -> None:
    chance = random.Random(seed)
    run = lossy(chance, disorder)
    changes = changes_of(whole_run(), ["limits.v_ratio=1.1@1.2s"] if chance.random() < 0.2 else [])
    apart_ms = chance.choice([0, 20, 2 * WINDOW if disorder else 100])
    try:
        found = in_pieces(run, changes, from_s, chance, apart_ms)
    except OutOfOrder:
        # a log that lacks nothing and is in order within the window is replayed in pieces; snapshots, the last of which before
        # `from_s` is the start, are further apart than this window
        lacks = any(len(getattr(run, topic)) < len(getattr(whole_run(), topic)) for topic in TOPICS)
        assert disorder or from_s or lacks
    else:
        assert repr(found) == repr(answer(run, changes, from_s))


def test_nothing_is_kept_of_a_log_in_order() -> None:
    run = whole_run()
    replayer = Replayer(changes_of(run, []))
    replayer.add("announce", run.announce)
    for first in range(0, len(run.trace), 100):
        for topic in ("sensors", "command", "trace"):
            replayer.add(topic, getattr(run, topic)[first : first + 100])
        assert [len(replayer._tables[topic]) for topic in ("sensors", "command", "trace")] == [0, 0, 0]


def passes_of(path: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    """How often a log is read for a replay, whose result equals the replay of the whole log."""
    whole_logs: list[RunData] = []
    with monkeypatch.context() as patch:
        patch.setattr(replaying, "read_run", lambda path: whole_logs.append(read_run(path)) or whole_logs[-1])
        found = replay_log(path, 0.0, [])
    run = read_run(path)
    whole = replay(run, changes_of(run, []))
    assert (found.compared_steps, found.skipped_steps, found.difference) == whole
    return 1 + len(whole_logs)


@pytest.mark.usefixtures("small_window")
@pytest.mark.parametrize("late", ["command", "sensors"])
def test_a_log_in_another_order_is_read_again(tmp_path: Path, late: str, monkeypatch: pytest.MonkeyPatch) -> None:
    run, path = whole_run(), tmp_path / "late.mcap"
    tables = tables_of(run)
    write(path, tables, run)
    assert passes_of(path, monkeypatch) == 1
    tables[late] = rows_of(tables[late], np.roll(np.arange(len(tables[late])), -700))
    write(path, tables, run)
    assert passes_of(path, monkeypatch) == 2


def test_of_two_configurations_the_last_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run, path = whole_run(), tmp_path / "late.mcap"
    first = json.loads(run.headers["controller"]["configuration"])
    first["policy"]["enabled_from_s"] = 0.1
    log = RunLog(path, lockstep=True)
    log._add_table("controller", run.headers["controller"] | {"configuration": json.dumps(first)})
    for start in range(0, len(run.trace), 500):
        for name in TOPICS:
            for message in with_tags(name, getattr(run, name)[start : start + 500]):
                log._add(BY_NAME[name], message.tobytes(), int(message["sequence"]), int(message["t_ns"]))
        log.flush()
    log._add_table("controller", run.headers["controller"])
    log.close()
    monkeypatch.setattr(log_reader, "AT_ONCE_BYTES", 1)  # else the reader is at its end before the first step is taken
    assert passes_of(path, monkeypatch) == 2
    assert replay_log(path, 0.0, []).identical
