"""Doubtful data in an evidence folder: each gives a finding and is not used."""

import math
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from bridge.faults import Fault
from diagnosis.evidence.folder import load_evidence, read_columns
from tests.evidence_folder import MANIFEST, Columns, columns, folder, kinds
from tests.logs import short_log
from tests.made_evidence import made_evidence
from tests.made_protocols import case_of


def spike_of_nan(data: Columns) -> None:
    data["mass_accel_mps2"][[7, 9]] = np.nan, np.inf


def repeated_time(data: Columns) -> None:
    data["t_s"][100] = data["t_s"][99]


def dead_sensor(data: Columns) -> None:
    data["mass_accel_mps2"][:] = 0.0


def clipped_force(data: Columns) -> None:
    np.minimum(data["drive_force_N"], 16.0, out=data["drive_force_N"])


def accel_in_other_unit(data: Columns) -> None:
    data["mass_accel_mps2"] *= 1e6


def hole_in_time(data: Columns) -> None:
    data["t_s"][1000:] += 0.15


def drive_in_mm(data: Columns) -> None:
    data["drive_position_m"] *= 1000.0


def mass_in_mm(data: Columns) -> None:
    data["mass_position_m"] = data["drive_position_m"] * 1000.0


def twice_as_fast(data: Columns) -> None:
    data["drive_position_m"] *= 2.0


def force_the_other_way(data: Columns) -> None:
    data["drive_force_N"] *= -1.0


def no_value(data: Columns) -> None:
    data["drive_force_N"][[500, 700]] = -9999.0


def wild(data: Columns) -> None:
    data["mass_accel_mps2"][[500, 700]] = -2e5, 1.5e5


def negative_vibration(data: Columns) -> None:
    data["vibration_frequency_Hz"] = np.full(4000, 2000.0)
    data["vibration_amplitude_m"] = np.full(4000, -2e-8)


def misspelt(data: Columns) -> None:
    data["mass_Accel_mps2"] = data.pop("mass_accel_mps2")


def half_a_vibration(data: Columns) -> None:
    data["vibration_frequency_Hz"] = np.full(4000, 2000.0)


def slow_accelerometer(data: Columns) -> None:
    half_a_vibration(data)
    data["vibration_amplitude_m"] = np.full(4000, 2e-8)


@pytest.mark.parametrize(
    ("change", "kind", "text", "unused", "rows"),
    [
        (spike_of_nan, "not-finite", "mass_accel_mps2: 2 samples are no finite number, first row 8", "", 3998),
        (repeated_time, "time", "t_s: 1 row is not later than the row before, first row 101", "", 3999),
        (dead_sensor, "constant", "mass_accel_mps2: is 0 in every row; not used", "mass_accel_mps2", 4000),
        (accel_in_other_unit, "wrong-unit", "mass_accel_mps2: reaches", "mass_accel_mps2", 4000),
        (clipped_force, "clipped", "drive_force_N: ", "", 4000),
        (hole_in_time, "time-gap", "t_s: 1 gap in time, first at 0.4995 s, the longest 0.1", "", 4000),
        (
            drive_in_mm,
            "wrong-unit",
            "drive_position_m: travels 1: the drive moves by 0.001 m in this time",
            "drive_position_m",
            4000,
        ),
        (mass_in_mm, "wrong-unit", "mass_position_m: travels 1: the drive moves by 0.001 m", "mass_position_m", 4000),
        (twice_as_fast, "units", "moves at 0.001 m/s on average, but drive_velocity_mps = 0.0005", "", 4000),
        (force_the_other_way, "sign", "drive_force_N: pulls against the drive's motion", "drive_force_N", 4000),
        (no_value, "outlier", "2 outliers, first row 501 = -9999: no measurement; left out", "", 3998),
        (wild, "wild", "mass_accel_mps2: 2 samples are beyond 100000, first row 501: -200000; not used", "", 3998),
        (negative_vibration, "sign", "vibration_amplitude_m: 4000 samples are negative", "", 4000),
        (
            slow_accelerometer,
            "rate",
            "mass_accel_mps2: 2000 Hz, below 8000 Hz: the strength of its vibration",
            "",
            4000,
        ),
    ],
)
def test_doubtful_columns_are_reported_and_not_used(
    tmp_path: Path, change: Callable[[Columns], None], kind: str, text: str, unused: str, rows: int
) -> None:
    data = columns()
    change(data)
    evidence = load_evidence(folder(tmp_path, data))
    assert text in kinds(evidence)[kind]
    (run,) = evidence.runs
    assert unused not in run.columns
    assert len(run.t_s) == rows
    assert (np.diff(run.t_s) > 0).all()
    assert all(np.isfinite(values).all() and len(values) == rows for values in run.columns.values())
    assert ("drive_force_N" in run.clipped) == (kind == "clipped")


