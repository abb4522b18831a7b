"""Export: every value of a log comes back from every format."""

import json
import resource
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow
import pyarrow.csv
import pyarrow.parquet
import pytest
from typer.testing import CliRunner

from bridge.faults import Fault
from bridge.log.log_reader import LogReader
from bridge.log.logfile import STREAMING, iter_pieces, read_run
from bridge.tables import writers
from bridge.tables.export import export
from bridge.tables.readers import read_table
from bridge.wire.channels import CHANNELS
from cockpit.commands.log import log_app
from tests.logs import short_log, tables_of, write
from tests.unit.bridge.rig.boxes import rig_file, table

ALL = list(STREAMING)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    return path


def columns_of(suffix: str, to: Path, topic: str) -> dict[str, Any]:
    if suffix == ".mat":
        table = read_table(to)
        return {
            name.removeprefix(f"{topic}."): values for name, values in table.columns.items() if name.startswith(topic)
        }
    path = to.with_name(f"{to.stem}.{topic}{suffix}")
    # numbers of blocks go up to 2^64 - 1, which a reader that guesses takes for floating point
    types = pyarrow.csv.ConvertOptions(column_types={"command_block": pyarrow.uint64()})
    table = (
        pyarrow.parquet.read_table(path) if suffix == ".parquet" else pyarrow.csv.read_csv(path, convert_options=types)
    )
    return {name: table.column(name).to_numpy() for name in table.column_names}


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".mat"])
@pytest.mark.slow
def test_every_value_comes_back(log: Path, tmp_path: Path, suffix: str) -> None:
    to = tmp_path / f"out{suffix}"
    shares: list[float] = []
    written = export(log, to, ALL, progress=shares.append)
    run = read_run(log)
    for topic in ALL:
        expected = getattr(run, topic)
        exported = columns_of(suffix, to, topic)
        for name in expected.dtype.names:
            if topic == "sensors" and name not in CHANNELS:
                continue
            # a CSV file holds a float32 in as few digits as identify it
            assert (exported[name].astype(expected[name].dtype) == expected[name].ravel()).all(), name
        assert len(exported["t_s"]) == written.rows[topic]
    t_s = columns_of(suffix, to, "sensors")["t_s"]
    assert t_s == pytest.approx(np.arange(1, 8001) / 20000, abs=1e-12)
    assert shares == sorted(shares)
    assert shares[-1] <= 1.0
    assert not list(tmp_path.glob("*.part"))
    assert not list(tmp_path.glob("*.columns"))


def test_values_in_units_of_the_device_are_exported_by_the_calibration_in_the_header(log: Path, tmp_path: Path) -> None:
    run = read_run(log)
    channels = table()["channels"] | {
        "drive_force_N": {"source": 3, "scale": 50.0, "sign": -1, "offset": 2.0},
        "mass_position_m": {"derive": "drive_position_m"},
    }
    plant = {"rig": rig_file(channels=channels).header()}
    run.headers["plant"]["configuration"] = json.dumps(plant)
    write(tmp_path / "real.mcap", tables_of(run), run)
    export(tmp_path / "real.mcap", tmp_path / "raw.parquet", ["sensors"], raw=True)
    exported = pyarrow.parquet.read_table(tmp_path / "raw.parquet")
    volts = exported.column("raw_drive_force").to_numpy()
    assert np.array_equal((2.0 - 50.0 * volts).astype(np.float32), run.sensors["drive_force_N"].ravel())
    assert [name for name in exported.column_names if name.startswith("raw_")] == [
        "raw_drive_force",
        "raw_mass_accel",
        "raw_base_accel",
        "raw_drive_position",
    ]
    with pytest.raises(Fault, match="--raw: the header of the log has no calibration"):
        export(log, tmp_path / "none.parquet", ["sensors"], raw=True)


def test_units_are_exported(log: Path, tmp_path: Path) -> None:
    export(log, tmp_path / "one.parquet", ["sensors"])
    schema = pyarrow.parquet.read_schema(tmp_path / "one.parquet")
    assert schema.field("mass_accel_mps2").metadata[b"unit"] == b"m/s^2"
    export(log, tmp_path / "all.mat", ALL)
    units = read_table(tmp_path / "all.mat").columns
    assert units["units.sensors.drive_force_N"].tolist() == ["N"]
    assert units["units.trace.slips"].tolist() == ["1"]
    assert units["units.trace.vibration_velocity_mps"].tolist() == ["m/s"]


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".mat"])
def test_a_full_disk_is_reported_and_leaves_no_file(log: Path, tmp_path: Path, suffix: str) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(Fault, match=r"LOG_WRITE: .*File too large; free space"):
            export(log, tmp_path / f"out{suffix}", ALL)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == [log]


