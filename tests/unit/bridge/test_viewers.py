"""Additions of the recorder for viewers: the topics scope and log, the comments in the descriptors."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import make_reader

from bridge.log.check.log_check import check_log
from bridge.log.logfile import read_run
from bridge.log.runlog import RunLog
from bridge.log.viewers.stretches import envelope_of
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import SCOPE, TRACE, sensor_block
from bridge.wire.topics import PLANT_EVENT, SENSORS, TOPICS
from bridge.wire.topics import TRACE as TRACE_TOPIC
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("viewers") / "run.mcap"
    scenario = load_scenario("from-the-start", ["duration_s=1.203"])
    run_onboard(scenario, path, {"scenario": scenario.name})
    return path


def messages(path: Path, topic: str) -> list[tuple[Any, Any]]:
    """The messages of a topic with their log times, decoded by the schema in the log alone, as another program does it."""
    schemas: list[tuple[Any, Any]] = []
    with path.open("rb") as file:
        for schema, _, message in make_reader(file).iter_messages(topics=[topic]):
            schemas.append((schema, message))
    pool = DescriptorPool()
    for one in descriptor_pb2.FileDescriptorSet.FromString(schemas[0][0].data).file:
        pool.Add(one)
    kind = GetMessageClass(pool.FindMessageTypeByName(schemas[0][0].name))
    return [(kind.FromString(message.data), message.log_time) for _, message in schemas]


def test_scope_has_the_smallest_mean_and_largest_sample_of_each_stretch(log: Path) -> None:
    run = read_run(log)
    scope = messages(log, "/scope")
    assert [said.sequence for said, _ in scope] == list(range(241))
    assert [said.t_ns for said, _ in scope] == [*(5_000_000 * (i + 1) for i in range(240)), 1_203_000_000]
    assert [log_time for _, log_time in scope] == [said.t_ns for said, _ in scope]
    for name in CHANNELS:
        at = name.rindex("_")
        each = [run.sensors[name][5 * i : 5 * i + 5] for i in range(241)]
        for which, figure in {"min": np.min, "max": np.max, "mean": np.mean}.items():
            values = [getattr(said, f"{name[:at]}_{which}{name[at:]}") for said, _ in scope]
            np.testing.assert_allclose(values, [figure(stretch) for stretch in each], rtol=2e-6, err_msg=name)


def test_a_corrupted_sample_makes_no_warning() -> None:
    values = np.array([[np.inf, -np.inf, 3e38, 3e38, np.nan, 1.0]], np.float32)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        least, mean, most = envelope_of(values, np.array([0, 2, 4]))
    np.testing.assert_array_equal(least, np.float32([[-np.inf, 3e38, np.nan]]))
    np.testing.assert_array_equal(most, np.float32([[np.inf, 3e38, np.nan]]))
    np.testing.assert_array_equal(mean, [[np.nan, np.inf, np.nan]])


def test_scope_names_mode_and_limits_in_force(log: Path) -> None:
    run = read_run(log)
    scope = messages(log, "/scope")
    rows = [min(5 * i + 4, 1202) for i in range(241)]
    for field in ("mode", "state", "reason", "limit", "drive_velocity_mps", "vibration_velocity_mps"):
        values = [getattr(said, field) for said, _ in scope]
        np.testing.assert_allclose(values, run.trace[field][rows], rtol=1e-6, err_msg=field)
    assert [said.amplitude_m for said, _ in scope] == pytest.approx(run.applied["amplitude_m"][rows], rel=1e-6)
    names = {said.DESCRIPTOR.fields_by_name["mode"].enum_type.values_by_number[said.mode].name for said, _ in scope}
    assert "EXCITE" in names


def test_every_field_of_scope_is_written_so_that_all_messages_are_of_one_length(log: Path) -> None:
    with log.open("rb") as file:
        lengths = {len(message.data) for *_, message in make_reader(file).iter_messages(topics=["/scope"])}
    assert lengths == {SCOPE.size}
    zero = SCOPE.blank().tobytes()
    assert wire.Scope.FromString(zero) == wire.Scope()
    assert bytes([0xC0, 0x01, 0x00]) in zero  # an explicit zero of `mode`


def block(number: int, samples: int, t_ns: int, force_N: float) -> bytes:
    record = sensor_block(samples).blank()
    record["sequence"], record["t_ns"], record["drive_force_N"] = number, t_ns, force_N
    return record.tobytes()


def scoped(path: Path, topic: str = "/scope") -> list[Any]:
    return [said for said, _ in messages(path, topic)]


def test_blocks_of_any_length_lost_ones_and_no_controller(tmp_path: Path) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=True)
    lost = {3, 4, 5, 30}
    for number in range(100):  # of 2 ms: two or three of them in a stretch
        if number not in lost:
            log.write(SENSORS, block(number, 40, 2_000_000 * (number + 1), float(number)))
        if number == 49:
            log.flush()
    log.close()
    scope = scoped(log.path)
    stretches: dict[int, list[int]] = {}
    for number in range(100):
        if number not in lost:
            stretches.setdefault((2_000_000 * (number + 1) - 1) // 5_000_000, []).append(number)
    assert [said.drive_force_min_N for said in scope] == [min(stretch) for stretch in stretches.values()]
    assert [said.drive_force_max_N for said in scope] == [max(stretch) for stretch in stretches.values()]
    assert {(said.mode, said.amplitude_m) for said in scope} == {(0, 0.0)}


def test_blocks_of_another_length_restart_the_scope_and_odd_messages_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bridge.log.viewers.scope.AT_ONCE_BLOCKS", 10)
    log = RunLog(tmp_path / "run.mcap", lockstep=True)
    for number in range(20):
        log.write(SENSORS, block(number, 20, 1_000_000 * (number + 1), 1.0))
    log.write(SENSORS, wire.SensorBlock(sequence=20, t_ns=21_000_000).SerializeToString())
    log.flush()
    trace = TRACE.blank()
    trace["t_ns"], trace["mode"] = 22_000_000, wire.EXCITE
    log.write(TRACE_TOPIC, trace.tobytes())
    for number in range(21, 41):
        log.write(SENSORS, block(number, 10, 1_000_000 * (number + 1), 2.0))
    log.close()
    scope = scoped(log.path)
    assert {said.drive_force_mean_N for said in scope} == {1.0, 2.0}
    assert [said.mode for said in scope if said.t_ns > 22_000_000] == [wire.EXCITE] * 5


def test_a_log_without_a_block_has_no_scope(tmp_path: Path) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=True)
    log.write(PLANT_EVENT, wire.Event(code="START", source="plant").SerializeToString())
    log.close()
    with log.path.open("rb") as file:
        assert list(make_reader(file).iter_messages(topics=["/scope"])) == []


def test_events_are_repeated_as_foxglove_log_with_a_level(tmp_path: Path) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=True)
    for number, code in enumerate(["START", "FALLBACK", "FAULT", "NOT_KNOWN"]):
        event = wire.Event(sequence=number, t_ns=1_500_000_000, source="plant", code=code, text="so it is")
        log.write(PLANT_EVENT, event.SerializeToString())
    log.add_event("GAP", "three lost", 2_000_000_001)
    log.close()
    said = scoped(log.path, "/log")
    assert [(one.level, one.name, one.message) for one in said] == [
        (2, "plant", "START: so it is"),
        (3, "plant", "FALLBACK: so it is"),
        (4, "plant", "FAULT: so it is"),
        (3, "plant", "NOT_KNOWN: so it is"),
        (3, "recorder", "GAP: three lost"),
    ]
    assert [(one.timestamp.seconds, one.timestamp.nanos) for one in said][-1] == (2, 1)
    assert len(read_run(log.path).events) == 5  # none of them twice


def test_the_comments_with_units_are_in_the_descriptors(log: Path) -> None:
    described = 0
    with log.open("rb") as file:
        summary = make_reader(file).get_summary()
    for schema in summary.schemas.values():
        if not schema.name.startswith("stickslip."):
            continue
        file_set = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
        names = [entry.name for entry in file_set.file[0].message_type]
        index = names.index(schema.name.removeprefix("stickslip."))
        places = [place for place in file_set.file[0].source_code_info.location if list(place.path[:2]) == [4, index]]
        assert places[0].leading_comments
        described += len(places)
    assert described > 60
    assert {channel.topic for channel in summary.channels.values()} == {
        *("/" + topic.name for topic in TOPICS if topic.logged),
        "/scope",
        "/log",
    }


def test_the_log_with_them_has_no_finding(log: Path) -> None:
    assert check_log(log).findings == []