def test_only_the_end_that_a_sensor_reached_limits_the_model(tmp_path: Path) -> None:
    """The finding names the row of the file: earlier rows that were left out count."""
    data = columns()
    repeated_time(data)
    clipped_force(data)
    evidence = load_evidence(folder(tmp_path, data))
    assert evidence.runs[0].clipped == {"drive_force_N": (-math.inf, 16.0)}
    first = int(np.flatnonzero(data["drive_force_N"] == 16.0)[0]) + 1
    assert first > 101
    assert f"first row {first};" in kinds(evidence)["clipped"]


def test_a_drive_that_goes_back_may_unload_its_spring(tmp_path: Path) -> None:
    """The drive returns by 0.1 mm and its spring is extended by 1.3 mm: the force stays positive."""
    data = columns()
    data["drive_position_m"] *= -0.1
    manifest = MANIFEST.replace("drive_velocity_mps = 0.0005", "")
    assert kinds(load_evidence(folder(tmp_path, data, manifest))) == {}


def test_an_amplitude_without_a_frequency_is_reported_and_not_used(tmp_path: Path) -> None:
    data = columns()
    half_a_vibration(data)
    findings = load_evidence(folder(tmp_path, data)).findings
    (finding,) = [item for item in findings if "vibration" in item.where]
    assert finding.in_words().split()[:3] == ["missing", "run-01.parquet:", "vibration_frequency_Hz:"]


def test_a_speed_without_a_drive_position_may_be_in_mm(tmp_path: Path) -> None:
    data = columns()
    del data["drive_position_m"]
    manifest = MANIFEST.replace("drive_velocity_mps = 0.0005", "drive_velocity_mps = 0.5")
    assert (
        "0.5 m/s, 1e+03 times rig.stribeck_velocity_mps"
        in kinds(load_evidence(folder(tmp_path, data, manifest)))["wrong-unit"]
    )


@pytest.mark.parametrize("stated", [True, False])
def test_a_drive_that_rests_in_the_whole_run_is_reported(tmp_path: Path, stated: bool) -> None:
    """The verdict on such a run is `no-gap` for nearly every rig."""
    data = columns()
    data["drive_position_m"][:] = 0.01 + np.random.default_rng(2).normal(0, 1e-7, 4000)
    if stated:
        del data["drive_position_m"]
    speed = "drive_velocity_mps = 0.0" if stated else ""
    reported = kinds(load_evidence(folder(tmp_path, data, MANIFEST.replace("drive_velocity_mps = 0.0005", speed))))
    assert "the drive rests during the run: friction and drive are not tested" in reported["still"]


def test_a_clock_with_too_few_digits_is_refused(tmp_path: Path) -> None:
    data = columns()
    data["t_s"] = np.round(data["t_s"], 3)
    with pytest.raises(
        Fault, match=r"1999 of 4000 rows.* more digits.* source.sample_rate_Hz in place of channels.t_s"
    ):
        load_evidence(folder(tmp_path, data))


def test_time_in_ms_is_refused(tmp_path: Path) -> None:
    """51.2 kHz in ms is a sample every 20 ms, and a slip of this rig lasts 36."""
    data = columns()
    data["t_s"] = np.arange(4000) / 51.2
    with pytest.raises(
        Fault, match=r"t_s: a sample every 0.0195.* must be 0.0119 s at most.* channels.t_s.scale = 0.001"
    ):
        load_evidence(folder(tmp_path, data))


