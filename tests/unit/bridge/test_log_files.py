"""A log in several files: by size and time, where its file is taken away, where the disk is full or slow."""

import errno
import os
import re
import resource
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer

from bridge.faults import Fault
from bridge.log.check.log_check import check_log
from bridge.log.logfile import read_run
from bridge.log.mcap_chunks import ChunkWriter
from bridge.log.recover import recover
from bridge.log.runlog import Rotation, RunLog
from bridge.log.storage import log_files
from bridge.log.storage.parts import parts_of
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import sensor_block
from bridge.wire.topics import SENSORS
from cockpit.run.run import keep_aside


def write(log: RunLog, blocks: range) -> None:
    record = sensor_block(20).blank()
    for block in blocks:
        record["sequence"], record["t_ns"] = block, 1_000_000 * (block + 1)
        log.write(SENSORS, record.tobytes())
    log.flush()


def rotated(path: Path, files: int = 4, scenario: str = "x") -> None:
    log = RunLog(path, lockstep=True, rotation=Rotation(seconds=0.1))
    log.add_metadata("run", {"scenario": scenario})
    for start in range(0, 100 * files, 50):
        write(log, range(start, start + 50))
    log.close()


def changes(path: Path, kind: str = "changed") -> list[str]:
    return [f"{finding.where}: {finding.text}" for finding in check_log(path).findings if finding.kind == kind]


def gaps(path: Path) -> list[str]:
    return changes(path, "gap")


def test_a_log_goes_on_in_the_next_file_and_is_read_by_its_first_name(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rotated(path)
    parts = parts_of(path)
    assert [part.name for part in parts][:3] == ["run.mcap", "run-0001.mcap", "run-0002.mcap"]
    run = read_run(path)
    assert run.sensors["sequence"].tolist() == list(range(400))
    assert (run.damage.whole, run.headers["run"]) == (True, {"scenario": '"x"'})
    assert changes(path) == []
    later = read_run(parts[2])  # any of them begins the rest
    assert later.sensors["sequence"][-1] == 399
    assert later.headers == run.headers


def test_a_file_by_size(tmp_path: Path) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=True, rotation=Rotation(bytes=120_000))
    for start in range(0, 6000, 100):
        write(log, range(start, start + 100))
    log.close()
    parts = parts_of(log.path)
    assert len(parts) > 2
    assert all(120_000 <= part.stat().st_size < 240_000 for part in parts[:-1])
    assert len(read_run(log.path).sensors) == 6000