def test_a_matlab_file_has_the_header_and_classes_of_version_7_3(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writers, "BATCH_ROWS", 150)  # of 400 blocks: columns grow
    to = tmp_path / "all.mat"
    export(log, to, ["trace", "sensors"])
    head = to.read_bytes()[:520]
    assert head.startswith(b"MATLAB 7.3 MAT-file")
    assert head[124:128] == b"\x00\x02IM"
    assert head[512:] == b"\x89HDF\r\n\x1a\n"
    trace = read_run(log).trace
    with h5py.File(to) as file:
        assert file.userblock_size == 512
        names = ("trace/t_s", "sensors/drive_force_N", "trace/mode", "trace/sequence")
        assert [file[name].attrs["MATLAB_class"] for name in names] == [b"double", b"single", b"uint32", b"uint64"]
        assert {file[name].attrs["MATLAB_class"] for name in ("trace", "units", "units/trace")} == {b"struct"}
        assert file["trace/force_rate"].shape == (1, 400)
        assert (file["trace/force_rate"][0] == trace["force_rate"]).all()
        unit = file["units/trace/drive_force_N"]
        assert unit.attrs["MATLAB_class"] == b"char"
        assert unit.attrs["MATLAB_int_decode"] == 2
        assert unit[:, 0].tobytes().decode("utf-16-le") == "N"


def test_only_the_wanted_time(log: Path, tmp_path: Path) -> None:
    written = export(log, tmp_path / "part.parquet", ["sensors", "trace"], 0.1, 0.2)
    t_s = pyarrow.parquet.read_table(tmp_path / "part.sensors.parquet").column("t_s").to_numpy()
    assert t_s.min() == pytest.approx(0.1)
    assert t_s.max() < 0.2
    assert written.rows == {"sensors": 2000, "trace": 100}


def test_nothing_in_that_time(log: Path, tmp_path: Path) -> None:
    for suffix in (".parquet", ".mat", ".csv"):
        assert export(log, tmp_path / f"none{suffix}", ALL, 5.0, 6.0).files == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.mcap"]


@pytest.mark.parametrize(
    ("to", "topics", "times", "expected"),
    [
        ("a.xls", ["sensors"], (0, 1), "--to"),
        ("a.csv", ["sensor"], (0, 1), "--topic sensor: no streaming topic; known: sensors, applied"),
        ("a.csv", ["sensors"], (1, 1), "--from 1 --until 1"),
        ("run.mcap/a.csv", ["sensors"], (0, 1), "choose another --to"),
    ],
)
def test_a_wrong_request_is_one_clear_line(
    log: Path, to: str, topics: list[str], times: tuple[float, float], expected: str
) -> None:
    with pytest.raises(Fault) as caught:
        export(log, log.parent / to, topics, *times)
    assert expected in caught.value.line


def test_tables_chunk_by_chunk_are_the_whole_run(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = read_run(log)  # its chunks several at once
    monkeypatch.setattr("bridge.log.log_reader.AT_ONCE_BYTES", 1)
    pieces: dict[str, list[bytes]] = {name: [] for name in STREAMING}
    for piece in iter_pieces(LogReader(log)):
        if piece.topic in STREAMING:
            pieces[piece.topic].append(piece.records.tobytes())
    assert len(pieces["sensors"]) > 5
    for name in STREAMING:
        assert b"".join(pieces[name]) == getattr(run, name).tobytes()


def test_only_the_topics_that_are_asked_for_are_read(log: Path) -> None:
    assert {piece.topic for piece in iter_pieces(LogReader(log), {"trace", "snapshot"})} <= {"trace", "snapshot"}


def test_the_command(log: Path, tmp_path: Path) -> None:
    result = CliRunner().invoke(
        log_app, ["export", str(log), "--to", str(tmp_path / "x.csv"), "--topic", "trace", "--json"]
    )
    assert result.exit_code == 0
    assert '"rows": {"trace": 400}' in result.stdout
    result = CliRunner().invoke(log_app, ["export", str(tmp_path / "no.mcap"), "--to", str(tmp_path / "x.csv")])
    assert result.exit_code == 7