def test_a_relative_tolerance_of_zero_is_reported(tmp_path: Path) -> None:
    manifest = MANIFEST.replace("mass_kg = 0.005", "drive_damping_Ns_per_m = 0.1")
    assert (
        "rig.tolerance.drive_damping_Ns_per_m: is relative"
        in kinds(load_evidence(folder(tmp_path, columns(), manifest)))["tolerance"]
    )


def test_the_loss_of_a_cut_log_is_reported(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(short_log()[: len(short_log()) * 2 // 3])
    columns, (cut,) = read_columns(tmp_path / "run.mcap", {})
    assert 3000 < len(columns["t_s"]) < 7000
    assert cut.kind == "cut"
    assert "log recover" in cut.text


def test_a_misspelt_column_is_named(tmp_path: Path) -> None:
    data = columns()
    misspelt(data)
    message = [
        finding.text for finding in load_evidence(folder(tmp_path, data)).findings if "mass_accel_mps2" in finding.where
    ]
    assert (
        message[0] == 'missing, but mass_Accel_mps2 is present: set channels.mass_accel_mps2.column = "mass_Accel_mps2"'
    )


@pytest.mark.parametrize("rows", [slice(0, 300), slice(-300, None)])
def test_a_force_that_is_clipped_at_the_begin_or_end_of_a_run_is_reported(tmp_path: Path, rows: slice) -> None:
    data = columns()
    data["drive_force_N"][rows] = 20.0
    evidence = load_evidence(folder(tmp_path, data))
    assert evidence.runs[0].clipped == {"drive_force_N": (-math.inf, 20.0)}
    assert "300 samples at 20, first row" in kinds(evidence)["clipped"]


def test_a_drive_that_rests_before_it_starts_is_not_cut_off(tmp_path: Path) -> None:
    """A commanded position without noise: its first step from rest is ten times the steps of the slow last stretch."""
    data = columns()
    velocity_mps = np.repeat([0.0, 0.001, 0.0001], [1000, 500, 2500])
    data["drive_position_m"] = 0.01 + np.cumsum(velocity_mps) / 2000
    manifest = MANIFEST.replace("drive_velocity_mps = 0.0005", "")
    assert kinds(load_evidence(folder(tmp_path, data, manifest))) == {}


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda values: np.where(np.arange(4000) < 2500, np.nan, values),
            "no finite number in 2500 of 4000 rows, first row 1",
        ),
        (
            lambda values: np.where(np.arange(4000) == 7, np.nan, values),
            "no finite number in 1 of 4000 rows, first row 8",
        ),
        (lambda values: values * 1e6, "reaches 0.02: must be below 0.001, the unit cannot be right; set channels"),
    ],
    ids=["blank where it is off", "one", "in um"],
)
def test_a_vibration_that_cannot_be_read_is_not_left_out(
    tmp_path: Path, spoil: Callable[[np.ndarray], np.ndarray], message: str
) -> None:
    """Otherwise the model would omit the vibration of this run and predict it in the other runs."""
    data = columns()
    slow_accelerometer(data)
    data["vibration_amplitude_m"] = spoil(data["vibration_amplitude_m"])
    with pytest.raises(Fault, match=f"BAD_EVIDENCE: run-01.parquet: vibration_amplitude_m: {message}"):
        load_evidence(folder(tmp_path, data))


def test_positions_in_mm_are_reported_where_the_drive_goes_to_and_fro(tmp_path: Path) -> None:
    """The drive returns to its start, and no velocity is stated."""
    data = columns()
    to_and_fro_m = 2e-3 * (1.0 - np.abs(np.linspace(-1.0, 1.0, 4000)))
    for scale, kind in ((1.0, None), (1000.0, "wrong-unit")):
        data["drive_position_m"] = scale * to_and_fro_m
        manifest = MANIFEST.replace("drive_velocity_mps = 0.0005", "")
        reported = kinds(load_evidence(folder(tmp_path, data, manifest)))
        assert list(reported) == ([kind] if kind else [])
    assert "drive_position_m: 2 m/s, 4e+03 times rig.stribeck_velocity_mps: is it in mm?" in reported["wrong-unit"]
    data["drive_position_m"], data["mass_position_m"] = to_and_fro_m, 1000.0 * to_and_fro_m
    reported = kinds(load_evidence(folder(tmp_path, data, manifest)))
    assert "mass_position_m: travels 2: the drive moves by 0.002 m" in reported["wrong-unit"]


