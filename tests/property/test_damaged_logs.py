"""Cut and damaged logs: messages before the damage are read, readable ones recovered, and only a Fault is raised."""

import contextlib
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from bridge.faults import Fault
from bridge.log import recorder
from bridge.log.check.log_check import check_log
from bridge.log.damage import Damage
from bridge.log.log_reader import LogReader
from bridge.log.logfile import read_run
from bridge.log.recover import recover
from bridge.log.runlog import RunLog
from bridge.tables.export import export
from bridge.wire.complaints import Complaints
from bridge.wire.inbox import Inbox
from bridge.wire.messages import sensor_block
from bridge.wire.topics import CONTROLLER_EVENT, PLANT_EVENT, SENSORS, SNAPSHOT, Topic
from bridge.wire.zenoh_link import Received
from tests.logs import doctored, short_log
from tests.patience import PATIENCE_S

TABLES = ("sensors", "applied", "command", "trace", "state")
quick = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


def chunk_ends() -> list[int]:
    """Where each chunk of the short log ends, the first entry being where the first begins."""
    data = short_log()
    ends: list[int] = []
    at = 8
    while at < len(data) - 8:
        length = int.from_bytes(data[at + 1 : at + 9], "little")
        if data[at] == 6:
            ends += [at + 9 + length] if ends else [at, at + 9 + length]
        at += 9 + length
    return ends


def ends_of_header() -> int:
    """End of the header record, which identifies the writer."""
    return 8 + 9 + int.from_bytes(short_log()[9:17], "little")


@quick
@given(st.floats(0.0, 1.0))
@example(0.0)
@example(1.0)
def test_a_cut_costs_only_the_open_chunk(tmp_path: Path, share: float) -> None:
    data = short_log()
    cut = round(share * len(data))
    path, saved = tmp_path / "cut.mcap", tmp_path / "saved.mcap"
    path.write_bytes(data[:cut])
    ends = chunk_ends()
    whole_chunks = sum(end <= cut for end in ends[1:])
    if cut < ends_of_header():
        with pytest.raises(Fault, match="BAD_LOG"):
            read_run(path)
        return
    run = read_run(path)
    assert len(run.sensors) == min(40 * whole_chunks, 400)
    assert run.damage.cut_bytes < max(np.diff([8, *ends]).max(), 5000)
    if not whole_chunks:
        with pytest.raises(Fault, match=r"BAD_LOG: .*cut.mcap: holds no readable message.*the file is unchanged"):
            recover(path, path)
        assert path.read_bytes() == data[:cut]
        return
    result = recover(path, saved)
    again = read_run(saved)
    assert again.damage._replace(before="") == Damage(0, 0, closed=True)
    for name in TABLES:
        assert getattr(again, name).tobytes() == getattr(run, name).tobytes()
    assert again.headers == run.headers
    with saved.open("rb") as file:  # other programs can use the index
        assert sum(1 for _ in make_reader(file).iter_messages()) == result.messages


@quick
@given(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 7))
def test_a_flipped_bit_costs_one_chunk_at_most(tmp_path: Path, share: float, bit: int) -> None:
    data = bytearray(short_log())
    at = int(share * len(data))
    data[at] ^= 1 << bit
    path, saved = tmp_path / "flipped.mcap", tmp_path / "saved.mcap"
    path.write_bytes(data)
    if at < ends_of_header():  # magic and header: the writer is unknown
        with contextlib.suppress(Fault):
            recover(path, saved)
        return
    result = recover(path, saved)
    run, again = read_run(path), read_run(saved)
    assert again.sensors.tobytes() == run.sensors.tobytes()
    if chunk_ends()[0] <= at:  # behind the definitions
        assert len(run.sensors) >= 360
    if len(run.sensors) < 400 and chunk_ends()[0] <= at:
        assert result.damage.bad_chunks + result.damage.bad_records >= 1


@quick
@given(st.data())
def test_every_byte_of_the_definitions_may_be_damaged(tmp_path: Path, data: st.DataObject) -> None:
    content = bytearray(short_log())
    first = chunk_ends()[0]
    # strings hold most of the bytes; the bytes around them matter more
    at = data.draw(st.one_of(st.integers(8, 60), st.integers(8, first - 1), st.integers(first - 1500, first - 1)))
    content[at] = data.draw(st.integers(0, 255))
    path = tmp_path / "flipped.mcap"
    path.write_bytes(content)
    with contextlib.suppress(Fault):
        recover(path, tmp_path / "saved.mcap")
        run = read_run(tmp_path / "saved.mcap")
        for role in ("plant", "controller"):
            run.configuration(role)