def test_a_file_of_a_log_that_was_taken_away_changed_or_exchanged_is_found(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rotated(path)
    second = parts_of(path)[2]
    kept = second.read_bytes()
    second.unlink()
    assert gaps(path) == ["/sensors: 100 messages lost: 200 to 299"]
    second.write_bytes(kept[:3000] + bytes([kept[3000] ^ 1]) + kept[3001:])
    assert changes(path) == [
        "run-0002.mcap: does not fit the checksums at its end: it was damaged or changed after writing; do not trust it"
    ]
    other = tmp_path / "other" / "run.mcap"
    rotated(other, scenario="y")
    second.write_bytes(parts_of(other)[2].read_bytes())
    assert gaps(path) == ["/sensors: 100 messages lost: 200 to 299"]


def test_a_new_log_does_not_take_the_files_of_an_old_one(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rotated(path)
    (tmp_path / "run-0009.mcap").write_text("mine")
    rotated(path, files=1)
    assert len(parts_of(path)) <= 2
    assert (tmp_path / "run-0009.mcap").read_text() == "mine"
    assert len(read_run(path).sensors) == 100


def test_a_log_that_is_kept_aside_keeps_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "run.mcap"
    rotated(path)
    keep_aside(path)
    aside = re.match(r"kept     (\S+) ", capsys.readouterr().err)
    assert aside is not None
    assert len(read_run(Path(aside[1])).sensors) == 400
    assert not list(tmp_path.glob("run-000*.mcap"))


def test_recover_in_place_mends_the_file_that_is_cut_and_leaves_the_others(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rotated(path)
    parts = parts_of(path)
    whole = [part.read_bytes() for part in parts]
    parts[1].write_bytes(whole[1][:-3000])
    recover(path, path)
    assert [part.read_bytes() == data for part, data in zip(parts, whole, strict=True)].count(False) == 1
    assert read_run(path).damage.closed
    assert changes(path) == []
    recover(path, tmp_path / "one.mcap")
    assert len(read_run(tmp_path / "one.mcap").sensors) == len(read_run(path).sensors)


def deleted(path: Path) -> None:
    path.unlink()


def renamed(path: Path) -> None:
    path.rename(path.with_name("other.mcap"))


def cut(path: Path) -> None:
    os.truncate(path, 0)


def replaced(path: Path) -> None:
    path.with_name("new").write_bytes(b"hello")
    path.with_name("new").rename(path)


@pytest.mark.parametrize(
    ("act", "code", "text"),
    [
        (deleted, "LOG_LOST", "was deleted: the recording so far is lost"),
        (renamed, "LOG_LOST", "was renamed: it is whole, under another name"),
        (cut, "LOG_LOST", "was cut: "),
        (replaced, "LOG_REPLACED", "was replaced by another file: the recording so far is lost"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_file_that_is_taken_away_is_reported_and_the_log_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, act: Callable[[Path], None], code: str, text: str
) -> None:
    monkeypatch.setattr(log_files, "_LOOK_S", 0.0)
    events: list[wire.Event] = []
    path = tmp_path / "run.mcap"
    log = RunLog(path, lockstep=False, on_event=events.append)
    log._files._look_s = 0.0
    log.add_event("WATCH", "what holds for the whole log", holds=True)
    write(log, range(100))
    act(path)
    write(log, range(100, 200))
    write(log, range(200, 300))
    with pytest.raises(Fault, match=rf"LOG_LOST: .*run.mcap: {text}.*; it continues in run-0001.mcap"):
        log.close()
    assert [event.code for event in events] == ["WATCH", code, "WATCH"]
    run = read_run(tmp_path / "run-0001.mcap")
    assert run.sensors["sequence"][-1] == 299
    assert [(event.code, event.sequence) for event in run.events] == [(code, 1), ("WATCH", 2)]
    assert run.damage.whole
    if act is renamed:
        assert read_run(tmp_path / "other.mcap").damage.whole
    with pytest.raises(Fault, match=r"BAD_LOG: "):
        read_run(path)


def test_a_log_whose_first_file_is_gone_names_the_next(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rotated(path)
    path.unlink()
    with pytest.raises(
        Fault, match=r"no such file; run-0001.mcap in the same folder seems to be a later part of that log; give"
    ):
        read_run(path)


@pytest.mark.parametrize("number", ['"x"', "[1]"])
def test_a_log_whose_place_among_others_is_damaged_is_alone(tmp_path: Path, number: str) -> None:
    path = tmp_path / "run-0001.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_metadata("part", {"number": number, "begins": '"a"'})
        writer.finish()
    assert parts_of(path) == [path]


def test_a_full_disk_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_files, "_LOOK_S", 0.0)
    events: list[wire.Event] = []
    log = RunLog(tmp_path / "run.mcap", lockstep=False, patient=True, on_event=events.append)
    write(log, range(100))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    monkeypatch.setattr(log_files.LogFiles, "_has_room", lambda _self: False)
    resource.setrlimit(resource.RLIMIT_FSIZE, (log.path.stat().st_size + 2000, before[1]))
    try:
        write(log, range(100, 300))  # does not fit
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    write(log, range(300, 400))  # goes nowhere, and the caller goes on
    monkeypatch.undo()
    log._files._look_s = 0.0
    write(log, range(400, 401))
    write(log, range(401, 500))
    with pytest.raises(
        Fault, match=r"LOG_WRITE: .*run.mcap: File too large; the log was closed at 0.10 s, .* run-0001.mcap"
    ):
        log.close()
    assert [event.code for event in events] == ["LOG_WRITE", "LOG_WRITE"]
    assert events[1].text == "space is free again: 301 messages since 0.30 s were not recorded"
    run = read_run(log.path)
    assert len(run.sensors) == 500 - 301
    assert [event.code for event in run.events] == [
        "LOG_WRITE",
        "LOG_WRITE",
    ]  # the first in the room that the chunk left
    assert run.damage.whole
    assert changes(log.path) == []


def test_a_full_disk_reports_the_number_of_missing_messages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=False, patient=True)

    def full(_self: ChunkWriter) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    write(log, range(10))
    monkeypatch.setattr(ChunkWriter, "flush", full)
    write(log, range(10, 20))
    write(log, range(20, 30))
    with pytest.raises(Fault, match=r"No space left on device; .*; 20 messages after that were not recorded"):
        log.close()
    log.close()


def test_a_slow_disk_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    events: list[wire.Event] = []
    log = RunLog(tmp_path / "run.mcap", lockstep=False, patient=True, on_event=events.append)
    log._files._look_s = 0.0
    real = ChunkWriter.flush

    def slow(self: ChunkWriter) -> None:
        time.sleep(0.02)
        real(self)

    monkeypatch.setattr(log_files, "_SLOW_S", 0.01)
    monkeypatch.setattr(ChunkWriter, "flush", slow)
    write(log, range(10))
    log.close()
    assert [event.code for event in events] == ["DISK_SLOW"]


def test_the_index_of_a_long_log_does_not_stay_in_memory(tmp_path: Path) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=True)
    for block in range(900):
        write(log, range(block, block + 1))
    writer = log._files.writer
    assert writer is not None
    assert writer._index.fileno() > 0  # a file by now
    log.close()
    assert len(read_run(log.path).sensors) == 900
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.mcap"]


@pytest.mark.parametrize("recovered", [False, True])
def test_the_files_of_a_log_with_a_hash_chain_belong_together(tmp_path: Path, recovered: bool) -> None:
    for number, name in enumerate(("run.mcap", "run-0001.mcap")):
        log = RunLog(tmp_path / name, lockstep=True)
        writer = log._files.writer
        assert writer is not None
        if number:
            writer.add_metadata("part", {"number": "1", "begins": '"ab"', "follows": '"cd"'})
        elif recovered:
            writer.add_metadata("recovered", {"from": "run.mcap", "begins": "ab"})
        writer.add_metadata("chain", {"link": "0", "sha256": "12" if recovered else "ab"})
        write(log, range(100 * number, 100 * number + 100))
        log.close()
    run = read_run(tmp_path / "run.mcap")
    assert (len(run.sensors), run.headers, run.checksums.damaged) == (200, {}, [])