def test_a_mapped_column_that_one_run_lacks_is_reported_and_one_that_all_lack_is_refused(tmp_path: Path) -> None:
    data = columns()
    channels = '[channels]\nmass_accel_mps2 = { column = "acc" }\n[[run]]'
    manifest = MANIFEST.replace("[[run]]", channels) + '[[run]]\nfile = "run-02.parquet"\ndrive_velocity_mps = 0.0005\n'
    other = {"acc": data.pop("mass_accel_mps2"), **data}
    pq.write_table(pa.table(other), folder(tmp_path, data, manifest) / "run-02.parquet")
    evidence = load_evidence(tmp_path)
    assert ["mass_accel_mps2" in run.columns for run in evidence.runs] == [False, True]
    assert (
        "run-01.parquet: mass_accel_mps2: column acc: not in the file; known here: t_s, drive_force_N"
        in kinds(evidence)["column"]
    )
    pq.write_table(pa.table(data), tmp_path / "run-02.parquet")
    with pytest.raises(
        Fault, match=r"column acc: not in the file; known .*; no run has it: correct channels.mass_accel_mps2"
    ):
        load_evidence(tmp_path)


@pytest.fixture(scope="module")
def measured() -> Path:
    return made_evidence(case_of("short"), 1)


@pytest.mark.parametrize(
    ("key", "value", "kind", "expected"),
    [
        ("channels.mass_accel_mps2.scale", -1.0, "sign", "mass_accel_mps2: has the wrong sign: the mass seems"),
        ("channels.mass_accel_mps2.scale", 0.10197, "wrong-unit", "shows a drive stiffness of 1.1e+05 N/m"),
        ("rig.drive_stiffness_N_per_m", 11.7, "wrong-unit", "but rig.drive_stiffness_N_per_m = 11.7: check the units"),
        ("rig.drive_stiffness_N_per_m", 6000.0, "", ""),
        ("rig.mass_kg", 1500.0, "wrong-unit", "rig.mass_kg: = 1500 times the largest acceleration"),
        ("rig.mass_kg", 3.0, "", ""),
    ],
)
def test_a_force_that_contradicts_the_acceleration_reveals_a_wrong_sign_or_unit(
    measured: Path, tmp_path: Path, key: str, value: float, kind: str, expected: str
) -> None:
    for path in measured.glob("*.parquet"):
        shutil.copy(path, tmp_path)
    manifest = tomllib.loads((measured / "manifest.toml").read_text())
    rig, (first, *_) = manifest["rig"], manifest["run"]
    section, name, *_ = key.split(".")
    lines = ['format = "evidence/1"', "[rig]"]
    if section == "rig":
        rig[name] = value
    lines += [f"{key} = {value!r}".replace("'", '"') for key, value in rig.items() if key != "tolerance"]
    lines += ["[rig.tolerance]", *(f"{key} = {value}" for key, value in rig["tolerance"].items())]
    if section == "channels":
        lines += ["[channels]", f'{name} = {{ column = "{name}", scale = {value} }}']
    lines += ["[[run]]", *(f"{key} = {value!r}".replace("'", '"') for key, value in first.items() if key != "holdout")]
    (tmp_path / "manifest.toml").write_text("\n".join(lines))
    evidence = load_evidence(tmp_path)
    by_kind = {finding.kind: f"{finding.where}: {finding.text}" for finding in evidence.findings}
    assert expected in by_kind.get(kind, "")
    assert {"sign", "wrong-unit"} & by_kind.keys() == ({kind} if kind else set())
    assert ("mass_accel_mps2" in evidence.runs[0].columns) == (kind != "sign")


def test_numbers_without_a_tolerance_are_reported(tmp_path: Path) -> None:
    manifest = MANIFEST.replace("static_force_N = 0.03\nstribeck_velocity_mps = 0.1\n", "")
    text = kinds(load_evidence(folder(tmp_path, columns(), manifest)))["tolerance"]
    assert "rig.tolerance: missing for static_force_N, stribeck_velocity_mps: counts as known exactly, so" in text