@quick
@given(st.binary(max_size=400))
def test_noise_after_the_magic_is_a_fault(tmp_path: Path, noise: bytes) -> None:
    path = tmp_path / "noise.mcap"
    path.write_bytes(short_log()[:8] + noise)
    with pytest.raises(Fault, match="BAD_LOG"):
        list(LogReader(path).messages())


def test_recover_in_place_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(short_log()[:-9000])
    recover(path, path)
    assert read_run(path).damage.closed
    assert [entry.name for entry in tmp_path.iterdir()] == ["cut.mcap"]


def test_a_clock_that_goes_back_is_read_unchanged(tmp_path: Path) -> None:
    def change(tables: dict[str, np.ndarray]) -> None:
        tables["sensors"]["t_ns"][100:] -= 90_000_000

    run = read_run(doctored(tmp_path, change))
    assert (np.diff(run.sensors["t_ns"]) < 0).sum() == 1
    assert len(run.sensors) == 400


def test_messages_without_their_zeros_are_all_read(tmp_path: Path) -> None:
    """A client that leaves zeros out sends messages of one length too: they are many, not one."""
    from bridge.wire import stickslip_pb2 as wire
    from bridge.wire.topics import COMMAND

    path = tmp_path / "sparse.mcap"
    log = RunLog(path, lockstep=True)
    for i in range(1, 11):
        log.write(COMMAND, wire.Command(sequence=i, t_ns=i * 1000, block=i, frequency_Hz=1500.0).SerializeToString())
    log.close()
    command = read_run(path).command
    assert command["sequence"].tolist() == list(range(1, 11))
    assert (command["frequency_Hz"] == 1500.0).all()


def block(number: int, samples: int = 20, t_ns: int | None = None) -> bytes:
    sensors = sensor_block(samples).blank()
    sensors["sequence"], sensors["t_ns"] = number, (number + 1) * 1_000_000 if t_ns is None else t_ns
    return sensors.tobytes()


@pytest.mark.parametrize("odd", [0, 600])
def test_an_odd_block_costs_only_itself(tmp_path: Path, odd: int) -> None:
    log = RunLog(tmp_path / "odd.mcap", lockstep=True)
    for number in range(1000):
        log.write(SENSORS, block(number, 19 if number == odd else 20))
    log.close()
    run = read_run(tmp_path / "odd.mcap")
    assert run.sensors["sequence"].tolist() == [number for number in range(1000) if number != odd]
    assert run.damage.bad_records == 1


@pytest.mark.parametrize("topic", [PLANT_EVENT, CONTROLLER_EVENT, SNAPSHOT], ids=lambda topic: topic.name)
def test_an_event_or_a_snapshot_that_cannot_be_read_costs_only_itself(tmp_path: Path, topic: Topic) -> None:
    path, saved = tmp_path / "odd.mcap", tmp_path / "saved.mcap"
    log = RunLog(path, lockstep=True)
    payload = topic.message(sequence=0, t_ns=7).SerializeToString()
    log.write(topic, payload)
    log._add(topic, b"\x09rubbish", 1, 8)
    for number in range(1000):
        log.write(SENSORS, block(number))
    log.close()
    recover(path, saved)
    for file in (path, saved):
        run = read_run(file)
        assert [message.t_ns for message in [*run.events, *run.snapshots]] == [7]
        assert len(run.sensors) == 1000
        assert run.damage.bad_records == 1
        kinds = {finding.kind for finding in check_log(file).findings}
        assert "damaged" in kinds
        assert "bad-message" not in kinds


def test_a_time_before_the_start_and_a_full_disk_are_faults(tmp_path: Path) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=False)
    with pytest.raises(Fault, match=r"BAD_MESSAGE: sensors: t_ns = -1: must be 0 or more; count"):
        log.write(SENSORS, block(0, t_ns=-1))
    log.close()
    with pytest.raises(Fault, match="LOG_WRITE: /dev/full"):
        RunLog(Path("/dev/full"), lockstep=False)


def test_a_log_that_a_fault_has_closed_can_be_closed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=True)
    log.write(SENSORS, block(0))

    def full(index: bool = True) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(log._files.writer, "finish", full)
    with pytest.raises(Fault, match="LOG_WRITE"):
        log.close()
    log.close()  # as a `finally` does


