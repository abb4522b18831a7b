"""Import: every format gives the same evidence, and bad input leaves nothing behind."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
import scipy.io
from typer.testing import CliRunner

from bridge.config import validate
from bridge.faults import Fault
from bridge.log.check.log_check import check_log
from bridge.log.logfile import read_run
from bridge.tables.export import export
from bridge.tables.readers import read_table
from cockpit.commands.log import log_app
from diagnosis.evidence.folder import load_evidence
from diagnosis.evidence.import_table import ImportMap, import_file
from tests.logs import short_log
from tests.unit.diagnosis.evidence.measured_tables import MAP, ROWS, raw, setup, write_raw


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mat", ".tdms"])
@pytest.mark.slow
def test_a_file_becomes_evidence(tmp_path: Path, suffix: str) -> None:
    source, channel_map = setup(tmp_path, suffix)
    done = import_file(source, channel_map, tmp_path / "evidence")
    evidence = load_evidence(tmp_path / "evidence")
    (run,) = evidence.runs
    data = raw()
    assert done.rows == ROWS
    assert run.t_s == pytest.approx(data["time"] * 1e-3)
    assert run.columns["drive_force_N"] == pytest.approx(0.5 * data["F"] + 1.0)
    assert run.columns["mass_accel_mps2"] == pytest.approx(9.80665 * data["acc"])
    assert run.drive_velocity_mps == 0.0005
    assumed_too = {"contact_stiffness_N_per_m": 0.3, "contact_damping_Ns_per_m": 0.3}
    assert evidence.rig.tolerance == {"mass_kg": 0.005} | assumed_too
    # presliding of 0.22 um, critically damped: values of the paper's pair, 77.5 N/um and 2.15e4 N s/m
    assert evidence.rig.contact_stiffness_N_per_m == pytest.approx(17.38 / 0.22e-6)
    assert evidence.rig.contact_damping_Ns_per_m == pytest.approx(2.15e4, rel=0.02)
    assumed = [finding.where for finding in done.findings if finding.kind == "assumed"]
    assert "manifest.toml: rig.contact_stiffness_N_per_m" in assumed
    assert "# assumed, not measured" in (tmp_path / "evidence" / "manifest.toml").read_text()


def test_a_text_in_the_place_of_a_channel_is_its_column() -> None:
    wanted = validate(ImportMap, {"channels": {"t_s": "Zeit [s]", "drive_force_N": {"column": "F"}}}, "map.toml")
    assert wanted.channels["t_s"].column == "Zeit [s]"
    assert (wanted.channels["t_s"].scale, wanted.channels["t_s"].offset) == (None, 0.0)
    with pytest.raises(Fault, match=r"map.toml: channels.t_s = 3.5: must be a table; write t_s = { column = VALUE }"):
        validate(ImportMap, {"channels": {"t_s": 3.5, "drive_force_N": "F"}}, "map.toml")
    with pytest.raises(Fault, match=r"map.toml: channels.t_s.column = '': "):
        validate(ImportMap, {"channels": {"t_s": "", "drive_force_N": "F"}}, "map.toml")


def test_a_drive_speed_in_mm_per_s_is_refused(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    channel_map.write_text(MAP.replace("drive_velocity_mps = 0.0005", "drive_velocity_mps = 20.0"))
    with pytest.raises(Fault, match=r"CONFIG: .*run.drive_velocity_mps = 20"):
        import_file(source, channel_map, tmp_path / "evidence")
    assert not (tmp_path / "evidence").exists()


@pytest.mark.slow
def test_a_second_run_is_added_to_its_rig_only(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    out = tmp_path / "evidence"
    import_file(source, channel_map, out)
    with pytest.raises(Fault, match="is already a run of this folder"):
        import_file(source, channel_map, out)
    second = source.rename(tmp_path / "second.csv")
    channel_map.write_text(MAP + "holdout = true\n")
    import_file(second, channel_map, out)
    assert [(run.file, run.holdout) for run in load_evidence(out).runs] == [
        ("measured.parquet", False),
        ("second.parquet", True),
    ]
    before = (out / "manifest.toml").read_text()
    channel_map.write_text(MAP.replace("mass_kg = 1.5", "mass_kg = 1.6"))
    with pytest.raises(Fault, match="describes another rig"):
        import_file(second.rename(tmp_path / "third.csv"), channel_map, out)
    assert (out / "manifest.toml").read_text() == before
    assert sorted(path.name for path in out.iterdir()) == ["manifest.toml", "measured.parquet", "second.parquet"]


def test_the_first_run_of_a_folder_cannot_be_held_out(tmp_path: Path) -> None:
    """Such a folder could neither be diagnosed nor be extended by a run."""
    source, channel_map = setup(tmp_path, ".csv", MAP + "holdout = true\n")
    with pytest.raises(
        Fault, match=r"map.toml: run.holdout = true: must be false for the first run .* import .* first"
    ):
        import_file(source, channel_map, tmp_path / "evidence")
    assert not (tmp_path / "evidence").exists()


@pytest.mark.parametrize("suffix", [".csv", ".tdms"])
def test_a_file_becomes_a_log(tmp_path: Path, suffix: str) -> None:
    source, channel_map = setup(tmp_path, suffix)
    done = import_file(source, channel_map, tmp_path / "made.mcap")
    run = read_run(tmp_path / "made.mcap")
    assert len(run.sensors) == 200
    assert done.rows == 4000
    assert run.sensors["t_ns"][0] == 10_000_000
    assert run.sensors["drive_force_N"].ravel() == pytest.approx(0.5 * raw()["F"][:4000] + 1.0, rel=1e-6)
    assert np.isnan(run.sensors["mass_position_m"]).all()  # a zero would be a position
    assert json.loads(run.headers["import"]["missing"]) == ["base_accel_mps2", "mass_position_m", "drive_position_m"]
    # channels that were never there are not reported as dead
    assert check_log(tmp_path / "made.mcap").findings == []


def test_a_log_of_uneven_time_is_interpolated_with_a_finding(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    data = raw()
    data["time"] += np.random.default_rng(1).uniform(-0.1, 0.1, ROWS)
    write_raw(source, data)
    done = import_file(source, channel_map, tmp_path / "made.mcap")
    assert "uneven" in {finding.kind: finding.text for finding in done.findings}["time"]


def test_over_a_gap_nothing_is_interpolated(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    data = raw()
    data["time"][2000:] += 2000.0
    write_raw(source, data)
    done = import_file(source, channel_map, tmp_path / "made.mcap")
    assert (
        "1 gap in time, first at 0.9995 s, the longest 2 s"
        in {finding.kind: finding.text for finding in done.findings}["time-gap"]
    )
    run = read_run(tmp_path / "made.mcap")
    assert np.diff(run.sensors["t_ns"]).max() == pytest.approx(2.01e9, rel=0.01)
    assert len(run.sensors) == 200
    assert run.sensors["drive_force_N"].ravel()[2000:2010] == pytest.approx(0.5 * data["F"][2000:2010] + 1.0, abs=0.05)


def test_time_from_the_rate(tmp_path: Path) -> None:
    text = MAP.replace('t_s = { column = "time", scale = 1e-3 }\n', "")
    source, channel_map = setup(tmp_path, ".csv", text + "[source]\nsample_rate_Hz = 2000.0\n")
    import_file(source, channel_map, tmp_path / "evidence")
    assert load_evidence(tmp_path / "evidence").runs[0].t_s == pytest.approx(raw()["time"] * 1e-3)
    source, channel_map = setup(tmp_path, ".tdms", text)  # holds its sample rate
    import_file(source, channel_map, tmp_path / "other")
    assert load_evidence(tmp_path / "other").runs[0].t_s == pytest.approx(raw()["time"] * 1e-3)


def test_a_csv_file_of_another_country(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv", MAP + '[source]\ndelimiter = ";"\ndecimal = ","\nskip_rows = 2\n')
    data = raw()
    lines = [";".join(f"{data[name][row]:.9g}".replace(".", ",") for name in data) for row in range(ROWS)]
    source.write_text("DAQ 7\n12.05.2024\n" + ";".join(data) + "\n" + "\n".join(lines) + "\n")
    import_file(source, channel_map, tmp_path / "evidence")
    assert load_evidence(tmp_path / "evidence").runs[0].columns["drive_force_N"] == pytest.approx(0.5 * data["F"] + 1)


def test_an_exported_log_can_be_imported(tmp_path: Path) -> None:
    log, channel_map = tmp_path / "run.mcap", tmp_path / "map.toml"
    log.write_bytes(short_log())
    export(log, tmp_path / "run.mat", ["sensors", "trace"])
    channel_map.write_text(
        '[channels]\nt_s = { column = "sensors.t_s" }\ndrive_force_N = { column = "sensors.drive_force_N" }\n'
    )
    import_file(tmp_path / "run.mat", channel_map, tmp_path / "again.mcap")
    assert (read_run(tmp_path / "again.mcap").sensors["drive_force_N"] == read_run(log).sensors["drive_force_N"]).all()


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('"F"', '"Force"', "measured.csv: column Force: not in the file; known here: time, F, acc, note"),
        ("drive_force_N =", "force =", "map.toml: channels.force: unknown key; known here: t_s,"),
        ("offset = 1.0", "offset = true", "map.toml: channels.drive_force_N.offset = True"),
        ("scale = 0.5", "scale = 0.0", "map.toml: channels.drive_force_N: scale = 0: must not be 0"),
        ("[rig]", "[source]\nsample_rate_Hz = 2000.0\n[rig]", "source.sample_rate_Hz: there is a channel t_s too"),
        ('"time", scale = 1e-3', '"acc"', "measured.csv: t_s: "),
        ("scale = 0.5", "scale = 0.5e6", "drive_force_N"),
    ],
)
def test_a_bad_map_is_one_clear_line_and_leaves_nothing(tmp_path: Path, old: str, new: str, expected: str) -> None:
    source, channel_map = setup(tmp_path, ".csv", MAP.replace(old, new))
    if "0.5e6" in new:
        channel_map.write_text(channel_map.read_text().replace("mass_accel_mps2 =", "base_accel_mps2 ="))
    with pytest.raises(Fault) as caught:
        import_file(source, channel_map, tmp_path / "evidence")
    assert expected in caught.value.line
    assert caught.value.kind.exit_status == 2
    assert not (tmp_path / "evidence").exists()


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("mass_kg = 1.5", "mass_kg = -2", "map.toml: rig: mass_kg = -2: must be greater than 0; change the value"),
        ("mass_kg = 1.5", 'mass_kg = "2 kg"', "map.toml: rig: mass_kg = '2 kg': must be a number; "),
        ("mass_kg = 1.5", "mas_kg = 1.5", "map.toml: rig: mas_kg = 1.5: unknown key; perhaps mass_kg; "),
        (
            "static_force_N = 17.38",
            "static_force_N = inf",
            "map.toml: rig: static_force_N = inf: must be a finite number",
        ),
        (
            "mass_kg = 1.5",
            "mass_kg = 1.5\ncontact_stiffness_N_per_m = 0",
            "map.toml: rig: contact_stiffness_N_per_m = 0: ",
        ),
    ],
)
@pytest.mark.slow
def test_one_wrong_number_of_the_rig_makes_one_line(tmp_path: Path, old: str, new: str, expected: str) -> None:
    source, channel_map = setup(tmp_path, ".csv", MAP.replace(old, new, 1))
    with pytest.raises(Fault) as caught:
        import_file(source, channel_map, tmp_path / "evidence")
    assert caught.value.line.startswith(expected)
    assert "\n" not in caught.value.line


def test_a_log_needs_a_clock_that_goes_forward(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    data = raw()
    data["time"][123] = 0.0
    write_raw(source, data)
    with pytest.raises(Fault, match=r"measured\.csv: t_s: row 124"):
        import_file(source, channel_map, tmp_path / "made.mcap")
    assert not list(tmp_path.glob("made*"))


def test_findings_of_an_import_name_the_file_that_was_measured(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    done = import_file(source, channel_map, tmp_path / "evidence")
    named = {finding.where.partition(":")[0] for finding in done.findings}
    assert named == {"measured.csv", "manifest.toml"}


def test_an_imported_log_states_that_it_has_no_controller_and_names_its_commands(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    import_file(source, channel_map, tmp_path / "made.mcap")
    with pytest.raises(Fault) as caught:
        read_run(tmp_path / "made.mcap").configuration("controller")
    assert caught.value.line == (
        f"{tmp_path / 'made.mcap'}: is imported data of another program, without a controller: it holds no run to "
        "judge; `log info`, `log check`, `log export`, `plot` and `look` read it, and `diagnose` in an evidence folder"
    )


def test_a_row_without_a_time_is_left_out_of_a_log(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    data = raw()
    data["time"][-1] = np.inf
    write_raw(source, data)
    done = import_file(source, channel_map, tmp_path / "made.mcap")
    assert f"1 row without a time left out, first row {ROWS}" in [finding.text for finding in done.findings]


def test_measured_data_are_never_overwritten(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".parquet")
    before = source.read_bytes()
    with pytest.raises(Fault, match=r"measured\.parquet: exists already"):
        import_file(source, channel_map, tmp_path)
    assert source.read_bytes() == before
    import_file(source, channel_map, tmp_path / "made.mcap")
    with pytest.raises(Fault, match=r"made\.mcap: exists already"):
        import_file(source, channel_map, tmp_path / "made.mcap")


def test_a_file_may_have_any_name(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    odd = source.rename(tmp_path / "Läufe \U0001f600.csv")
    import_file(odd, channel_map, tmp_path / "evidence")
    assert load_evidence(tmp_path / "evidence").runs[0].file == "Läufe \U0001f600.parquet"


def test_a_time_of_any_clock_is_read(tmp_path: Path) -> None:
    """Nanoseconds since 1970 need more digits than a float holds exactly."""
    path = tmp_path / "epoch.parquet"
    pq.write_table(pa.table({"timestamp_ns": np.int64(1_700_000_000_123_456_789) + np.arange(5) * 500_000}), path)
    assert np.diff(read_table(path).column("timestamp_ns")) == pytest.approx(500_000, abs=256)


@pytest.mark.parametrize(
    ("byte", "value", "expected"), [(145, 11, "its reader was ended by signal"), (144, 0, "it is damaged")]
)
@pytest.mark.slow
def test_a_damaged_file_of_matlab_is_refused(tmp_path: Path, byte: int, value: int, expected: str) -> None:
    """The first damage marks a real column as complex, so SciPy reads beyond the end of the file."""
    scipy.io.savemat(tmp_path / "run.mat", raw())
    damaged = bytearray((tmp_path / "run.mat").read_bytes())
    damaged[byte] = value
    (tmp_path / "run.mat").write_bytes(damaged)
    with pytest.raises(Fault, match=rf"BAD_TABLE: run.mat: cannot be read as mat: .*{expected}.*; take another copy"):
        read_table(tmp_path / "run.mat")


@pytest.mark.slow
def test_a_damaged_compressed_file_of_matlab_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"force": np.random.default_rng(1).normal(size=4000)}, do_compression=True)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(Fault, match=r"run.mat: cannot be read as mat: .*take another copy"):
        read_table(path).column("force")


@pytest.mark.slow
def test_the_command(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".mat")
    arguments = ["import", str(source), "--map", str(channel_map), "--out", str(tmp_path / "evidence"), "--json"]
    result = CliRunner().invoke(log_app, arguments)
    assert result.exit_code == 0
    assert json.loads(result.stdout)["file"] == "measured.parquet"
    result = CliRunner().invoke(log_app, arguments)
    assert result.exit_code == 2
    assert json.loads(result.stdout)["fault"] == "BAD_EVIDENCE"


def test_columns_that_a_log_cannot_hold_are_reported(tmp_path: Path) -> None:
    vibration = '[channels]\nvibration_frequency_Hz = { column = "acc" }\nvibration_amplitude_m = { column = "acc" }\n'
    source, channel_map = setup(tmp_path, ".csv", MAP.replace("[channels]\n", vibration))
    findings = import_file(source, channel_map, tmp_path / "made.mcap").findings
    reported = [finding.where for finding in findings if "import it into a folder" in finding.text]
    assert reported == [f"{source.name}: vibration_frequency_Hz", f"{source.name}: vibration_amplitude_m"]


@pytest.mark.parametrize("sentinel", [-9999.0, 1e30, 2047.0])
def test_placeholders_of_missing_values_are_left_out_and_reported(tmp_path: Path, sentinel: float) -> None:
    source, channel_map = setup(tmp_path, ".parquet")
    data = raw()
    data["F"] = np.where(np.isin(np.arange(ROWS), [70, 71, 900]), sentinel, data["F"])
    write_raw(source, data)
    done = import_file(source, channel_map, tmp_path / "evidence")
    reported = {finding.kind: finding for finding in done.findings}
    assert (reported["outlier"].times, reported["not-finite"].times) == (3, 3)
    assert f"3 outliers, first row 71 = {sentinel:.6g}: no measurement; left out" in reported["outlier"].text
    assert "drive_force_N" in reported["not-finite"].where
    assert np.isnan(pq.read_table(tmp_path / "evidence" / "measured.parquet")["drive_force_N"].to_numpy()).sum() == 3


def test_a_force_with_the_other_sign_is_offered_in_a_line_that_can_be_copied(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".parquet")
    for name, scale in (("turned", -0.5), ("right", 0.5)):
        channel_map.write_text(
            MAP.replace("scale = 0.5", f"scale = {scale}").replace("offset = 1.0", f"offset = {2.0 * scale}")
        )
        reported = {
            finding.kind: finding.text for finding in import_file(source, channel_map, tmp_path / name).findings
        }
        line = 'under [channels] write drive_force_N = { column = "F", scale = 0.5, offset = 1.0 }'
        assert (line in reported.get("sign", "")) == (name == "turned")