def test_a_log_that_is_being_recorded_is_not_replaced(tmp_path: Path) -> None:
    path, other = tmp_path / "run.mcap", tmp_path / "other.mcap"
    log = RunLog(path, lockstep=True)
    for number in range(3000):
        log.write(SENSORS, block(number))
    with pytest.raises(Fault, match=r"LOG_WRITE: .*run.mcap: is being recorded: must be closed .* give another --out"):
        recover(path, path)
    with pytest.raises(Fault, match=r"LOG_WRITE: .*run.mcap: is being recorded: .* or choose another --log"):
        RunLog(path, lockstep=True)
    assert recover(path, other).messages > 0
    log.close()
    assert recover(path, path).messages == 3000 + 600  # of the blocks, and the scope of every 5 ms
    RunLog(path, lockstep=True).close()
    with pytest.raises(Fault, match=r"BAD_LOG: .*run.mcap: holds no readable message"):
        recover(path, tmp_path / "new folder" / "saved.mcap")


def test_an_unreadable_chunk_gives_no_table(tmp_path: Path) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=True)
    for number in range(100):
        log.write(SENSORS, block(number))
    log.flush()
    for number in range(100, 200):  # a rig with other blocks came in its place
        log.write(SENSORS, block(number, 19))
    log.close()
    assert export(tmp_path / "run.mcap", tmp_path / "run.csv", ["sensors"], 0.0, 10.0).rows == {"sensors": 2000}


def test_a_rig_that_leaves_before_its_first_word_ends_the_record(tmp_path: Path) -> None:
    class Quiet:
        dropped = 0

        def get(self, timeout_s: float) -> None:
            time.sleep(timeout_s)

    class Left:
        """A bus that the plant leaves after the first look."""

        def __init__(self) -> None:
            self.looks = 0

        def alive(self, role: str) -> bool:
            assert role == "plant"
            self.looks += 1
            return self.looks == 1

        def linked(self) -> bool:
            return True

    log = RunLog(tmp_path / "run.mcap", lockstep=False)
    bus: Any = Left()
    inbox: Any = Quiet()
    complaints = Complaints(log.add_event)
    assert recorder._record(log, bus, inbox, threading.Event(), None, complaints) is True
    log.close()
    assert [event.code for event in read_run(log.path).events] == ["PLANT_LOST"]


def test_a_rig_that_leaves_before_a_busy_recorder_looks_for_it_ends_the_record(tmp_path: Path) -> None:
    """Its END was lost as well: four rigs on two cores did that, and the recorder waited for ever."""
    log = RunLog(tmp_path / "run.mcap", lockstep=False)
    inbox = Inbox(10)
    inbox.push(Received(SENSORS, block(0), 0))
    bus: Any = SimpleNamespace(alive=lambda _role: False, linked=lambda: False)
    complaints = Complaints(log.add_event)
    assert recorder._record(log, bus, inbox, threading.Event(), None, complaints) is True
    log.close()
    assert [event.code for event in read_run(log.path).events] == ["PLANT_LOST"]


def test_a_late_block_is_not_a_loss_and_a_new_start_is_reported(tmp_path: Path) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=True)
    for number in [*range(4), 1, *range(4, 300), *range(3)]:
        log.write(SENSORS, block(number))
    log.close()
    events = read_run(tmp_path / "run.mcap").events
    assert [(event.code, event.text) for event in events] == [
        ("RESTART", "/sensors: 0 after 299: its sender restarted")
    ]


def test_a_stop_ends_the_record_of_a_rig_that_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Endless:
        """An inbox that is never empty, except in a test that hangs."""

        def __init__(self) -> None:
            self.began_s = time.monotonic()
            self.count = 0
            self.dropped = 0

        def get(self, _: float) -> Received:
            assert time.monotonic() < self.began_s + PATIENCE_S
            self.count += 1
            return Received(SENSORS, block(self.count), 0)

    monkeypatch.setattr(recorder, "_STOP_S", 0.1, raising=False)
    log = RunLog(tmp_path / "run.mcap", lockstep=False)
    stop = threading.Event()
    stop.set()
    bus: Any = None
    inbox: Any = Endless()
    complaints = Complaints(log.add_event)
    assert recorder._record(log, bus, inbox, stop, None, complaints) is False
    assert inbox.count > 0
    log.close()
